// SPDX-License-Identifier: GPL-3.0-or-later
// A UART of the user's as its driver needs it: it receives and sends by itself. Nothing here waits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../protocol/messages/device_command.hpp"

namespace r4 {
namespace firmware {

class UserUartPort {
 public:
  // How it works from now on; what had come in or was to be sent is gone. Off: the pins are let go.
  virtual void set_up(const UartMode& mode) = 0;
  // Bytes that have come in, at most `size`; returns how many.
  virtual std::size_t receive(std::uint8_t* out, std::size_t size) = 0;
  // How many came damaged or found no room since this was asked last.
  virtual std::uint32_t take_lost() = 0;
  // Will be sent, all or nothing. False: there is no room now.
  virtual bool send(const std::uint8_t* bytes, std::size_t size) = 0;
  // What waits is not sent any more; the byte on the wire ends.
  virtual void drop() = 0;

  static constexpr std::size_t send_capacity = 128;

 protected:
  ~UserUartPort() = default;
};

}  // namespace firmware
}  // namespace r4
