// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_hardware.hpp"

namespace r4 {
namespace firmware {

namespace {

constexpr std::uint8_t bit(std::uint8_t number, bool on) {
  return static_cast<std::uint8_t>(on ? 1U << number : 0U);
}

constexpr Chip pwm_chips[] = {Chip::osmc_pwm, Chip::dhb12_pwm, Chip::servo_pwm};

// First the brushless motors and the relays, which the all-call does not reach.
constexpr Chip safe_order[] = {Chip::dac, Chip::expander, Chip::osmc_pwm, Chip::dhb12_pwm,
                               Chip::servo_pwm};
static_assert(sizeof safe_order / sizeof *safe_order == chip_count, "every chip is made safe");

unsigned level(Place place, bool on) {
  return place.connected() && on != place.option() ? 1U << place.number() : 0U;
}

template <int count>
void set_bridges(Bridge (&bridges)[count], const Drive (&drives)[count]) {
  for (int i = 0; i < count; ++i) bridges[i].set(drives[i]);
}

}  // namespace

BoardHardware::BoardHardware(I2cBus& bus, const BoardPins& pins, const Config& config)
    : bus_(bus),
      pins_(pins),
      config_(config),
      osmc_(bus, config.wiring.chip(Chip::osmc_pwm).number(), drive_hz),
      dhb12_(bus, config.wiring.chip(Chip::dhb12_pwm).number(), drive_hz),
      servo_(bus, config.wiring.chip(Chip::servo_pwm).number(), servo_hz),
      expander_(bus, config.wiring.chip(Chip::expander).number(), connected_bits(),
                ports_of(Outputs())),
      dac_(bus, config.wiring.chip(Chip::dac).number()),
      chips_{&osmc_, &dhb12_, &servo_, &expander_, &dac_},
      steppers_{
          {*pins.step[0], *pins.direction[0], config.tick_hz, stepper_speed_max, low_is_forward(1)},
          {*pins.step[1], *pins.direction[1], config.tick_hz, stepper_speed_max, low_is_forward(2)},
          {*pins.step[2], *pins.direction[2], config.tick_hz, stepper_speed_max, low_is_forward(3)},
          {*pins.step[3], *pins.direction[3], config.tick_hz, stepper_speed_max,
           low_is_forward(4)}},
      ultrasonic_(*pins.trigger[0], *pins.trigger[1], *pins.trigger[2], *pins.trigger[3],
                  connected_sensors()) {
  fault_.trouble = config.wiring_trouble;
#define R4_DRIVE(kind) \
  connect_bridges(SignalKind::kind##_pwm, SignalKind::kind##_direction, kind##_bridges_);
  R4_DRIVES(R4_DRIVE)
#undef R4_DRIVE
}

void BoardHardware::connect_bridges(SignalKind pwm, SignalKind direction, Bridge* bridges) {
  for (int i = 0; i < row_of(pwm).channels; ++i) {
    const Place line = config_.wiring.at(pwm, i + 1);
    if (!line.connected()) continue;
    Pca9685& chip = line.number() < pca9685_lines ? osmc_ : dhb12_;
    bridges[i].connect(chip, line, config_.wiring.at(direction, i + 1));
  }
}

bool BoardHardware::low_is_forward(int stepper) const {
  return config_.wiring.at(SignalKind::step_direction, stepper).option();
}

std::uint8_t BoardHardware::connected_sensors() const {
  std::uint8_t sensors = 0;
  for (std::uint8_t i = 0; i < ultrasonic_channels; ++i) {
    sensors |= bit(i, config_.wiring.at(SignalKind::trigger, i + 1).connected());
  }
  return sensors;
}

void BoardHardware::power_up(std::uint32_t now_us) {
  now_us_ = now_us;
  verified_us_ = now_us;
  if (config_.wiring.has_pca9685()) {
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
  const int held_at = drive_chips_safe(nowhere);
  if (held_at != nowhere && bus_.recover()) drive_chips_safe(held_at);
}

// Returns the chip at which the bus was held, all_chips or nowhere. `held_before`: the last result.
int BoardHardware::drive_chips_safe(int held_before) {
  if (config_.wiring.has_pca9685() && held_before != all_chips &&
      Pca9685::all_off(bus_) == I2cResult::timeout) {
    for (int i = 0; i < chip_count; ++i) {
      if (fitted(i)) chips_[i]->note(I2cResult::timeout);
    }
    return all_chips;
  }
  // One acknowledge of the all-call hides chips that did not receive it, so address each chip, too.
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

std::uint16_t BoardHardware::connected_bits() const {
  std::uint16_t bits = 0;
  for (int i = 0; i < signal_count; ++i) {
    const Place place = config_.wiring.places[i];
    const bool is_bit = row_of(signal_kind(i)).terminal == Terminal::expander_bit;
    if (is_bit && place.connected()) bits = static_cast<std::uint16_t>(bits | 1U << place.number());
  }
  return bits;
}

std::uint16_t BoardHardware::ports_of(const Outputs& outputs) const {
  const Place* const places = config_.wiring.places;
  unsigned ports = 0;
  for (int i = 0; i < bldc_channels; ++i) {
    const Bldc& bldc = outputs.bldc[i];
    ports |= level(places[signals::bldc_direction + i], bldc.direction == Direction::forward);
    ports |= level(places[signals::bldc_brake + i], bldc.brake);
  }
  for (int i = 0; i < relay_channels; ++i) {
    ports |= level(places[signals::relay + i], (outputs.relays >> i & 1) != 0);
  }
  return static_cast<std::uint16_t>(ports);
}

void BoardHardware::set_outputs(const Outputs& outputs) {
#define R4_DRIVE(kind) set_bridges(kind##_bridges_, outputs.kind);
  R4_DRIVES(R4_DRIVE)
#undef R4_DRIVE
  const Place* const places = config_.wiring.places;
  for (int i = 0; i < servo_channels; ++i) {
    const Place line = places[signals::servo + i];
    if (line.connected()) servo_.set_pulse_us(line.number() % pca9685_lines, outputs.servo_us[i]);
  }
  for (int i = 0; i < bldc_channels; ++i) {
    const Place output = places[signals::bldc_speed + i];
    if (output.connected()) dac_.set_code(output.number(), outputs.bldc[i].speed);
  }
  expander_.set_ports(ports_of(outputs));
  for (int i = 0; i < stepper_channels; ++i) {
    const StepperTarget& target = outputs.stepper[i];
    steppers_[i].go(target.position, target.enabled ? target.speed : 0);
  }
  for (int i = 0; i < dac_channels; ++i) pins_.dac[i]->write(outputs.dac_mv[i]);
}

// Begins at the chip where the budget last ran out. Ends at a held bus: one timeout is enough.
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

bool BoardHardware::handle_reads_held() const {
  const Place handle = config_.wiring.at(SignalKind::handle);
  return !handle.connected() || pins_.handle->read() != handle.option();
}

void BoardHardware::poll(std::uint32_t now_us) {
  busy_ = true;
  now_us_ = now_us;

  const bool seen = handle_reads_held();
  if (!seen || !handle_seen_) held_since_us_ = now_us;
  handle_seen_ = seen;
  handle_held_ = seen && (handle_held_ || now_us - held_since_us_ >= handle_settle_us);
  ultrasonic_.poll(now_us);
  for (QuadratureEncoder& encoder : encoders_) encoder.measure(now_us);

  set_up_again();
  BusBudget budget(bus_bytes_per_poll);
  if (modes_to_check_ != 0) {
    // make_safe() may set modes_to_check_ between these two lines.
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

// A chip with changed modes may drive outputs that are off. Its reset also reaches other chips.
void BoardHardware::reset_lost_modes() {
  const bool lost = osmc_.lost_mode() || dhb12_.lost_mode() || servo_.lost_mode();
  if (!lost || Pca9685::reset_all(bus_) != I2cResult::ok) return;
  for (int i = 0; i < chip_count; ++i) {
    if (fitted(i) && i != static_cast<int>(Chip::expander)) chips_[i]->begin();
  }
}

// make_safe() may interrupt a transfer, or write registers that a driver is comparing. The driver
// then finds trouble without a fault of its chip, so the chip is set up again and no fault latched.
void BoardHardware::set_up_what_was_cut_off() {
  for (int i = 0; i < chip_count; ++i) {
    if (chips_[i]->trouble() != ChipTrouble::none && !failed_[i]) chips_[i]->begin();
  }
}

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
    if (!fault_.any() || fault_.address == 0) {
      fault_.address = chips_[i]->address();
      fault_.trouble = trouble;
    }
  }
  return found;
}

// Ends each function that uses the bus. New trouble makes all outputs safe. The last write may have
// undone an interrupting make_safe(), so outputs are made safe again.
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
  interrupted_ = false;  // a later make_safe() made all outputs safe itself
}

void BoardHardware::sample(Inputs& inputs) {
  for (int i = 0; i < analog_channels; ++i) {
    inputs.analog_cv[i] = centivolts_of(pins_.analog[i]->read(), config_.calibration[i]);
  }
  // A released handle counts at once, not at the next poll.
  if (!handle_reads_held()) handle_seen_ = handle_held_ = false;
  inputs.handle = !config_.wiring.at(SignalKind::handle).connected() ? Handle::none
                  : handle_held_                                     ? Handle::held
                                                                     : Handle::released;
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

ChipTrouble BoardHardware::trouble_of(WiringSource source) {
  switch (source) {
    case WiringSource::plan:
      return ChipTrouble::not_confirmed;
    case WiringSource::given:
      return ChipTrouble::none;
    case WiringSource::damaged:
      break;
  }
  return ChipTrouble::damaged;
}

bool BoardHardware::clear_fault() {
  const bool lasts = config_.wiring_trouble != ChipTrouble::none &&
                     config_.wiring_trouble != ChipTrouble::not_confirmed;
  if (!ready() || lasts) return false;
  const ChipFault before = fault_;
  fault_ = ChipFault();
  if (ready()) return true;
  fault_ = before;  // make_safe() in an interrupt has just found new trouble
  return false;
}

}  // namespace firmware
}  // namespace r4
