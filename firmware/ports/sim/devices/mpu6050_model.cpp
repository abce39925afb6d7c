// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpu6050_model.hpp"

namespace r4 {
namespace sim {

namespace {

constexpr int self_test_x = 0x0D;
constexpr int smplrt_div = 0x19;
constexpr int gyro_config = 0x1B;
constexpr int accel_config = 0x1C;
constexpr int accel_xout_h = 0x3B;
constexpr int temp_out_h = 0x41;
constexpr int gyro_xout_h = 0x43;
constexpr int gyro_zout_l = 0x48;
constexpr int int_status = 0x3A;
constexpr int user_ctrl = 0x6A;
constexpr int pwr_mgmt_1 = 0x6B;
constexpr int pwr_mgmt_2 = 0x6C;
constexpr int who_am_i = 0x75;
constexpr std::uint8_t asleep = 0x40;
constexpr std::uint8_t device_reset = 0x80;

bool is_writable(int at) {
  return (at >= self_test_x && at <= self_test_x + 3) || (at >= smplrt_div && at <= 0x34) ||
         at == 0x37 || at == 0x38 || (at >= 0x63 && at <= pwr_mgmt_2);
}

}  // namespace

void Mpu6050Model::power_on() {
  for (std::uint8_t& each : registers_) each = 0;
  registers_[pwr_mgmt_1] = asleep;
  registers_[who_am_i] = address;
}

void Mpu6050Model::feel(const std::int32_t (&milli_g)[3], const std::int32_t (&deg_per_s)[3],
                        std::int32_t centi_c) {
  for (int i = 0; i < 3; ++i) {
    milli_g_[i] = milli_g[i];
    deg_per_s_[i] = deg_per_s[i];
  }
  centi_c_ = centi_c;
}

void Mpu6050Model::put(int at, std::int32_t value) {
  const std::int32_t within = value > 0x7FFF ? 0x7FFF : value < -0x8000 ? -0x8000 : value;
  registers_[at] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(within) >> 8);
  registers_[at + 1] = static_cast<std::uint8_t>(within);
}

void Mpu6050Model::latch() {
  if ((registers_[pwr_mgmt_1] & asleep) != 0) return;
  const int g_range = registers_[accel_config] >> 3 & 3;
  const int rate_range = registers_[gyro_config] >> 3 & 3;
  for (int i = 0; i < 3; ++i) {
    put(accel_xout_h + 2 * i, milli_g_[i] * (16384 >> g_range) / 1000);
    put(gyro_xout_h + 2 * i, deg_per_s_[i] * (131000 >> rate_range) / 1000);
  }
  put(temp_out_h, (centi_c_ - 3653) * 340 / 100);
  registers_[int_status] |= 1;  // data ready
}

std::uint8_t Mpu6050Model::read_register(std::uint8_t at) {
  if (at >= register_count) return 0;
  const std::uint8_t byte = registers_[at];
  if (at == int_status) registers_[at] = 0;
  return byte;
}

void Mpu6050Model::write_register(std::uint8_t at, std::uint8_t byte) {
  if (!is_writable(at)) return;
  if (at == pwr_mgmt_1 && (byte & device_reset) != 0) return power_on();
  registers_[at] = byte;
  if (at == user_ctrl) registers_[at] &= 0x70;  // the resets clear themselves
  static_assert(gyro_zout_l < register_count && user_ctrl < register_count, "they are there");
}

}  // namespace sim
}  // namespace r4
