// SPDX-License-Identifier: GPL-3.0-or-later
#include "icm20948_model.hpp"

namespace r4 {
namespace sim {

namespace {

// Bank 0
constexpr int icm_who_am_i = 0x00;
constexpr int icm_user_ctrl = 0x03;
constexpr int icm_lp_config = 0x05;
constexpr int icm_pwr_mgmt_1 = 0x06;
constexpr int icm_pwr_mgmt_2 = 0x07;
constexpr int icm_int_pin_cfg = 0x0F;
constexpr int icm_int_enable_3 = 0x13;
constexpr int icm_int_status_1 = 0x1A;
constexpr int icm_accel_xout_h = 0x2D;
constexpr int icm_gyro_xout_h = 0x33;
constexpr int icm_temp_out_h = 0x39;
// Bank 2
constexpr int icm_gyro_config_1 = 0x01;
constexpr int icm_accel_config = 0x14;
constexpr int icm_last_of_bank_2 = 0x54;
// Every bank
constexpr int icm_reg_bank_sel = 0x7F;
constexpr std::uint8_t icm_asleep = 0x40;
constexpr std::uint8_t icm_reset = 0x80;

bool icm_is_writable(int bank, int at) {
  if (bank == 2) return at <= icm_last_of_bank_2;
  return bank == 0 && (at == icm_user_ctrl || at == icm_lp_config || at == icm_pwr_mgmt_1 ||
                       at == icm_pwr_mgmt_2 || (at >= icm_int_pin_cfg && at <= icm_int_enable_3));
}

}  // namespace

void Icm20948Model::power_on() {
  for (auto& bank : registers_) {
    for (std::uint8_t& each : bank) each = 0;
  }
  bank_ = 0;
  registers_[0][icm_who_am_i] = 0xEA;
  registers_[0][icm_lp_config] = 0x40;
  registers_[0][icm_pwr_mgmt_1] = icm_asleep | 1;
  registers_[2][icm_gyro_config_1] = 1;
  registers_[2][icm_accel_config] = 1;
}

void Icm20948Model::feel(const std::int32_t (&milli_g)[3], const std::int32_t (&deg_per_s)[3],
                         std::int32_t centi_c) {
  for (int i = 0; i < 3; ++i) {
    milli_g_[i] = milli_g[i];
    deg_per_s_[i] = deg_per_s[i];
  }
  centi_c_ = centi_c;
}

void Icm20948Model::put(int at, std::int32_t value) {
  const std::int32_t within = value > 0x7FFF ? 0x7FFF : value < -0x8000 ? -0x8000 : value;
  registers_[0][at] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(within) >> 8);
  registers_[0][at + 1] = static_cast<std::uint8_t>(within);
}

void Icm20948Model::latch() {
  if ((registers_[0][icm_pwr_mgmt_1] & icm_asleep) != 0) return;
  const int g_range = registers_[2][icm_accel_config] >> 1 & 3;
  const int rate_range = registers_[2][icm_gyro_config_1] >> 1 & 3;
  for (int i = 0; i < 3; ++i) {
    put(icm_accel_xout_h + 2 * i, milli_g_[i] * (16384 >> g_range) / 1000);
    put(icm_gyro_xout_h + 2 * i, deg_per_s_[i] * (131000 >> rate_range) / 1000);
  }
  put(icm_temp_out_h, (centi_c_ - 2100) * 33387 / 10000);
  registers_[0][icm_int_status_1] = 1;  // data ready
}

std::uint8_t Icm20948Model::read_register(std::uint8_t at) {
  if (at >= bank_size) return 0;
  if (at == icm_reg_bank_sel) return static_cast<std::uint8_t>(bank_ << 4);
  const std::uint8_t byte = registers_[bank_][at];
  if (bank_ == 0 && at == icm_int_status_1) registers_[0][at] = 0;
  return byte;
}

void Icm20948Model::write_register(std::uint8_t at, std::uint8_t byte) {
  if (at == icm_reg_bank_sel) {
    bank_ = byte >> 4 & 3;
  } else if (icm_is_writable(bank_, at)) {
    if (bank_ == 0 && at == icm_pwr_mgmt_1 && (byte & icm_reset) != 0) return power_on();
    registers_[bank_][at] = byte;
  }
}

}  // namespace sim
}  // namespace r4
