// SPDX-License-Identifier: GPL-3.0-or-later
#include "simulated_board.hpp"

#include <algorithm>
#include <random>
#include <system_error>
#include <utility>

#include "random.hpp"

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
      hal_(seed_),
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
  start_ = Clock::now();
  clock_start_ms_ = options_.clock_ms ? options_.clock_ms() : 0;
  next_step_ = 0;
  power_on(elapsed());
  try {
    for (const auto& port : ports_) port->open();
  } catch (...) {
    stop();
    throw;
  }
  boot(elapsed());
  poll();
}

void SimulatedBoard::stop() noexcept {
  alive_.reset();
  timer_.cancel();
  armed_ = false;
  for (const auto& port : ports_) port->close();
  application_.reset();
  hal_.make_safe();
}

SimulatedBoard::Milliseconds SimulatedBoard::elapsed() const {
  if (options_.clock_ms) return Milliseconds(options_.clock_ms() - clock_start_ms_);
  return std::chrono::floor<Milliseconds>(Clock::now() - start_);
}

// A fresh application on hardware that has just got its supply.
void SimulatedBoard::power_on(Milliseconds elapsed) {
  clock_offset_ms_ = static_cast<std::uint32_t>(scramble(seed_ + boots_));
  ++boots_;
  downs_ = 0;
  hal_.power_on(board_ms(elapsed));
  firmware::Application::Config config;
  config.identity.firmware = Text(options_.firmware_version);
  config.identity.board_id = Text(options_.board_id);
  config.identity.capabilities = Text(options_.capabilities);
  config.settings = options_.settings;
  Observer& observer = *this;
  application_.emplace(hal_, config, &observer);
  for (const auto& port : ports_) port->number = application_->add_port(*port);
}

void SimulatedBoard::boot(Milliseconds elapsed) {
  in_application_ = true;
  application_->start(board_ms(elapsed));
  in_application_ = false;
}

std::uint32_t SimulatedBoard::poll() { return poll(elapsed()); }

std::uint32_t SimulatedBoard::poll(Milliseconds elapsed) {
  advance(elapsed);
  settle_downs(board_ms(elapsed));
  in_application_ = true;
  const std::uint32_t due_ms = application_->poll(board_ms(elapsed));
  in_application_ = false;
  Milliseconds next = elapsed + Milliseconds(downs_ == 0 ? due_ms : 0);
  const std::vector<ScriptStep>& steps = options_.script.steps();
  if (next_step_ < steps.size()) next = std::min(next, Milliseconds(steps[next_step_].at_ms));
  if (!options_.clock_ms) arm(next);
  return static_cast<std::uint32_t>((next - elapsed).count());
}

// Lets time pass around the board.
void SimulatedBoard::advance(Milliseconds elapsed) {
  hal_.advance(board_ms(elapsed));
  const std::vector<ScriptStep>& steps = options_.script.steps();
  while (next_step_ < steps.size() && Milliseconds(steps[next_step_].at_ms) <= elapsed) {
    take(steps[next_step_++], elapsed);
  }
}

void SimulatedBoard::take(const ScriptStep& step, Milliseconds elapsed) {
  switch (step.kind) {
    case ScriptStep::Kind::handle:
      hal_.hold_handle(step.value != 0);
      break;
    case ScriptStep::Kind::ultrasonic:
      hal_.set_ultrasonic(step.channel, static_cast<std::uint16_t>(step.value));
      break;
    case ScriptStep::Kind::encoder:
      hal_.set_encoder(step.channel, step.value);
      break;
    case ScriptStep::Kind::analog:
      hal_.pin_analog(static_cast<Analog>(step.channel), step.value);
      break;
    case ScriptStep::Kind::fault:
      application_->fail(SafeReason::fault, board_ms(elapsed));
      break;
    case ScriptStep::Kind::watchdog:
      application_->fail(SafeReason::watchdog, board_ms(elapsed));
      break;
    case ScriptStep::Kind::reboot:
      power_on(elapsed);
      boot(elapsed);
      break;
  }
}

void SimulatedBoard::settle_downs(std::uint32_t t_ms) {
  for (const auto& port : ports_) {
    const std::uint32_t bit = 1U << port->number;
    if ((downs_ & bit) == 0) continue;
    downs_ &= ~bit;
    application_->port_down(port->number, t_ms);
  }
}

// Sees to it that poll() is called at `at` or before.
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
  in_application_ = true;
  application_->receive(port.number, from, Text(bytes), board_ms(now));
  in_application_ = false;
  poll(now);
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

void SimulatedBoard::on_outputs(std::uint32_t t_ms, const firmware::Outputs& outputs) {
  if (options_.events.on_outputs) options_.events.on_outputs(t_ms, outputs);
}

void SimulatedBoard::on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command) {
  if (options_.events.on_executed) options_.events.on_executed(t_ms, pnum, command);
}

void SimulatedBoard::on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code) {
  if (options_.events.on_refused) options_.events.on_refused(t_ms, pnum, code);
}

}  // namespace r4::sim
