// SPDX-License-Identifier: GPL-3.0-or-later
// What happens around simulated boards while they run: lines of a scenario without their times, on
// standard input.
#pragma once

#include <asio/io_context.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/streambuf.hpp>
#include <functional>
#include <string>

#include "firmware/ports/sim/script.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

class SimInput {
 public:
  // `happen` is called for each line, `fail` for one that cannot be understood, on the io_context's
  // thread. The end of the input ends nothing else.
  SimInput(asio::io_context& io, std::function<void(const sim::ScriptStep&)> happen,
           std::function<void(const Problem&)> fail);

 private:
  void read_line();
  void take(const std::string& line);

  asio::posix::stream_descriptor input_;
  asio::streambuf buffer_;
  std::function<void(const sim::ScriptStep&)> happen_;
  std::function<void(const Problem&)> fail_;
};

}  // namespace r4::tool
