// SPDX-License-Identifier: GPL-3.0-or-later
#include "state_units.hpp"

namespace r4::tool {
namespace {

constexpr StateUnits one(std::string_view unit) { return {{unit, {}, {}}, 1}; }

}  // namespace

StateUnits units_of(StateField field) {
  using F = StateField;
  const auto within = [field](F first, F last) { return field >= first && field <= last; };
  if (field == F::dmhsta) return one("[0/1]");
  if (within(F::ain24, F::ainsteer) || field == F::ain6) return one("[V]");
  if (within(F::dhb1a, F::osmc1) || within(F::dhb1b, F::osmc4)) {
    return {{"pwm [0-4095]", "direction [0/1]", {}}, 2};
  }
  if (field == F::step1pos || within(F::step2pos, F::step4pos)) return one("[steps]");
  if (field == F::servo1pos || within(F::servo2pos, F::servo16pos)) return one("[us]");
  if (within(F::enc1, F::enc4) || within(F::enc1idx, F::enc4idx)) return one("[counts]");
  if (within(F::us1, F::us4)) return one("[cm]");
  if (within(F::bldc1, F::bldc4)) {
    return {{"speed [0-4095]", "direction [0/1]", "brake [0/1]"}, 3};
  }
  if (field == F::relays) return one("[bits]");
  if (field == F::safe) return one("[reason]");
  if (field == F::cmd) return one("[PNum]");
  if (within(F::rxok, F::rxdup)) return one("[datagrams]");
  if (field == F::rxref) return one("[commands]");
  if (field == F::late) return one("[periods]");
  if (within(F::enc1hz, F::enc4hz)) return one("[counts/s]");
  if (within(F::i2c1, F::i2c8)) return {{"t [ms]", "errors [transfers]", bytes_unit}, 3};
  if (field == F::i2cx) return {{"command [PNum]", "outcome [0-3]", bytes_unit}, 3};
  if (field == F::i2cbus) {
    return {{"outcome [0-3]", "errors [transfers]", "recoveries [times]"}, 3};
  }
  if (within(F::uart1, F::uart2)) return {{"position [bytes]", "lost [bytes]", bytes_unit}, 3};
  if (within(F::dac1, F::dac2)) return one("[mV]");
  if (field == F::gpio) return one("[bits]");
  if (field == F::fault) return {{"chip [address]", "trouble [bits]", {}}, 2};
  return one("");
}

}  // namespace r4::tool
