// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/zstd_stream.hpp"

#include <zstd.h>
#include <zstd_errors.h>

#include <algorithm>
#include <new>

namespace r4 {
namespace {

// First bytes of a frame (RFC 8878, 3.1.1).
constexpr std::string_view magic = "\x28\xb5\x2f\xfd";
// Last three bytes of a skippable frame's magic number; the first is 0x50 to 0x5F (RFC 8878,
// 3.1.2). Files of pzstd and seekable archives start with such a frame.
constexpr std::string_view skippable = "\x2a\x4d\x18";
// The largest window to read: 128 MiB, as `zstd -d` without options. A small frame takes less.
constexpr int window_log = 27;
constexpr int level = 3;
// Window of written frames; a longer window gains nothing.
constexpr int frame_window_log = 20;
// Bytes read at once. Damage also loses the undamaged bytes of its slice.
constexpr std::size_t slice = 512;

// Returns the bytes before a possible next frame, at least one byte. The decoder would read the
// next frame as a part of a frame without an end.
std::string_view until_a_frame(std::string_view bytes) {
  std::size_t size = std::min(bytes.size(), bytes.find(magic, 1));
  for (std::size_t left = 1; left < magic.size() && size == bytes.size() && left < size; ++left) {
    if (magic.starts_with(bytes.substr(bytes.size() - left))) size -= left;
  }
  return bytes.substr(0, size);
}

}  // namespace

void ZstdWriter::Free::operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
void ZstdReader::Free::operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }

ZstdWriter::ZstdWriter() : context_(ZSTD_createCCtx()) {
  if (!context_) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_compressionLevel, level);
  ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_windowLog, frame_window_log);
  ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_checksumFlag, 1);
}

void ZstdWriter::write(std::string_view bytes, bool end_frame, std::string& out) {
  ZSTD_inBuffer input{bytes.data(), bytes.size(), 0};
  const ZSTD_EndDirective how = end_frame ? ZSTD_e_end : ZSTD_e_flush;
  std::size_t left = 0;
  do {
    const std::size_t before = out.size();
    out.resize(before + ZSTD_CStreamOutSize());
    ZSTD_outBuffer output{out.data() + before, out.size() - before, 0};
    left = ZSTD_compressStream2(context_.get(), &output, &input, how);
    out.resize(before + output.pos);
    // These calls fail only without memory.
    if (ZSTD_isError(left) != 0) throw std::bad_alloc();
  } while (left != 0);
}

ZstdReader::ZstdReader() : context_(ZSTD_createDCtx()) {
  if (!context_) throw std::bad_alloc();
  ZSTD_DCtx_setParameter(context_.get(), ZSTD_d_windowLogMax, window_log);
  output_.resize(ZSTD_DStreamOutSize());
}

ZstdReader::Step ZstdReader::step(std::string_view& bytes) {
  size_ = 0;
  if (searching_ && !find_frame(bytes)) return Step::more;
  const bool from_found = !found_.empty();
  if (bytes.empty() && !from_found) return Step::more;
  const std::string_view source =
      from_found ? std::string_view(found_) : until_a_frame(bytes.substr(0, slice));
  ZSTD_inBuffer input{source.data(), source.size(), 0};
  ZSTD_outBuffer output{output_.data(), output_.size(), 0};
  const std::size_t left = ZSTD_decompressStream(context_.get(), &output, &input);
  if (ZSTD_isError(left) != 0) {
    window_too_large_ = ZSTD_getErrorCode(left) == ZSTD_error_frameParameter_windowTooLarge;
    search(bytes, from_found);
    return Step::damaged;
  }
  in_frame_ = left != 0;
  size_ = output.pos;
  last_.append(source.substr(0, input.pos));
  last_.erase(0, last_.size() - std::min(last_.size(), magic.size() - 1));
  if (from_found) {
    found_.erase(0, input.pos);
  } else {
    bytes.remove_prefix(input.pos);
  }
  return Step::text;
}

// After a frame without an end, the next frame may start in bytes that were already taken.
void ZstdReader::search(std::string_view& bytes, bool from_found) {
  ZSTD_DCtx_reset(context_.get(), ZSTD_reset_session_only);
  searching_ = true;
  found_ = !from_found && in_frame_ ? last_ : "";
  while (!magic.starts_with(found_)) found_.erase(0, 1);
  if (!from_found && !in_frame_) bytes.remove_prefix(1);  // skips the damaged beginning
  in_frame_ = false;
  last_.clear();
}

bool ZstdReader::find_frame(std::string_view& bytes) {
  while (!bytes.empty()) {
    found_ += bytes.front();
    bytes.remove_prefix(1);
    while (!magic.starts_with(found_)) found_.erase(0, 1);
    if (found_.size() == magic.size()) {
      searching_ = false;
      return true;
    }
  }
  return false;
}

const char* ZstdReader::problem() const {
  return window_too_large_ ? window_problem : "damaged compression";
}

bool is_zstd(std::string_view beginning) {
  const bool skipped = beginning.size() >= 4 && beginning.substr(1).starts_with(skippable) &&
                       (static_cast<unsigned char>(beginning[0]) & 0xF0) == 0x50;
  return skipped || beginning.starts_with(magic);
}

}  // namespace r4
