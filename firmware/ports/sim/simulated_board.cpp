// SPDX-License-Identifier: GPL-3.0-or-later
#include "simulated_board.hpp"

#include <algorithm>
#include <limits>
#include <random>
#include <system_error>
#include <utility>

#include "robot/random.hpp"

namespace r4::sim {

namespace {

std::uint64_t random_seed() {
  std::random_device device;
  return std::uint64_t{device()} << 32 | device();
}

}  // namespace

SimulatedBoard::SimulatedBoard(asio::io_context& io, Options options)
    : options_(std::move(options)),
      seed_(options_.seed ? *options_.seed : random_seed()),
      model_(seed_, options_.wired),
      timer_(io) {}

SimulatedBoard::~SimulatedBoard() { stop(); }

void SimulatedBoard::add_carrier(std::unique_ptr<Carrier> carrier) {
  if (ports_.size() == firmware::Application::max_ports) {
    throw Error(
        ErrorKind::usage, carrier->name(),
        "a board has at most " + std::to_string(firmware::Application::max_ports) + " transports",
        "leave one out");
  }
  CarrierPort::Owner& owner = *this;
  ports_.push_back(std::make_unique<CarrierPort>(std::move(carrier), owner));
}

void SimulatedBoard::start() {
  stop();
  alive_ = std::make_shared<const bool>(true);
  // A whole millisecond of the clock, so that all boards of an io_context wake up together.
  start_ = std::chrono::floor<Milliseconds>(Clock::now());
  clock_start_ms_ = options_.clock_ms ? options_.clock_ms() : 0;
  passed_ = hangs_until_ = watchdog_fed_ = Milliseconds(0);
  next_step_ = 0;
  model_.power_on();
  reset_microcontroller();
  try {
    for (const auto& port : ports_) port->open();
  } catch (...) {
    stop();
    throw;
  }
  boot();
  poll();
}

void SimulatedBoard::stop() noexcept {
  alive_.reset();
  timer_.cancel();
  armed_ = false;
  for (const auto& port : ports_) port->close();
  application_.reset();
  if (hardware_) hardware_->hal().make_safe();
  hardware_.reset();
}

SimulatedBoard::Milliseconds SimulatedBoard::elapsed() const {
  if (options_.clock_ms) return Milliseconds(options_.clock_ms() - clock_start_ms_);
  return std::chrono::floor<Milliseconds>(Clock::now() - start_);
}

void SimulatedBoard::reset_microcontroller() {
  clock_offset_ms_ = static_cast<std::uint32_t>(scramble(seed_ + boots_));
  ++boots_;
  downs_ = 0;
  hangs_until_ = watchdog_fed_ = passed_;
  told_pins_.reset();
  told_fault_ = false;
  const SiteSettings& site = options_.settings.site;
  const bool confirmed = options_.plan_confirmed && site.wiring_source == WiringSource::plan;
  hardware_.emplace(
      model_, site.wiring,
      confirmed ? ChipTrouble::none : firmware::BoardHardware::trouble_of(site.wiring_source));
  hardware_->power_up();
  hardware_->hal().calibrate(options_.settings.site.full_scale_cv);

  firmware::Application::Config config;
  config.identity.firmware = Text(options_.firmware_version);
  config.identity.board_id = Text(options_.board_id);
  config.identity.capabilities = Text(options_.capabilities);
  config.settings = options_.settings;
  const auto random_bytes = chance();
  config.chance = random_bytes.data();
  hardware_->add_devices(config);
  Observer& observer = *this;
  application_.emplace(hardware_->hal(), config, &observer);
  for (const auto& port : ports_) port->number = application_->add_port(*port);
}

std::array<std::uint8_t, Authentication::chance_size> SimulatedBoard::chance() const {
  std::array<std::uint8_t, Authentication::chance_size> bytes;
  std::random_device device;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::uint64_t number =
        options_.seed ? scramble(scramble(*options_.seed + boots_) + i) : device();
    bytes[i] = static_cast<std::uint8_t>(number);
  }
  return bytes;
}

void SimulatedBoard::boot(SafeReason cause) {
  in_application_ = true;
  application_->start(board_ms(passed_));
  if (cause != SafeReason::none) application_->fail(cause, board_ms(passed_));
  in_application_ = false;
}

std::uint32_t SimulatedBoard::poll() { return poll(elapsed()); }

std::uint32_t SimulatedBoard::poll(Milliseconds elapsed) {
  advance(elapsed);
  Milliseconds next = hangs_until_;
  if (!hangs()) {
    settle_downs(board_ms(elapsed));
    in_application_ = true;
    const std::uint32_t due_ms = application_->poll(board_ms(elapsed));
    in_application_ = false;
    next = elapsed + Milliseconds(downs_ == 0 ? due_ms : 0);
  }
  next = std::min(next, elapsed + Milliseconds(firmware::Application::interlock_period_ms));
  const std::vector<ScriptStep>& steps = options_.script.steps();
  if (next_step_ < steps.size()) next = std::min(next, Milliseconds(steps[next_step_].at_ms));
  if (!options_.clock_ms) arm(next);
  return static_cast<std::uint32_t>((next - elapsed).count());
}

void SimulatedBoard::advance(Milliseconds elapsed) {
  const std::vector<ScriptStep>& steps = options_.script.steps();
  for (;;) {
    while (next_step_ < steps.size() && Milliseconds(steps[next_step_].at_ms) <= passed_) {
      take(steps[next_step_++]);
    }
    if (passed_ >= elapsed) return;
    pass_millisecond();
  }
}

void SimulatedBoard::pass_millisecond() {
  ++passed_;
  hardware_->pass_millisecond(!hangs());
  if (!hangs()) application_->poll_devices(board_ms(passed_));
  if (!hangs()) application_->guard().check_in(firmware::Application::loop_duty);
  if (application_->guard().tick(board_ms(passed_))) {
    watchdog_fed_ = passed_;
  } else if (passed_ - watchdog_fed_ >= watchdog_ms) {
    reset_microcontroller();
    boot(SafeReason::watchdog);
  }
  tell_pins();
  if (options_.events.on_millisecond) options_.events.on_millisecond();
}

void SimulatedBoard::happen(const ScriptStep& step) {
  const Milliseconds now = elapsed();
  advance(now);
  take(step);
  poll(now);
}

void SimulatedBoard::take(const ScriptStep& step) {
  if (options_.events.on_step) options_.events.on_step(board_ms(passed_), step);
  model_.disturb_pins();
  switch (step.kind) {
    case ScriptStep::Kind::handle:
      model_.hold_handle(step.value != 0);
      break;
    case ScriptStep::Kind::ultrasonic:
      model_.connect_ultrasonic(step.channel, step.value != ScriptStep::off);
      if (step.value != ScriptStep::off) {
        model_.set_ultrasonic(step.channel, static_cast<std::uint16_t>(step.value));
      }
      break;
    case ScriptStep::Kind::encoder:
      model_.turn_encoder(step.channel, step.value);
      break;
    case ScriptStep::Kind::analog:
      model_.pin_analog(static_cast<Analog>(step.channel), step.value);
      break;
    case ScriptStep::Kind::divider:
      model_.set_divider(static_cast<Analog>(step.channel), step.value);
      break;
    case ScriptStep::Kind::defect:
      model_.set_defect(step.channel, step.value != 0);
      break;
    case ScriptStep::Kind::motor:
      model_.stall_motor(step.channel, step.value != 0);
      break;
    case ScriptStep::Kind::chip: {
      I2cChipModel& chip = model_.chips()[static_cast<Chip>(step.channel)];
      const auto supply = static_cast<ScriptStep::Supply>(step.value);
      if (supply == ScriptStep::Supply::reset) {
        chip.power_on();
      } else {
        model_.chips().bus.connect(chip, supply == ScriptStep::Supply::on);
      }
      break;
    }
    case ScriptStep::Kind::i2c:
      model_.chips().bus.hold(step.value != 0 ? std::numeric_limits<int>::max() : 0);
      break;
    case ScriptStep::Kind::user_bus:
      model_.devices().bus.set_fault(static_cast<UserBusModel::Fault>(step.value));
      break;
    case ScriptStep::Kind::device: {
      I2cChipModel& device = step.channel < user_device_count
                                 ? model_.devices()[static_cast<UserDevice>(step.channel)]
                                 : optional_devices_[step.channel - user_device_count];
      const auto supply = static_cast<ScriptStep::Supply>(step.value);
      if (supply != ScriptStep::Supply::off) device.power_on();
      model_.devices().bus.connect(device, supply != ScriptStep::Supply::off);
      break;
    }
    case ScriptStep::Kind::uart:
      model_.devices().uarts[step.channel - 1].connect(static_cast<UartPeer>(step.value));
      break;
    case ScriptStep::Kind::gpio:
      model_.set_gpio(step.channel, step.value != 0);
      break;
    case ScriptStep::Kind::hang:
      hangs_until_ = passed_ + Milliseconds(step.value);
      break;
    case ScriptStep::Kind::fault:
      application_->fail(SafeReason::fault, board_ms(passed_));
      break;
    case ScriptStep::Kind::watchdog:
      application_->fail(SafeReason::watchdog, board_ms(passed_));
      break;
    case ScriptStep::Kind::reboot:
      model_.power_on();
      optional_devices_.power_on();
      reset_microcontroller();
      boot();
      break;
  }
}

void SimulatedBoard::tell_pins() {
  const ChipFault fault = hardware_->hal().fault();
  if (fault.any() != told_fault_) {
    told_fault_ = fault.any();
    if (told_fault_ && options_.events.on_fault) {
      options_.events.on_fault(board_ms(passed_), fault);
    }
  }
  if (!options_.events.on_pins || (told_pins_ && !model_.pins_may_differ())) return;
  const Pins pins = model_.pins();
  if (told_pins_ && *told_pins_ == pins) return;
  told_pins_ = pins;
  options_.events.on_pins(board_ms(passed_), pins);
}

void SimulatedBoard::settle_downs(std::uint32_t t_ms) {
  for (const auto& port : ports_) {
    const std::uint32_t bit = 1U << port->number;
    if ((downs_ & bit) == 0) continue;
    downs_ &= ~bit;
    application_->port_down(port->number, t_ms);
  }
}

void SimulatedBoard::arm(Milliseconds at) {
  if (armed_ && armed_for_ <= at) return;
  armed_ = true;
  armed_for_ = at;
  timer_.expires_at(start_ + at);
  timer_.async_wait([this, alive = std::weak_ptr(alive_)](std::error_code error) {
    if (error || alive.expired()) return;
    armed_ = false;
    poll();
  });
}

void SimulatedBoard::on_datagram(CarrierPort& port, Peer from, std::string_view bytes) {
  if (!application_) return;
  const Milliseconds now = elapsed();
  advance(now);
  if (hangs()) return;
  in_application_ = true;
  application_->receive(port.number, from, Text(bytes), board_ms(now));
  in_application_ = false;
  poll(now);
}

void SimulatedBoard::on_drained(CarrierPort& port) {
  if (application_) application_->drained(port.number);
}

void SimulatedBoard::on_carrier_event(CarrierPort& port, const CarrierEvent& event) {
  if (options_.events.on_carrier) options_.events.on_carrier(now_ms(), port.carrier(), event);
  if (!application_ || event.kind != CarrierEvent::Kind::down) return;
  downs_ |= 1U << port.number;
  if (!in_application_) poll();
}

void SimulatedBoard::on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason) {
  if (options_.events.on_state) options_.events.on_state(t_ms, state, reason);
}

void SimulatedBoard::on_outputs(std::uint32_t, const firmware::Outputs&) { tell_pins(); }

void SimulatedBoard::on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command) {
  if (command.kind == CommandKind::setting) {
    const SiteSettings& site = application_->settings().site;
    hardware_->hal().calibrate(site.full_scale_cv);
    if (!model_.is_broken(defects::store)) {  // kept for the next start
      options_.settings.site.wiring = site.wiring;
      options_.settings.site.wiring_source = site.wiring_source;
    }
  }
  if (options_.events.on_executed) options_.events.on_executed(t_ms, pnum, command);
}

void SimulatedBoard::on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code) {
  if (options_.events.on_refused) options_.events.on_refused(t_ms, pnum, code);
}

void SimulatedBoard::on_rejected(std::uint32_t t_ms, Verdict verdict) {
  if (options_.events.on_rejected) options_.events.on_rejected(t_ms, verdict);
}

void SimulatedBoard::on_path(std::uint32_t t_ms, Source path, bool joined) {
  if (options_.events.on_path) options_.events.on_path(t_ms, ports_[path.port]->carrier(), joined);
}

}  // namespace r4::sim
