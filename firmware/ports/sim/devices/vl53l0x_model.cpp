// SPDX-License-Identifier: GPL-3.0-or-later
#include "vl53l0x_model.hpp"

namespace r4 {
namespace sim {

namespace {

constexpr int vl_sysrange_start = 0x00;
constexpr int vl_range_status = 0x14;
constexpr int vl_i2c_mode = 0x88;
constexpr int vl_model_id = 0xC0;
constexpr std::uint8_t vl_identity[] = {0xEE, 0xAA, 0x10};
constexpr std::uint8_t vl_single = 1;
constexpr std::uint8_t vl_back_to_back = 2;
constexpr std::uint64_t vl_range_ns = 33000000;  // the default timing budget
// Offsets in the result, after the status
constexpr int vl_spads = 2;         // 256ths
constexpr int vl_signal_rate = 6;   // 128ths of a million counts a second
constexpr int vl_ambient_rate = 8;  // 128ths of a million counts a second
constexpr int vl_range_mm = 10;
constexpr int vl_range_valid = 11;
constexpr int vl_no_target = 4;

}  // namespace

void Vl53l0xModel::power_on() {
  start_ = 0;
  i2c_mode_ = 0;
  for (std::uint8_t& each : result_) each = 0;
}

void Vl53l0xModel::put(int at, std::int32_t value) {
  result_[at] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(value) >> 8);
  result_[at + 1] = static_cast<std::uint8_t>(value);
}

void Vl53l0xModel::latch() {
  if (start_ == 0 || now_ns() - ranged_ns_ < vl_range_ns) return;
  ranged_ns_ += (now_ns() - ranged_ns_) / vl_range_ns * vl_range_ns;
  if (start_ == vl_single) start_ = 0;  // the register clears itself
  const bool seen = mm_ < no_target;
  result_[0] = static_cast<std::uint8_t>((seen ? vl_range_valid : vl_no_target) << 3);
  put(vl_spads, 20 * 256);
  put(vl_signal_rate, seen ? 10 * 128 : 0);
  put(vl_ambient_rate, 64);
  put(vl_range_mm, mm_);
}

std::uint8_t Vl53l0xModel::read_register(std::uint8_t at) {
  if (at == vl_sysrange_start) return start_;
  if (at == vl_i2c_mode) return i2c_mode_;
  if (at >= vl_model_id && at < vl_model_id + 3) return vl_identity[at - vl_model_id];
  if (at >= vl_range_status && at < vl_range_status + result_size) {
    return result_[at - vl_range_status];
  }
  return 0;
}

void Vl53l0xModel::write_register(std::uint8_t at, std::uint8_t byte) {
  if (at == vl_i2c_mode) i2c_mode_ = byte;
  if (at != vl_sysrange_start) return;
  start_ = byte & (vl_single | vl_back_to_back);
  ranged_ns_ = now_ns();
}

}  // namespace sim
}  // namespace r4
