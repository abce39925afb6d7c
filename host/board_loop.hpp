// SPDX-License-Identifier: GPL-3.0-or-later
// The loop of a Board's thread, for transports.
#pragma once

#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <functional>
#include <utility>

#include "r4link/carrier.hpp"

namespace r4 {

class BoardLoop final : public Loop {
 public:
  explicit BoardLoop(asio::io_context& context) : io(context) {}
  void post(std::function<void()> function) override { asio::post(io, std::move(function)); }

  asio::io_context& io;
};

}  // namespace r4
