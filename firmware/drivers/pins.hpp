// SPDX-License-Identifier: GPL-3.0-or-later
// The microcontroller's pins and converters. No call waits. Interrupts may make all calls.
#pragma once

#include <cstdint>

namespace r4 {
namespace firmware {

class OutputPin {
 public:
  virtual void write(bool high) = 0;

 protected:
  ~OutputPin() = default;
};

class InputPin {
 public:
  virtual bool read() = 0;

 protected:
  ~InputPin() = default;
};

// The newest conversion, 0-65535 for 0 V to the reference (paper section 8.5).
class AnalogPin {
 public:
  virtual std::uint16_t read() = 0;

 protected:
  ~AnalogPin() = default;
};

// 0 to dac_max_mv.
class AnalogOutputPin {
 public:
  virtual void write(std::uint16_t millivolts) = 0;

 protected:
  ~AnalogOutputPin() = default;
};

}  // namespace firmware
}  // namespace r4
