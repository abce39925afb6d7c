// SPDX-License-Identifier: GPL-3.0-or-later
// The recording that pages of r4 web begin and end. Disks may take their time: a thread of its own waits for them, and
// the boards' loop never does.
#pragma once

#include <asio/io_context.hpp>
#include <asio/thread_pool.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "r4link/recording.hpp"

namespace r4::tool::web {

class WebRecording {
 public:
  struct Told {
    std::string path;  // empty: nothing is recorded
    std::uint64_t bytes = 0;
    std::string why;  // it is not, or not any more
  };
  // `use` hands the recording to the boards, or takes it from them (null); `tell` is told what has changed. Both are
  // called on the loop.
  WebRecording(asio::io_context& io, std::string folder, std::function<void(Recording*)> use,
               std::function<void(const Told&)> tell);
  // Waits for the disk.
  ~WebRecording();

  void begin();
  void end();
  // Once a second: how large it is, and whether it has ended by itself, for the disk is full.
  void look();
  const Told& told() const { return told_; }

 private:
  void opened(std::shared_ptr<Recording> recording, std::string path);
  void failed(const std::string& why);
  void close(const std::string& why);

  asio::io_context& io_;
  const std::string folder_;
  const std::function<void(Recording*)> use_;
  const std::function<void(const Told&)> tell_;
  std::shared_ptr<Recording> recording_;
  bool opening_ = false;
  Told told_;
  asio::thread_pool disk_{1};
};

}  // namespace r4::tool::web
