// SPDX-License-Identifier: GPL-3.0-or-later
// A register with behaviour: functions decide what a read returns and what a write does.
#pragma once

#include <cstdint>
#include <functional>

namespace r4::fake {

class Register {
 public:
  operator std::uint32_t() const {  // NOLINT(google-explicit-constructor): as a word
    return on_read ? on_read() : value;
  }
  Register& operator=(std::uint32_t written) {
    if (on_write) {
      on_write(written);
    } else {
      value = written;
    }
    return *this;
  }
  Register& operator=(const Register& other) { return *this = static_cast<std::uint32_t>(other); }
  Register() = default;
  Register(const Register&) = delete;
  ~Register() = default;
  Register& operator|=(std::uint32_t bits) { return *this = *this | bits; }
  Register& operator&=(std::uint32_t bits) { return *this = *this & bits; }

  // The state after a reset, without behaviour.
  void clear() {
    value = 0;
    on_read = nullptr;
    on_write = nullptr;
  }

  std::uint32_t value = 0;
  std::function<std::uint32_t()> on_read;
  std::function<void(std::uint32_t)> on_write;
};

}  // namespace r4::fake
