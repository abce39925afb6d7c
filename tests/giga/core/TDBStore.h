// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <BlockDevice.h>

namespace mbed {

class TDBStore {
 public:
  TDBStore(BlockDevice* device);  // NOLINT
  virtual ~TDBStore();
  virtual int init();
  virtual int set(const char* key, const void* buffer, std::size_t size,
                  std::uint32_t create_flags);
  virtual int get(const char* key, void* buffer, std::size_t buffer_size,
                  std::size_t* actual_size = nullptr, std::size_t offset = 0);

 private:
  BlockDevice* device_;
};

}  // namespace mbed
