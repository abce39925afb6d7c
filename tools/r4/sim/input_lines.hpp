// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/streambuf.hpp>
#include <functional>
#include <string>

#include "r4link/error.hpp"

namespace r4::tool {

class InputLines {
 public:
  // On the io_context's thread: `on_line` gets each line without its end, `on_end` a problem if a
  // line was too long. Throws Error if there is no standard input.
  InputLines(asio::io_context& io, std::function<void(const std::string&)> on_line,
             std::function<void(const Problem*)> on_end);

 private:
  void read_line();

  asio::posix::stream_descriptor input_;
  asio::streambuf buffer_;
  std::function<void(const std::string&)> on_line_;
  std::function<void(const Problem*)> on_end_;
};

}  // namespace r4::tool
