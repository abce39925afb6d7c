// SPDX-License-Identifier: GPL-3.0-or-later
// A UART for the user, as its driver needs it. No call waits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../protocol/messages/device_command.hpp"

namespace r4 {
namespace firmware {

class UserUartPort {
 public:
  // Drops received and queued bytes. Off: releases the pins.
  virtual void set_up(const UartMode& mode) = 0;
  virtual std::size_t receive(std::uint8_t* out, std::size_t size) = 0;
  // Bytes that were damaged or found no room since the last call.
  virtual std::uint32_t take_lost() = 0;
  // Sends all bytes or none. False if there is no room now.
  virtual bool send(const std::uint8_t* bytes, std::size_t size) = 0;
  // Drops queued bytes; the byte on the wire is completed.
  virtual void drop() = 0;

  static constexpr std::size_t send_capacity = 128;

 protected:
  ~UserUartPort() = default;
};

}  // namespace firmware
}  // namespace r4
