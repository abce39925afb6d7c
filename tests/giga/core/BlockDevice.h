// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Arduino.h>

namespace mbed {

enum bd_error { BD_ERROR_OK = 0, BD_ERROR_DEVICE_ERROR = -4001 };
using bd_size_t = std::uint64_t;

class BlockDevice {
 public:
  static BlockDevice* get_default_instance();
  virtual ~BlockDevice();
  virtual int init() = 0;
  virtual bd_size_t size() const = 0;
};

}  // namespace mbed
