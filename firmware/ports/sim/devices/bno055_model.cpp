// SPDX-License-Identifier: GPL-3.0-or-later
#include "bno055_model.hpp"

namespace r4 {
namespace sim {

namespace {

constexpr int bno_chip_id = 0x00;
constexpr int bno_page_id = 0x07;
constexpr int bno_acc_data = 0x08;
constexpr int bno_mag_data = 0x0E;
constexpr int bno_gyr_data = 0x14;
constexpr int bno_eul_data = 0x1A;
constexpr int bno_qua_data = 0x20;
constexpr int bno_temp = 0x34;
constexpr int bno_calib_stat = 0x35;
constexpr int bno_sys_status = 0x39;
constexpr int bno_unit_sel = 0x3B;
constexpr int bno_opr_mode = 0x3D;
constexpr int bno_pwr_mode = 0x3E;
constexpr int bno_sys_trigger = 0x3F;
constexpr int bno_last_setting = 0x6A;
constexpr std::uint8_t bno_mode_bits = 0x0F;
constexpr std::uint8_t bno_reset = 0x20;
constexpr std::uint64_t bno_ms = 1000000;
constexpr std::uint64_t bno_leaves_config_ns = 7 * bno_ms;  // table 3-6
constexpr std::uint8_t bno_running_fusion = 5;

constexpr std::uint8_t bno_identity[] = {0xA0, 0xFB, 0x32, 0x0F, 0x11, 0x03, 0x15};

}  // namespace

void Bno055Model::power_on() {
  for (std::uint8_t& each : registers_) each = 0;
  int at = bno_chip_id;
  for (const std::uint8_t each : bno_identity) registers_[at++] = each;
  registers_[bno_unit_sel] = 0x80;
  page_ = 0;
  runs_from_ns_ = 0;
}

bool Bno055Model::configures() const { return (registers_[bno_opr_mode] & bno_mode_bits) == 0; }

void Bno055Model::put(int at, std::int32_t value) {
  const std::int32_t within = value > 0x7FFF ? 0x7FFF : value < -0x8000 ? -0x8000 : value;
  registers_[at] = static_cast<std::uint8_t>(within);
  registers_[at + 1] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(within) >> 8);
}

void Bno055Model::latch() {
  if (configures() || now_ns() < runs_from_ns_) return;
  const unsigned units = registers_[bno_unit_sel];
  const bool in_mg = (units & 1U) != 0;
  const bool in_rad_per_s = (units & 2U) != 0;
  const bool in_rad = (units & 4U) != 0;
  const bool in_fahrenheit = (units & 16U) != 0;
  for (int i = 0; i < 3; ++i) {
    const std::int32_t acceleration = motion_.mm_per_s2[i];
    put(bno_acc_data + 2 * i, in_mg ? acceleration * 1000 / 9807 : acceleration / 10);
    put(bno_mag_data + 2 * i, motion_.nanotesla[i] * 16 / 1000);
    // 900 per radian, or 16 per degree
    put(bno_gyr_data + 2 * i,
        in_rad_per_s ? motion_.mrad_per_s[i] * 9 / 10 : motion_.mrad_per_s[i] * 9167 / 10000);
    put(bno_eul_data + 2 * i,
        in_rad ? motion_.centidegrees[i] * 157 / 1000 : motion_.centidegrees[i] * 4 / 25);
  }
  for (int i = 0; i < 4; ++i) put(bno_qua_data + 2 * i, motion_.quaternion[i]);
  const std::int32_t degrees = motion_.degrees_c;
  registers_[bno_temp] =
      static_cast<std::uint8_t>(in_fahrenheit ? (degrees * 9 / 5 + 32) / 2 : degrees);
  registers_[bno_calib_stat] = 0xFF;
  registers_[bno_sys_status] = bno_running_fusion;
}

std::uint8_t Bno055Model::read_register(std::uint8_t at) {
  if (at == bno_page_id) return page_;
  return page_ == 0 && at < page_size ? registers_[at] : 0;
}

void Bno055Model::write_register(std::uint8_t at, std::uint8_t byte) {
  if (at == bno_page_id) {
    page_ = byte & 1;
  } else if (page_ != 0) {
    return;
  } else if (at == bno_opr_mode) {
    const bool configured = configures();
    registers_[at] = byte & bno_mode_bits;
    if (configured) runs_from_ns_ = now_ns() + bno_leaves_config_ns;
    if (configures()) {  // 3.3.1: the outputs are 0
      for (int each = bno_acc_data; each <= bno_calib_stat; ++each) registers_[each] = 0;
    }
  } else if (at == bno_sys_trigger && (byte & bno_reset) != 0) {
    power_on();
  } else if (configures() &&
             (at == bno_unit_sel || (at >= bno_pwr_mode && at <= bno_last_setting))) {
    registers_[at] = byte;
  }
}

}  // namespace sim
}  // namespace r4
