// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated board in its own process: this program as `r4 sim URL --json`, read through a pipe.
#pragma once

#include <sys/types.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <functional>
#include <string>
#include <string_view>

#include "../shell/json.hpp"

namespace r4::tool {

class ChildBoard {
 public:
  using OnEvent = std::function<void(const Json&)>;

  // `on_event` gets each printed object, on the io_context's thread. Throws Error.
  ChildBoard(asio::io_context& io, const std::string& url, OnEvent on_event);
  ~ChildBoard();
  ChildBoard(const ChildBoard&) = delete;
  ChildBoard& operator=(const ChildBoard&) = delete;

 private:
  void read_more();
  void take(std::string_view bytes);

  OnEvent on_event_;
  asio::posix::stream_descriptor output_;
  std::array<char, 4096> buffer_;
  std::string line_;
  pid_t pid_ = 0;
};

}  // namespace r4::tool
