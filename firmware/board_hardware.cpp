// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_hardware.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr std::uint8_t bit(std::uint8_t number, bool on) {
  return static_cast<std::uint8_t>(on ? 1U << number : 0U);
}

constexpr Chip pwm_chips[] = {Chip::osmc_pwm, Chip::dhb12_pwm, Chip::servo_pwm};
constexpr std::uint8_t pca9685_chips = 1U << static_cast<int>(Chip::osmc_pwm) |
                                       1U << static_cast<int>(Chip::dhb12_pwm) |
                                       1U << static_cast<int>(Chip::servo_pwm);

// First the brushless motors and the relays, which the all-call does not reach.
constexpr Chip safe_order[chip_count] = {Chip::dac, Chip::expander, Chip::osmc_pwm, Chip::dhb12_pwm,
                                         Chip::servo_pwm};

}  // namespace

std::uint8_t address_of(Chip chip) {
  constexpr std::uint8_t addresses[chip_count] = {osmc_pwm_address, dhb12_pwm_address,
                                                  expander_address, dac_address, servo_pwm_address};
  return addresses[static_cast<int>(chip)];
}

BoardHardware::BoardHardware(I2cBus& bus, const BoardPins& pins, const Config& config)
    : bus_(bus),
      pins_(pins),
      config_(config),
      osmc_(bus, osmc_pwm_address, drive_hz, drive_lines),
      dhb12_(bus, dhb12_pwm_address, drive_hz, drive_lines),
      expander_(bus, expander_address, brakes_on, 0),
      dac_(bus, dac_address),
      servo_(bus, servo_pwm_address, servo_hz),
      chips_{&osmc_, &dhb12_, &expander_, &dac_, &servo_},
      steppers_{{*pins.step[0], *pins.direction[0], config.step_tick_hz, stepper_speed_max},
                {*pins.step[1], *pins.direction[1], config.step_tick_hz, stepper_speed_max},
                {*pins.step[2], *pins.direction[2], config.step_tick_hz, stepper_speed_max},
                {*pins.step[3], *pins.direction[3], config.step_tick_hz, stepper_speed_max}},
      ultrasonic_(*pins.trigger[0], *pins.trigger[1], *pins.trigger[2], *pins.trigger[3],
                  config.ultrasonic_fitted) {}

void BoardHardware::power_up(std::uint32_t now_us) {
  now_us_ = now_us;
  verified_us_ = now_us;
  if ((config_.chips_fitted & pca9685_chips) != 0) {
    busy_ = true;
    (void)Pca9685::reset_all(bus_);  // the set-up checks the modes
    busy_ = false;
  }
  make_safe();
  for (int i = 0; i < chip_count; ++i) {
    if (fitted(i) && !failed_[i]) chips_[i]->begin();
  }
}

void BoardHardware::make_safe() {
  const bool nested = busy_;
  if (nested) {
    interrupted_ = true;
    bus_.recover();
  }
  busy_ = true;
  drive_safe();
  if (nested) return;  // the interrupted call looks for trouble
  if (!interrupted_) look_for_trouble();
  leave();
}

void BoardHardware::drive_safe() {
  waiting_ = false;
  modes_to_check_ = sizeof pwm_chips / sizeof *pwm_chips;
  for (Stepper& stepper : steppers_) stepper.stop();
  for (AnalogOutputPin* pin : pins_.dac) pin->write(0);
  // Drivers forget pending writes, even if a held bus keeps their chips from being written now.
  for (ChipDriver* chip : chips_) chip->want_safe();
  // If a held bus can be freed, the chip that held it comes last.
  const int held_at = drive_chips_safe(nowhere);
  if (held_at != nowhere && bus_.recover()) drive_chips_safe(held_at);
}

// Returns the chip at which the bus was held, all_chips for the all-call, or nowhere.
// `held_before`: the result of the try before.
int BoardHardware::drive_chips_safe(int held_before) {
  if ((config_.chips_fitted & pca9685_chips) != 0 && held_before != all_chips &&
      Pca9685::all_off(bus_) == I2cResult::timeout) {
    for (int i = 0; i < chip_count; ++i) {
      if (fitted(i)) chips_[i]->note(I2cResult::timeout);
    }
    return all_chips;
  }
  // One acknowledge of the all-call hides chips that did not hear it: each is addressed, too.
  for (const Chip chip : safe_order) {
    const int i = static_cast<int>(chip);
    if (i != held_before && !drive_chip_safe(i)) return i;
  }
  const bool one_left = held_before != nowhere && held_before != all_chips;
  return one_left && !drive_chip_safe(held_before) ? held_before : nowhere;
}

// False if the bus is held.
bool BoardHardware::drive_chip_safe(int chip) {
  if (!fitted(chip)) return true;
  const I2cResult result = chips_[chip]->make_safe();
  chips_[chip]->note(result);
  return result != I2cResult::timeout;
}

void BoardHardware::apply(const Outputs& outputs) {
  if (fault_.any()) return;
  busy_ = true;
  waiting_ = !ready();
  if (waiting_) {
    waiting_outputs_ = outputs;
    leave();
    return;
  }
  set_outputs(outputs);
  BusBudget budget(bus_bytes_per_poll);
  if (!interrupted_) for_each_chip(budget, false);
  leave();
}

template <Chip chip, int count>
void BoardHardware::set_drives(const DriveLines<chip> (&lines)[count],
                               const Drive (&drives)[count]) {
  static_assert((pca9685_chips >> static_cast<int>(chip) & 1) != 0, "the lines are of a PCA9685");
  Pca9685& pwm = static_cast<Pca9685&>(*chips_[static_cast<int>(chip)]);
  for (int i = 0; i < count; ++i) {
    pwm.set_duty(lines[i].pwm, drives[i].pwm);
    pwm.set_level(lines[i].direction, drives[i].direction == Direction::forward);
  }
}

void BoardHardware::set_outputs(const Outputs& outputs) {
#define R4_DRIVE(kind) set_drives(kind##_lines, outputs.kind);
  R4_DRIVES(R4_DRIVE)
  for (int i = 0; i < servo_channels; ++i) {
    servo_.set_pulse_us(servo_lines[i], outputs.servo_us[i]);
  }
  std::uint8_t port_a = 0;
  for (int i = 0; i < bldc_channels; ++i) {
    const Bldc& bldc = outputs.bldc[i];
    port_a |= bit(bldc_lines[i].direction, bldc.direction == Direction::forward);
    port_a |= bit(bldc_lines[i].brake, bldc.brake);
    dac_.set_code(bldc_lines[i].speed, bldc.speed);
  }
  std::uint8_t port_b = 0;
  for (int i = 0; i < relay_channels; ++i) port_b |= bit(relay_bits[i], outputs.relays >> i & 1);
  expander_.set_ports(port_a, port_b);
  for (int i = 0; i < stepper_channels; ++i) {
    const StepperTarget& target = outputs.stepper[i];
    steppers_[i].go(target.position, target.enabled ? target.speed : 0);
  }
  for (int i = 0; i < dac_channels; ++i) pins_.dac[i]->write(outputs.dac_mv[i]);
}

// Begins where the budget ran out last time. Ends at a held bus: one timeout is enough.
void BoardHardware::for_each_chip(BusBudget& budget, bool set_up) {
  for (int n = 0; n < chip_count; ++n) {
    const int i = (first_chip_ + n) % chip_count;
    if (!fitted(i) || chips_[i]->trouble() != ChipTrouble::none) continue;
    if (set_up) {
      chips_[i]->poll(now_us_, budget);
    } else {
      chips_[i]->write_changes(budget);
    }
    if (chips_[i]->trouble() == ChipTrouble::bus_stuck) return;
    if (budget.exhausted()) {
      first_chip_ = i;
      return;
    }
  }
  first_chip_ = 0;
}

void BoardHardware::poll(std::uint32_t now_us) {
  busy_ = true;
  now_us_ = now_us;

  const bool seen = pins_.handle->read() == handle_held_level;
  if (!seen || !handle_seen_) held_since_us_ = now_us;
  handle_seen_ = seen;
  handle_held_ = seen && (handle_held_ || now_us - held_since_us_ >= handle_settle_us);
  ultrasonic_.poll(now_us);
  for (QuadratureEncoder& encoder : encoders_) encoder.measure(now_us);

  set_up_again();
  BusBudget budget(bus_bytes_per_poll);
  if (modes_to_check_ != 0) {
    // make_safe() may set it between these two lines.
    const int at = modes_to_check_ - 1;
    modes_to_check_ = static_cast<std::uint8_t>(at);
    const int chip = static_cast<int>(pwm_chips[at]);
    if (fitted(chip)) chips_[chip]->verify(budget);
  } else if (now_us - verified_us_ >= verify_us) {
    verified_us_ = now_us;
    if (fitted(verified_chip_)) chips_[verified_chip_]->verify(budget);
    verified_chip_ = (verified_chip_ + 1) % chip_count;
  }
  for_each_chip(budget, true);
  if (waiting_ && ready()) {
    waiting_ = false;
    set_outputs(waiting_outputs_);
  }
  leave();
}

void BoardHardware::set_up_again() {
  bool tried = false;
  bool free = false;
  for (int i = 0; i < chip_count; ++i) {
    if (chips_[i]->trouble() == ChipTrouble::none || now_us_ - failed_us_[i] < retry_us) continue;
    failed_us_[i] = now_us_;
    free = tried ? free : bus_.recover();
    tried = true;
    if (!free) continue;
    reset_lost_modes();
    chips_[i]->begin();
  }
}

// A chip with changed modes may drive although commanded off. Its reset reaches other chips, too.
void BoardHardware::reset_lost_modes() {
  const bool lost = osmc_.lost_mode() || dhb12_.lost_mode() || servo_.lost_mode();
  if (!lost || Pca9685::reset_all(bus_) != I2cResult::ok) return;
  for (int i = 0; i < chip_count; ++i) {
    if (fitted(i) && i != static_cast<int>(Chip::expander)) chips_[i]->begin();
  }
}

// make_safe() may interrupt a transfer, or write registers that a driver is comparing. Trouble that
// the driver then finds says nothing about its chip, so the chip is set up again without a fault.
void BoardHardware::set_up_what_was_cut_off() {
  for (int i = 0; i < chip_count; ++i) {
    if (chips_[i]->trouble() != ChipTrouble::none && !failed_[i]) chips_[i]->begin();
  }
}

// True if there is new trouble, which is then latched.
bool BoardHardware::look_for_trouble() {
  bool found = false;
  for (int i = 0; i < chip_count; ++i) {
    const ChipTrouble trouble = chips_[i]->trouble();
    if (trouble == ChipTrouble::none) {
      if (chips_[i]->ready()) failed_[i] = false;
      continue;
    }
    if (failed_[i]) continue;
    failed_[i] = true;
    failed_us_[i] = now_us_;
    found = true;
    if (!fault_.any()) {
      fault_.address = address_of(static_cast<Chip>(i));
      fault_.trouble = trouble;
    }
  }
  return found;
}

// Each function that uses the bus ends with this. New trouble makes everything safe. An
// interrupting make_safe() may have been undone by the function's last write, so it is repeated.
void BoardHardware::leave() {
  if (!interrupted_ && look_for_trouble()) {
    reset_lost_modes();
    drive_safe();
    if (!interrupted_) look_for_trouble();
  }
  while (interrupted_) {
    interrupted_ = false;
    set_up_what_was_cut_off();
    drive_safe();
    if (!interrupted_) look_for_trouble();
  }
  busy_ = false;
  interrupted_ = false;  // a later make_safe() drove everything safe itself
}

void BoardHardware::sample(Inputs& inputs) {
  for (int i = 0; i < analog_channels; ++i) {
    inputs.analog_cv[i] = centivolts_of(pins_.analog[i]->read(), config_.calibration[i]);
  }
  // A released handle counts at once, not at the next poll.
  if (pins_.handle->read() != handle_held_level) handle_seen_ = handle_held_ = false;
  inputs.handle_held = handle_held_;
  for (int i = 0; i < stepper_channels; ++i) inputs.stepper_steps[i] = steppers_[i].position();
  for (int i = 0; i < encoder_channels; ++i) {
    inputs.encoder_counts[i] = encoders_[i].count();
    inputs.encoder_hz[i] = encoders_[i].frequency_hz();
    inputs.encoder_index_counts[i] = encoders_[i].index_count();
  }
  inputs.ultrasonic_blind = 0;
  for (int i = 0; i < ultrasonic_channels; ++i) {
    inputs.ultrasonic_cm[i] = ultrasonic_.distance_cm(i);
    inputs.ultrasonic_blind |= bit(static_cast<std::uint8_t>(i), !ultrasonic_.sees(i));
  }
  inputs.gpio = 0;
  for (int i = 0; i < gpio_channels; ++i) {
    inputs.gpio |= bit(static_cast<std::uint8_t>(i), pins_.gpio[i]->read());
  }
  inputs.fault = fault_;
}

void BoardHardware::zero(int channel) {
  encoders_[channel - 1].zero();
  steppers_[channel - 1].zero();
}

bool BoardHardware::stepping() const {
  for (const Stepper& stepper : steppers_) {
    if (stepper.moving()) return true;
  }
  return false;
}

void BoardHardware::fit(std::uint8_t chips) {
  config_.chips_fitted = chips;
  fault_ = ChipFault();
  for (int i = 0; i < chip_count; ++i) {
    failed_[i] = false;
    if (!fitted(i)) chips_[i]->begin();  // clears its trouble
  }
}

void BoardHardware::calibrate(const std::uint16_t (&full_scale_cv)[analog_channels]) {
  constexpr std::uint16_t full_scale = 0xFFFF;
  for (int i = 0; i < analog_channels; ++i) {
    config_.calibration[i].set(0, 0, full_scale, full_scale_cv[i]);
  }
}

bool BoardHardware::ready() const {
  for (int i = 0; i < chip_count; ++i) {
    if (fitted(i) && !chips_[i]->ready()) return false;
  }
  return true;
}

bool BoardHardware::clear_fault() {
  if (!ready()) return false;
  const ChipFault before = fault_;
  fault_ = ChipFault();
  if (ready()) return true;
  fault_ = before;  // make_safe() in an interrupt has just found new trouble
  return false;
}

}  // namespace firmware
}  // namespace r4
