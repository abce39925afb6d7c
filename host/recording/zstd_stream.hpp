// SPDX-License-Identifier: GPL-3.0-or-later
// The two directions of zstd, in pieces and in bounded memory.
#pragma once

#include <zstd.h>

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace r4 {

class ZstdWriter {
 public:
  ZstdWriter();
  // Appends to `out` what a reader needs to have all of `bytes`; ends the frame where that is wanted, so
  // that what comes next can be read without what was before.
  void write(std::string_view bytes, bool end_frame, std::string& out);

 private:
  struct Free {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> context_;
};

// Frames one after the other. Behind damage it goes on with the next frame that there is.
class ZstdReader {
 public:
  static constexpr const char* window_problem =
      "a zstd frame that needs a window of more than 128 MiB";

  ZstdReader();
  enum class Step : unsigned char {
    more,     // all of the input is taken
    text,     // some of it, and text() is there; call again
    damaged,  // what was read here is damaged: it looks for the next frame; call again
  };
  // Takes from the front of `bytes`.
  Step step(std::string_view& bytes);
  std::string_view text() const { return {output_.data(), size_}; }
  // Why step() returned damaged.
  const char* problem() const;
  // True if that was a frame which needs more memory than is read: it is whole, and zstd --long=31 unpacks it.
  bool window_too_large() const { return window_too_large_; }
  // Between two frames: nothing of the last one is missing.
  bool between_frames() const { return !in_frame_; }

 private:
  bool find_frame(std::string_view& bytes);
  void search(std::string_view& bytes, bool from_found);

  struct Free {
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  std::unique_ptr<ZSTD_DCtx, Free> context_;
  std::string output_;
  std::size_t size_ = 0;
  bool in_frame_ = false;
  bool window_too_large_ = false;
  bool searching_ = false;
  std::string tail_;   // while it searches: the beginning of a frame, perhaps
  std::string last_;   // the last bytes that were taken
  std::string found_;  // the beginning of the frame that was found
};

// True if a file that begins so holds frames of zstd; four bytes tell.
bool is_zstd(std::string_view beginning);

}  // namespace r4
