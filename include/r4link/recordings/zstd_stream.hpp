// SPDX-License-Identifier: GPL-3.0-or-later
// Compresses and decompresses zstd, in pieces and in bounded memory.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include "../config.hpp"

struct ZSTD_CCtx_s;  // of zstd.h
struct ZSTD_DCtx_s;

namespace r4 {

class R4LINK_API ZstdWriter {
 public:
  ZstdWriter();
  // Appends the compressed `bytes` to `out`, so that a reader can read all bytes. `end_frame` ends
  // the frame, so that later bytes can be read without these bytes.
  void write(std::string_view bytes, bool end_frame, std::string& out);

 private:
  struct Free {
    void operator()(ZSTD_CCtx_s* context) const;
  };
  std::unique_ptr<ZSTD_CCtx_s, Free> context_;
};

// Reads frames one after the other. After damage, reading continues with the next frame.
class R4LINK_API ZstdReader {
 public:
  static constexpr const char* window_problem =
      "a zstd frame that needs a window of more than 128 MiB";

  ZstdReader();
  enum class Step : unsigned char {
    more,     // all input was taken
    text,     // some input was taken, and text() has its text; call again
    damaged,  // the input is damaged; call again to search for the next frame
  };
  // Removes the bytes that were read from the front of `bytes`.
  Step step(std::string_view& bytes);
  std::string_view text() const { return {output_.data(), size_}; }
  // Why step() returned damaged.
  const char* problem() const;
  // True if the frame needs more memory than this reader uses: zstd --long=31 unpacks the frame.
  bool window_too_large() const { return window_too_large_; }
  // True between two frames: the last frame is complete.
  bool between_frames() const { return !in_frame_; }

 private:
  R4LINK_PRIVATE bool find_frame(std::string_view& bytes);
  R4LINK_PRIVATE void search(std::string_view& bytes, bool from_found);

  struct Free {
    void operator()(ZSTD_DCtx_s* context) const;
  };
  std::unique_ptr<ZSTD_DCtx_s, Free> context_;
  std::string output_;
  std::size_t size_ = 0;
  bool in_frame_ = false;
  bool window_too_large_ = false;
  bool searching_ = false;
  std::string last_;   // the last bytes read
  std::string found_;  // the part of the next frame's magic number that was found
};

// True if a file with this beginning holds zstd frames. Needs four bytes.
R4LINK_API bool is_zstd(std::string_view beginning);

}  // namespace r4
