// SPDX-License-Identifier: GPL-3.0-or-later
// A working day of one board in virtual time, with the application and the chip drivers on the
// model of the board. A host drives the board, and an incident occurs every few minutes. The clock
// in milliseconds and the clock in microseconds both wrap during the day. R4_DAY_HOURS sets the
// length of the day (8 by default), and R4_SEED selects the incidents.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "environment.hpp"
#include "firmware/application/application.hpp"
#include "firmware/ports/sim/simulated_hardware.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "random.hpp"

namespace r4::simulation {
namespace {

using firmware::BoardState;

// The incidents, and the cause that the board reports for each.
enum class Incident {
  chip_off,
  chip_reset,
  bus_held,
  handle,
  obstacle,
  silence,
  stop,
  hang,
  count
};
constexpr SafeReason reasons[] = {SafeReason::fault,  SafeReason::fault,     SafeReason::fault,
                                  SafeReason::handle, SafeReason::proximity, SafeReason::link,
                                  SafeReason::stop,   SafeReason::watchdog};

// The time from the incident until the outputs are safe. This time depends on how the board detects
// the incident.
std::uint32_t limit_ms(Incident incident) {
  switch (incident) {
    case Incident::chip_off:
    case Incident::chip_reset:
      return chip_count * firmware::BoardHardware::verify_us / 1000 + 2;
    case Incident::bus_held:
      return firmware::BoardHardware::verify_us / 1000 + 2;
    case Incident::handle:
      return 11;
    case Incident::obstacle:
      return 4 * 60 + 11;
    case Incident::silence:
      return 1000 + 100 + 1;
    case Incident::stop:
      return 1;
    case Incident::hang:
      return 101;
    case Incident::count:
      break;
  }
  return 0;
}

class Day final : private firmware::Port {
 public:
  Day(std::uint64_t seed, std::uint32_t first_ms)
      : random_(seed), board_(seed), now_ms_(first_ms), application_(hardware_.hal(), config()) {
    board_.power_on();
    hardware_.power_up();
    application_.add_port(*this);
    application_.start(now_ms_);
  }

  void live(std::uint64_t ms) {
    for (const std::uint64_t end = passed_ms_ + ms; passed_ms_ < end;) pass_millisecond();
  }
  void connect() {
    say("H:ROS2-R4", 0);
    say("H:ROS2-R4", heard_t_);
    command("F:ALL");
    command("U:30,1");
    live(300);
    ASSERT_EQ(application_.state(), BoardState::active);
  }
  void drive() {
    command("R:1,On");  // the motors get supply
    for (int i = 0; i < 8; ++i) {
      const int channel = static_cast<int>(random_.between(1, 4));
      const int pwm = static_cast<int>(random_.between(1, 4095));
      command((i % 2 == 0 ? "O:" : "D:") + std::to_string(pwm) + "," +
              std::to_string(random_.below(2)) + "," + std::to_string(channel));
    }
    const auto channel = std::to_string(random_.between(1, 4));
    command("P:" + std::string(random_.below(2) == 0 ? "-" : "") + "1000000,5000," + channel);
    command("S:1500," + std::to_string(random_.between(1, 16)));
    command("B:2000,1,0,1");
    live(1);
    ASSERT_FALSE(board_.pins().is_safe());
  }
  void rest() {
    for (int channel = 1; channel <= 4; ++channel) {
      command("O:0,0," + std::to_string(channel));
      command("D:0,0," + std::to_string(channel));
    }
  }

  // One incident and its end. Then the host drives the board again.
  void suffer(Incident incident) {
    const SafeReason reason = reasons[static_cast<int>(incident)];
    drive();
    live(random_.below(2) == 0 ? random_.between(0, 4) : random_.between(100, 2000));
    const Chip chip = static_cast<Chip>(random_.below(chip_count));
    begin(incident, chip);
    const std::uint64_t began_ms = passed_ms_;
    do {  // a stepper's stop shows one millisecond later
      pass_millisecond();
      ASSERT_LE(passed_ms_ - began_ms, limit_ms(incident) + 1) << static_cast<int>(incident);
    } while (!all_off());
    live(limit_ms(incident) + 150);
    end(incident, chip);
    live(250);
    EXPECT_TRUE(board_.pins().is_safe() || incident == Incident::silence)
        << static_cast<int>(incident);
    if (incident == Incident::silence) rest();
    if (reason == SafeReason::fault || reason == SafeReason::stop ||
        reason == SafeReason::watchdog) {
      ASSERT_EQ(application_.reason(), reason) << static_cast<int>(incident);
      live(1000);
      command("E:CLEAR," + std::to_string(application_.safe_report().cause));
    }
    live(1500);
    ASSERT_EQ(application_.state(), BoardState::active) << static_cast<int>(incident);
    ++incidents[static_cast<int>(incident)];
  }

  void expect_that_counters_are_those_of_the_board() {
    command("E:STOP");
    live(2000);
    command("E:CLEAR," + std::to_string(application_.safe_report().cause));
    live(500);
    const sim::Pins pins = board_.pins();
    for (int i = 0; i < stepper_channels; ++i) {
      EXPECT_EQ(state_.raw.stepper_steps[i], pins.stepper[i].position) << i;
    }
    for (int i = 0; i < encoder_channels; ++i) {
      EXPECT_EQ(state_.raw.encoder_counts[i], board_.shaft_count(i + 1)) << i;
      EXPECT_EQ(state_.raw.encoder_index_counts[i] % sim::BoardModel::counts_a_turn, 0) << i;
      const std::int32_t beyond = state_.raw.encoder_counts[i] - state_.raw.encoder_index_counts[i];
      EXPECT_TRUE(std::abs(beyond) < sim::BoardModel::counts_a_turn) << i << ": " << beyond;
      EXPECT_NEAR(state_.raw.encoder_hz[i], 0, 10) << i << ": the wheel has stopped turning";
    }
  }

  Random& random() { return random_; }
  std::uint64_t passed_ms() const { return passed_ms_; }

  int incidents[static_cast<int>(Incident::count)] = {};
  std::uint64_t states = 0;
  int wrong_states = 0;  // states that do not arrive 10 ms after the previous state
  int unsafe_ms = 0;     // outputs were live while the board was not ACTIVE
  std::uint64_t watched_ms = 0;

 private:
  static firmware::Application::Config config() {
    firmware::Application::Config config;
    config.identity = Identity{"1", "day", "none"};
    return config;
  }

  void pass_millisecond() {
    ++passed_ms_;
    ++now_ms_;
    const auto before = shafts();
    hardware_.pass_millisecond(!hangs_);
    application_.guard().tick(now_ms_);
    const bool active = application_.state() == BoardState::active;
    if (!hangs_) {
      due_ms_ = due_ms_ > 1 ? due_ms_ - 1 : application_.poll(now_ms_);
      application_.guard().check_in(firmware::Application::loop_duty);
    }
    if (speaks_ && passed_ms_ % 100 == 0) say("H:ROS2-R4", heard_t_);
    stand_ = before == shafts();
    const bool back = passed_ms_ - ended_ms_ > firmware::BoardHardware::retry_us / 1000 + 2;
    if (!active && application_.state() != BoardState::active && back && passed_ms_ % 16 == 0) {
      ++watched_ms;
      if (!all_off()) ++unsafe_ms;
    }
  }

  std::array<std::int32_t, stepper_channels> shafts() const {
    std::array<std::int32_t, stepper_channels> steps{};
    for (int i = 0; i < stepper_channels; ++i) steps[i] = board_.stepper_shaft(i + 1);
    return steps;
  }

  void begin(Incident incident, Chip chip) {
    switch (incident) {
      case Incident::chip_off:
        silent_ = chip;
        return board_.chips().bus.connect(board_.chips()[chip], false);
      case Incident::chip_reset:
        return board_.chips()[chip].power_on();
      case Incident::bus_held:
        held_ = true;
        return board_.chips().bus.hold(1000000);
      case Incident::handle:
        return board_.hold_handle(false);
      case Incident::obstacle:
        return board_.set_ultrasonic(1, 20);
      case Incident::silence:
        speaks_ = false;
        return;
      case Incident::stop:
        return command("E:STOP");
      case Incident::hang:
        hangs_ = true;
        return;
      case Incident::count:
        return;
    }
  }
  void end(Incident incident, Chip chip) {
    board_.chips().bus.connect(board_.chips()[chip], true);
    board_.chips().bus.hold(0);
    silent_ = Chip::count;
    held_ = false;
    board_.hold_handle(true);
    board_.set_ultrasonic(1, incident == Incident::obstacle ? 100 : 0);
    speaks_ = true;
    hangs_ = false;
    ended_ms_ = passed_ms_;
  }
  // True if every output that the board can reach is off. A chip that does not answer keeps its
  // outputs, and each chip on a held bus keeps its outputs. The relay of the dead-man's handle and
  // the emergency switch cut the supply of these outputs.
  bool all_off() {
    sim::ChipPins pins = board_.pins();
    const sim::ChipPins safe = sim::ChipPins::safe();
    if (held_) return stand_ && hardware_.hal().fault().any();
    if (silent_ == Chip::osmc_pwm) std::copy(safe.osmc, safe.osmc + osmc_channels, pins.osmc);
    if (silent_ == Chip::dhb12_pwm) std::copy(safe.dhb12, safe.dhb12 + dhb12_channels, pins.dhb12);
    if (silent_ == Chip::servo_pwm) {
      std::copy(safe.servo_us, safe.servo_us + servo_channels, pins.servo_us);
    }
    for (int i = 0; i < bldc_channels; ++i) {
      if (silent_ == Chip::dac) pins.bldc[i].speed = 0;
      if (silent_ == Chip::expander) {
        pins.bldc[i].brake = true;
        pins.bldc[i].direction = Direction::reverse;
      }
    }
    if (silent_ == Chip::expander) pins.relays = 0;
    return stand_ && pins == safe;
  }

  void command(const std::string& field) { say(field, heard_t_); }
  void say(const std::string& fields, std::uint32_t t) {
    if (hangs_) return;
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    const std::size_t colon = fields.find(':');
    writer.field(Text(fields.substr(0, colon))).values(Text(fields.substr(colon + 1)));
    writer.session(1);
    const Text bytes = writer.finish(pnum_++, t);
    application_.receive(0, 1, bytes, now_ms_);
    due_ms_ = 0;
  }

  void send(Text bytes, Priority, std::uint32_t) override {
    Datagram datagram;
    ASSERT_TRUE(read_datagram(bytes, datagram));
    const MessageKind kind = kind_of(datagram);
    if (kind == MessageKind::board_heartbeat) {
      heard_t_ = static_cast<std::uint32_t>(datagram.time_ms());
    }
    if (kind != MessageKind::state) return;
    const std::uint32_t before_ms = state_.t_ms;
    ASSERT_TRUE(read_state(datagram, state_));
    ++states;
    if (state_.t_ms - before_ms == 10) return;
    if (state_.t_ms != before_ms) ++wrong_states;
  }
  std::size_t max_size() const override { return max_datagram; }

  Random random_;
  sim::BoardModel board_;
  sim::SimulatedHardware hardware_{board_};
  std::uint32_t now_ms_;
  std::uint64_t passed_ms_ = 0;
  firmware::Application application_;
  std::uint32_t due_ms_ = 0;
  bool speaks_ = true;
  bool hangs_ = false;
  bool held_ = false;
  bool stand_ = true;  // no stepper has moved in the last millisecond
  std::uint64_t ended_ms_ =
      0;  // end of the last incident; the next attempt reaches a chip that answers again
  Chip silent_ = Chip::count;
  std::uint32_t pnum_ = 7;
  std::uint32_t heard_t_ = 0;
  State state_;
};

TEST(BoardDay, EveryIncidentEndsSafeAndTheBoardDrivesAgain) {
  const std::uint64_t hours = from_environment("R4_DAY_HOURS", 8);
  const std::uint64_t seed = from_environment("R4_SEED", 1);
  Day day(seed, 0U - static_cast<std::uint32_t>(hours * 3600U * 1000U / 2));  // wraps at noon
  day.connect();
  int next = 0;
  while (day.passed_ms() < hours * 3600 * 1000) {
    day.live(day.random().between(60'000, 400'000));
    day.suffer(static_cast<Incident>(next++ % static_cast<int>(Incident::count)));
    if (testing::Test::HasFatalFailure()) break;
  }
  day.expect_that_counters_are_those_of_the_board();
  EXPECT_EQ(day.unsafe_ms, 0) << "of " << day.watched_ms;
  std::printf("%llu states in %llu ms, %d off the grid; %d incidents\n",
              static_cast<unsigned long long>(day.states),
              static_cast<unsigned long long>(day.passed_ms()), day.wrong_states, next);
  // States may leave the grid of 10 ms once after each outage of the link or the loop.
  EXPECT_LE(day.wrong_states, 1 + day.incidents[static_cast<int>(Incident::silence)] +
                                  day.incidents[static_cast<int>(Incident::hang)]);
}

}  // namespace
}  // namespace r4::simulation
