// SPDX-License-Identifier: GPL-3.0-or-later
// Device descriptions: any text is refused with a reason, or it is a description that the board can
// execute and that decodes any bytes to numbers.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "input.hpp"
#include "r4link/devices/description.hpp"
#include "r4link/error.hpp"
#include "r4link/vocabulary.hpp"

namespace r4 {
namespace {

void look_at(const DeviceDescription& device) {
  require(!device.name.empty() && !device.addresses.empty() && !device.values.empty());
  for (const int address : device.addresses) {
    require(address >= i2c_first_address && address <= i2c_last_address);
  }
  require(!device.polls.empty() && device.polls.size() <= i2c_slots);
  for (const DevicePoll& poll : device.polls) {
    require(poll.count >= 1 && poll.count <= i2c_max_bytes);
    require(poll.register_bytes.size() <= i2c_max_register_bytes);
    require(poll.period.count() >= i2c_min_period_ms && poll.period.count() <= i2c_max_period_ms);
  }
  for (const DeviceWrite& write : device.writes) {
    require(!write.bytes.empty() && write.bytes.size() <= i2c_max_bytes);
  }
  std::uint8_t bytes[i2c_max_bytes];
  for (const DeviceValue& value : device.values) {
    require(value.poll < device.polls.size());
    const auto count = static_cast<std::size_t>(device.polls[value.poll].count);
    for (std::size_t i = 0; i < i2c_max_bytes; ++i) bytes[i] = static_cast<std::uint8_t>(i * 37);
    const auto number = value.decode(bytes, count);
    if (number) {
      require(std::isfinite(*number) && *number >= value.minimum && *number <= value.maximum);
    }
    require(!value.decode(bytes, static_cast<std::size_t>(value.at)));
  }
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    r4::look_at(r4::DeviceDescription::parse(text));
  } catch (const r4::Error& error) {
    const r4::Problem& problem = error.problem();
    r4::require(problem.kind == r4::ErrorKind::data && !problem.reason.empty() &&
                !problem.fix.empty());
  }
  return 0;
}
