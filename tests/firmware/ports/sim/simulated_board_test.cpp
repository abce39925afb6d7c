// SPDX-License-Identifier: GPL-3.0-or-later
// The simulated board on a pair of memory carriers, with a clock that the test advances.
#include "firmware/ports/sim/simulated_board.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <memory>
#include <string>
#include <vector>

#include "protocol/link/board_link.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/state.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/every_channel.hpp"
#include "transports/memory_carrier.hpp"

namespace r4::sim {
namespace {

using firmware::BoardState;

struct BoardListener final : Carrier::Handler {
  std::vector<std::string> heard;
  void on_datagram(std::string_view bytes, Peer) override { heard.emplace_back(bytes); }
  void on_carrier_event(const CarrierEvent&) override {}
};

class SimulatedBoardTest : public testing::Test {
 protected:
  void build(SimulatedBoard::Options options = {}) {
    options.seed = options.seed.value_or(5);
    options.clock_ms = [this] { return clock_ms_; };
    options.events.on_state = [this](std::uint32_t t_ms, BoardState state, SafeReason reason) {
      events_.push_back(std::string(firmware::to_text(state)) + " " + to_text(reason));
      event_ms_ = t_ms;
    };
    options.events.on_pins = [this](std::uint32_t, const Pins& pins) {
      const std::string event = "outputs " + std::to_string(pins.osmc[0].pwm);
      if (pins.osmc[0].pwm != seen_pwm_) events_.push_back(event);
      seen_pwm_ = pins.osmc[0].pwm;
    };
    options.events.on_fault = [this](std::uint32_t, ChipFault fault) {
      events_.push_back(to_text(fault.trouble));
    };
    options.events.on_executed = [this](std::uint32_t, std::uint32_t pnum, const Command&) {
      events_.push_back("executed " + std::to_string(pnum - first_pnum));
    };
    options.events.on_refused = [this](std::uint32_t, std::uint32_t, Refusal code) {
      events_.push_back("refused " + test::str(name_of(code)));
    };
    options.events.on_carrier = [this](std::uint32_t, const Carrier&, const CarrierEvent& event) {
      events_.push_back(event.kind == CarrierEvent::Kind::up ? "up" : "down");
    };
    board_ = std::make_unique<SimulatedBoard>(io_, std::move(options));
    auto [host_end, board_end] = make_memory_pair(io_, "memory:");
    host_ = std::move(host_end);
    board_->add_carrier(std::move(board_end));
    host_->open(listener_);
    board_->start();
    deliver();
  }

  void deliver() {
    io_.restart();
    io_.poll();
  }

  // Runs the board as its own timer would.
  void run(std::uint32_t ms) {
    const std::uint32_t end = clock_ms_ + ms;
    while (clock_ms_ != end) {
      const std::uint32_t due = board_->poll();
      clock_ms_ += std::max(1U, std::min(due, end - clock_ms_));
      board_->poll();
      deliver();
    }
  }

  // Runs the board with a host that sends heartbeats at 10 Hz.
  void run_alive(std::uint32_t ms) {
    for (std::uint32_t done = 0; done < ms; done += 100) {
      heartbeat(newest_t());
      run(std::min(100U, ms - done));
    }
  }

  void send(const std::string& fields) {
    const std::string bytes = test::with_crc(fields);
    host_->send(bytes, Priority::normal);
    deliver();
  }
  void heartbeat(std::uint32_t t) {
    send("H:ROS2-R4;SID:0123456789abcdef;PNum:" + std::to_string(pnum_++) +
         ";T:" + std::to_string(t) + ";");
  }
  void command(const std::string& field) {
    send(field + ";SID:0123456789abcdef;PNum:" + std::to_string(pnum_++) + ";T:1;");
  }
  void connect() {
    heartbeat(0);
    heartbeat(newest_t());
    events_.clear();
    listener_.heard.clear();
  }

  std::string clear_field() const {
    return "E:CLEAR," + std::to_string(board_->application().safe_report().cause);
  }
  std::uint32_t newest_t() const {
    for (auto line = listener_.heard.rbegin(); line != listener_.heard.rend(); ++line) {
      Datagram datagram;
      if (read_datagram(*line, datagram) && kind_of(datagram) == MessageKind::board_heartbeat) {
        newest_t_ = static_cast<std::uint32_t>(datagram.time_ms());
        break;
      }
    }
    return newest_t_;
  }

  std::vector<State> states() const {
    std::vector<State> states;
    for (const std::string& line : listener_.heard) {
      Datagram datagram;
      State state;
      if (read_datagram(line, datagram) && kind_of(datagram) == MessageKind::state &&
          read_state(datagram, state)) {
        states.push_back(state);
      }
    }
    return states;
  }

  static constexpr std::uint32_t first_pnum = 1000;
  asio::io_context io_;
  std::uint32_t clock_ms_ = 0;
  std::uint32_t pnum_ = first_pnum;
  mutable std::uint32_t newest_t_ = 0;
  BoardListener listener_;
  std::unique_ptr<Carrier> host_;
  std::unique_ptr<SimulatedBoard> board_;
  std::vector<std::string> events_;
  std::uint32_t event_ms_ = 0;
  int seen_pwm_ = -1;
};

using Lines = std::vector<std::string>;

// --- every output register

// True if the channel is full off.
bool off(const Pca9685Model& chip, int channel) {
  const auto off_high = static_cast<std::uint8_t>(0x06 + 4 * channel + 3);
  return (chip.reg(off_high) & 0x10) != 0;
}

bool driven(const Pca9685Model& chip, int channel) {
  return !off(chip, channel) && chip.duty(channel) != 0;
}

constexpr std::uint8_t brakes_on = 0b10101010;  // according to the wiring plan

// The first register that does not have its safe value, or an empty text.
std::string unsafe_register(BoardChips& chips) {
  for (const Pca9685Model* chip : {&chips.osmc, &chips.dhb12, &chips.servo}) {
    for (int i = 0; i < Pca9685Model::channels; ++i) {
      if (!off(*chip, i)) return "LED" + std::to_string(i);
    }
  }
  using Expander = Mcp23017Model::Register;
  if (chips.expander.reg(0, Expander::olat) != brakes_on) return "OLATA";
  if (chips.expander.reg(1, Expander::olat) != 0) return "OLATB";
  for (int port = 0; port < Mcp23017Model::ports; ++port) {
    if (chips.expander.reg(port, Expander::iodir) != 0) return "IODIR";
  }
  for (int i = 0; i < Mcp4728Model::channels; ++i) {
    if (chips.dac.input(i).code != 0 || chips.dac.output(i).code != 0) return "DAC";
  }
  return "";
}

void expect_all_driven(BoardChips& chips) {
  constexpr int lines = 2 * osmc_channels;  // duty and direction
  for (int i = 0; i < lines; ++i) {
    EXPECT_TRUE(driven(chips.osmc, i)) << i;
    EXPECT_TRUE(driven(chips.dhb12, i)) << i;
  }
  for (int i = 0; i < Pca9685Model::channels; ++i) EXPECT_TRUE(driven(chips.servo, i)) << i;
  using Expander = Mcp23017Model::Register;
  EXPECT_EQ(chips.expander.reg(0, Expander::olat), 0b01010101) << "forward, no brake";
  EXPECT_EQ(chips.expander.reg(1, Expander::olat), 0xFF);
  for (int i = 0; i < Mcp4728Model::channels; ++i) EXPECT_NE(chips.dac.output(i).code, 0) << i;
}

// --- the wiring

class WiredBoardTest : public SimulatedBoardTest {
 protected:
  void start_again() {
    board_->happen(Script::parse_now("reboot", "test").value());
    run(600);  // a heartbeat of the new start
    connect();
    run_alive(300);
  }
  SafeReason reason() const { return board_->application().reason(); }
  // The duty of OSMC 1 after a command for it.
  int driven() {
    command("O:358,1,1");
    run_alive(100);
    return board_->model().pins().osmc[0].pwm;
  }
};

TEST_F(WiredBoardTest, UsesTheWiringOfItsSettings) {
  for (const bool knows : {false, true}) {
    SimulatedBoard::Options options;
    options.wired.at(SignalKind::osmc_chip).byte = 0x44;
    options.wired.at(SignalKind::handle).byte = 53 | Place::option_bit;
    if (knows) {
      options.settings.site.wiring = options.wired;
      options.settings.site.wiring_source = WiringSource::given;
    }
    build(std::move(options));
    start_again();
    EXPECT_EQ(reason(), knows ? SafeReason::none : SafeReason::fault);
    EXPECT_EQ(driven(), knows ? 358 : 0);
  }
}

TEST_F(WiredBoardTest, AnUnconfirmedPlanIsAFaultAtEachStartUntilItIsCleared) {
  SimulatedBoard::Options options;
  options.plan_confirmed = false;
  build(std::move(options));
  for (int start = 0; start < 2; ++start) {
    start_again();
    EXPECT_EQ(reason(), SafeReason::fault);
    EXPECT_EQ(states().back().fault, (ChipFault{0, ChipTrouble::not_confirmed}));
    EXPECT_EQ(driven(), 0);
    command(clear_field());
    EXPECT_EQ(driven(), 358) << "its host has said so, for this start";
  }
}

TEST_F(SimulatedBoardTest, WaitsForAHostAndThenStreamsTheInputsOfTheBench) {
  build();
  run(1000);
  for (const std::string& line : listener_.heard) {
    EXPECT_EQ(line, "H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^");
  }
  EXPECT_EQ(listener_.heard.size(), 3U);
  EXPECT_EQ(events_, (Lines{"up", "CONNECTING link", "outputs 0"}));

  connect();
  run_alive(1000);
  const std::vector<State> seen = states();
  ASSERT_EQ(seen.size(), 100U);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_TRUE(seen[i].handle_held());
    EXPECT_GE(seen[i].raw.analog_cv[0], 2413);
    EXPECT_LE(seen[i].raw.analog_cv[0], 2456);
    if (i > 0) {
      EXPECT_EQ(seen[i].t_ms - seen[i - 1].t_ms, 10U);
    }
  }
}

TEST_F(SimulatedBoardTest, ObeysItsHostAndGoesSafeWhenItFallsSilent) {
  build();
  connect();
  command("O:358,1,1");
  EXPECT_EQ(events_, (Lines{"executed 2", "outputs 358"}));
  EXPECT_EQ(board_->model().pins().osmc[0].pwm, 358);
  events_.clear();
  const std::uint32_t fed = board_->now_ms();
  heartbeat(newest_t());
  run(2000);
  EXPECT_EQ(events_, (Lines{"outputs 0", "SAFE link"}));
  EXPECT_EQ(event_ms_ - fed, 1000U);
  EXPECT_TRUE(board_->model().pins().is_safe());
}

TEST_F(SimulatedBoardTest, EveryOutputRegisterIsSafeInTimeWhenTheHostFallsSilent) {
  for (const std::uint32_t timeout_ms : {1000U, 100U}) {
    build();
    connect();
    command("C:heartbeat,50");
    command("C:timeout," + std::to_string(timeout_ms));
    for (int i = 1; i <= relay_channels; ++i) command("R:" + std::to_string(i) + ",On");
    for (int i = 1; i <= 4; ++i) {
      const std::string channel = std::to_string(i);
      for (const std::string drive : {"O:4095,1,", "D:1,1,", "B:4095,1,0,", "P:-1000000,20000,"}) {
        command(drive + channel);
      }
    }
    for (int i = 1; i <= servo_channels; ++i) command("S:2500," + std::to_string(i));
    run(10);
    expect_all_driven(board_->model().chips());
    for (const Pins::Stepper& stepper : board_->model().pins().stepper) {
      EXPECT_EQ(stepper.stepping, -1);
    }

    heartbeat(newest_t());
    std::uint32_t silence_ms = 0;
    while (!unsafe_register(board_->model().chips()).empty() && silence_ms < 2 * timeout_ms) {
      run(1);
      ++silence_ms;
    }
    const Pins safe = board_->model().pins();
    EXPECT_GE(silence_ms, timeout_ms);
    EXPECT_LE(silence_ms, timeout_ms + 20) << unsafe_register(board_->model().chips());
    for (int ms = 0; ms < 500; ++ms) {
      run(1);
      EXPECT_EQ(unsafe_register(board_->model().chips()), "") << ms << " ms later";
    }
    const Pins later = board_->model().pins();
    for (int i = 0; i < stepper_channels; ++i) {
      EXPECT_EQ(later.stepper[i].position, safe.stepper[i].position) << "stepper " << i + 1;
    }
  }
}

TEST_F(SimulatedBoardTest, ReportsARefusedCommand) {
  build();
  connect();
  command("O:5000,1,1");
  EXPECT_EQ(events_, (Lines{"refused RANGE"}));
}

TEST_F(SimulatedBoardTest, FollowsItsScriptToTheMillisecond) {
  SimulatedBoard::Options options;
  options.script = Script::parse(
      "0.123 handle released\n"
      "0.25 handle held\n"
      "0.3 analog AIN24 21.5\n"
      "0.3 enc 2 100\n"
      "0.3 us 3 42\n"
      "0.9 fault\n",
      "test");
  build(std::move(options));
  connect();
  const std::uint32_t start = board_->now_ms();
  command("O:358,1,1");
  events_.clear();
  run_alive(200);
  EXPECT_EQ(events_, (Lines{"outputs 0", "SAFE handle"}));
  EXPECT_EQ(event_ms_ - start, 123U);
  events_.clear();
  run_alive(300);
  EXPECT_EQ(events_, (Lines{"ACTIVE none"}));
  EXPECT_GE(event_ms_ - start, 250U + 20U);  // the handle may bounce
  EXPECT_LE(event_ms_ - start, 250U + 31U);
  command("F:DEFAULT,ENC2,US3");
  listener_.heard.clear();
  run_alive(300);
  const State state = states().back();
  EXPECT_EQ(state.raw.analog_cv[0], 2150);
  EXPECT_EQ(state.raw.encoder_counts[1], 100);
  EXPECT_EQ(state.raw.ultrasonic_cm[2], 42);
  events_.clear();
  run_alive(200);
  EXPECT_EQ(events_, (Lines{"SAFE fault"}));
  EXPECT_EQ(event_ms_ - start, 900U);
}

TEST_F(SimulatedBoardTest, ARebootForgetsTheHostAndChangesTheClock) {
  SimulatedBoard::Options options;
  options.script = Script::parse("0.05 reboot", "test");
  build(std::move(options));
  connect();
  command("O:358,1,1");
  command("P:1000,1000,1");
  const std::uint32_t before = board_->now_ms();
  events_.clear();
  run(51);
  EXPECT_EQ(events_, (Lines{"CONNECTING link", "outputs 0"}));
  EXPECT_TRUE(board_->model().pins().is_safe());
  EXPECT_GT(board_->now_ms() - before, 1000U);
  EXPECT_EQ(listener_.heard.back(), "H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^");
  command("O:400,1,1");
  EXPECT_TRUE(board_->model().pins().is_safe());
  heartbeat(0);
  heartbeat(newest_t());
  command("O:400,1,1");
  EXPECT_EQ(board_->model().pins().osmc[0].pwm, 400);
}

TEST_F(SimulatedBoardTest, GoesSafeAtOnceWhenTheHostsCarrierCloses) {
  build();
  connect();
  command("O:358,1,1");
  events_.clear();
  host_->close();
  deliver();
  EXPECT_EQ(events_, (Lines{"down", "outputs 0", "SAFE link"}));
  EXPECT_TRUE(board_->model().pins().is_safe());

  events_.clear();
  listener_.heard.clear();
  host_->open(listener_);
  deliver();
  run(500);
  heartbeat(newest_t());
  EXPECT_EQ(events_, (Lines{"up", "outputs 358", "ACTIVE none"}));
}

TEST_F(SimulatedBoardTest, TheSameSeedGivesTheSameTrace) {
  Lines traces[2];
  for (Lines& trace : traces) {
    clock_ms_ = 0;
    pnum_ = first_pnum;
    listener_.heard.clear();
    SimulatedBoard::Options options;
    options.seed = 77;
    build(std::move(options));
    heartbeat(0);
    run_alive(500);
    trace = listener_.heard;
  }
  EXPECT_GT(traces[0].size(), 50U);
  EXPECT_EQ(traces[0], traces[1]);
}

TEST_F(SimulatedBoardTest, AnotherSeedStartsTheClockAtAnotherTime) {
  SimulatedBoard::Options options;
  options.seed = 1;
  build(std::move(options));
  const std::uint32_t one = board_->now_ms();
  options = {};
  options.seed = 2;
  build(std::move(options));
  EXPECT_GT(board_->now_ms() - one, 1000U);
}

TEST_F(SimulatedBoardTest, StopsAndStartsAgain) {
  build();
  connect();
  command("O:358,1,1");
  board_->stop();
  EXPECT_TRUE(board_->model().pins().is_safe());
  board_->start();
  deliver();
  EXPECT_EQ(board_->application().state(), BoardState::connecting);
}

TEST_F(SimulatedBoardTest, AnswersIdentify) {
  SimulatedBoard::Options options;
  options.board_id = "bench-3";
  options.firmware_version = "9.9";
  build(std::move(options));
  command("Q:ID");
  EXPECT_EQ(listener_.heard.back().substr(0, 60),
            "I:R4,9.9,bench-3,sim+leave+group+watch+i2c+uart+dac;BUSY:0;A");
}

TEST_F(SimulatedBoardTest, RefusesAFifthCarrier) {
  build();
  for (int i = 1; i < firmware::Application::max_ports; ++i) {
    board_->add_carrier(make_memory_pair(io_).first);
  }
  EXPECT_THROW(board_->add_carrier(make_memory_pair(io_).first), Error);
}

TEST_F(SimulatedBoardTest, EveryChannelReachesItsPinAndIsReportedBack) {
  build();
  connect();
  test::expect_every_channel({
      [this](const std::string& text) {
        heartbeat(newest_t());
        events_.clear();
        command(text == "E:CLEAR" ? clear_field() : text);
        EXPECT_EQ(std::count(events_.begin(), events_.end(),
                             "executed " + std::to_string(pnum_ - 1 - first_pnum)),
                  1)
            << text;
      },
      [this] {
        newest_t();
        listener_.heard.clear();
        for (;;) {  // a state with all fields is sent in parts
          heartbeat(newest_t());
          run(10);
          State whole;
          std::uint32_t t_ms = 0;
          for (const std::string& line : listener_.heard) {
            Datagram datagram;
            if (read_datagram(line, datagram) && kind_of(datagram) == MessageKind::state &&
                read_state(datagram, whole)) {
              t_ms = whole.t_ms;
            }
          }
          if (t_ms != 0) return whole;
        }
      },
      [this](const auto& action) { action(*board_); },
  });
}

// --- trouble with the chips and the loop

class TroubledBoardTest : public SimulatedBoardTest {
 protected:
  void drive(const std::string& script) {
    SimulatedBoard::Options options;
    options.script = Script::parse(script, "test");
    build(std::move(options));
    connect();
    command("O:358,1,1");
    EXPECT_EQ(board_->model().pins().osmc[0].pwm, 358);
    events_.clear();
  }
  void expect_drives_after_clear() {
    heartbeat(newest_t());
    command(clear_field());
    command("O:400,1,1");
    EXPECT_EQ(board_->model().pins().osmc[0].pwm, 400);
  }
};

TEST_F(TroubledBoardTest, ASilentChipIsAFaultUntilItAnswersAndIsCleared) {
  drive("0.3 chip dac off\n2 chip dac on\n");
  run_alive(500);
  EXPECT_EQ(events_, (Lines{"no acknowledge", "outputs 0", "SAFE fault"}));
  EXPECT_TRUE(board_->model().pins().is_safe());
  heartbeat(newest_t());
  command(clear_field());  // executed, but the fault persists
  EXPECT_EQ(board_->application().reason(), SafeReason::fault);
  events_.clear();
  command("O:400,1,1");
  EXPECT_EQ(events_, Lines{"refused SAFE"});
  run_alive(2000);
  EXPECT_EQ(board_->application().reason(), SafeReason::fault);
  expect_drives_after_clear();
}

TEST_F(TroubledBoardTest, AHeldBusIsAFaultAndTheLoopContinues) {
  drive("0.3 i2c held\n1 i2c free\n");
  listener_.heard.clear();
  run_alive(700);
  EXPECT_EQ(board_->application().reason(), SafeReason::fault);
  EXPECT_EQ(events_.front(), "bus stuck");
  EXPECT_GE(states().size(), 69U);
  run_alive(1000);
  EXPECT_TRUE(board_->model().pins().is_safe());
  expect_drives_after_clear();
}

TEST_F(TroubledBoardTest, AHungLoopGoesSafeBeforeTheWatchdogResetsIt) {
  drive("0.3 hang 0.3\n");
  run_alive(300);
  const std::uint32_t hung = board_->now_ms();
  std::uint32_t off_ms = 0;
  while (board_->model().pins().osmc[0].pwm != 0 && off_ms < 300) {
    run(1);
    ++off_ms;
  }
  EXPECT_GE(off_ms, 99U);
  EXPECT_LE(off_ms, 101U);
  EXPECT_EQ(events_, Lines{"outputs 0"});  // before the application notices the fault
  while (board_->now_ms() - hung < 320) run(1);
  EXPECT_EQ(events_.back(), "SAFE watchdog");
  heartbeat(newest_t());
  run_alive(300);
  expect_drives_after_clear();
}

TEST_F(TroubledBoardTest, TheWatchdogResetsALoopThatStaysHung) {
  drive("0.3 hang 5\n");
  run(1000);
  EXPECT_EQ(events_, (Lines{"outputs 0", "CONNECTING link", "CONNECTING watchdog"}));
  EXPECT_TRUE(board_->model().pins().is_safe());
  heartbeat(0);
  heartbeat(newest_t());
  events_.clear();
  command("O:400,1,1");
  EXPECT_EQ(events_, Lines{"refused SAFE"});
  expect_drives_after_clear();
}

}  // namespace
}  // namespace r4::sim
