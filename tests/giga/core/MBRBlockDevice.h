// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <BlockDevice.h>

namespace mbed {

class MBRBlockDevice : public BlockDevice {
 public:
  MBRBlockDevice(BlockDevice* device, int part);
  ~MBRBlockDevice() override;
  int init() override;
  bd_size_t size() const override;

 private:
  BlockDevice* device_;
  int part_;
};

}  // namespace mbed
