// SPDX-License-Identifier: GPL-3.0-or-later
// The whole board on the processor: drivers on chips behind a bus in real time, interrupts in the
// middle of its transfers, and what they must bring about.
//
// Timer 1 interrupts every 50 us: five bytes of a line at 1 Mbit/s, and each millisecond the board's
// own interrupt.
#include "firmware/ports/mps2/board.hpp"

#include <new>

#include "on_target.hpp"
#include "protocol/command.hpp"
#include "protocol/datagram_writer.hpp"

namespace {

using namespace r4;
using namespace r4::mps2;

constexpr std::uint32_t step_us = 50;
constexpr std::uint32_t bytes_a_step = 5;
constexpr std::uint32_t timeout_ms = 200;

void (*on_step)() = nullptr;

// Interrupts come while one lives.
class Steps {
 public:
  explicit Steps(void (*handler)(), std::uint32_t first_us = step_us) {
    on_step = handler;
    BoardClock::wake_every(step_us, first_us);
    give_way(Irq::timer1);
    disable(Irq::timer1);  // and forget what has come before
    enable(Irq::timer1);
  }
  ~Steps() { disable(Irq::timer1); }
  Steps(const Steps&) = delete;
  Steps& operator=(const Steps&) = delete;
};

std::uint32_t us_since(std::uint32_t ticks) {
  return (BoardClock::ticks() - ticks) / BoardClock::ticks_per_us;
}

void wait_us(std::uint32_t us) {
  const std::uint32_t began = BoardClock::ticks();
  while (us_since(began) < us) {
  }
}

// A board with a host that is lines of text.
class Bench final : public sim::I2cObserver {
 public:
  Bench() : board_(1, link_, udp_, config()) {
    board_.model().chips().bus.set_observer(this);
    link_.start();
    board_.power_up();
    board_.start(SafeReason::none);
  }

  void on_transfer(const sim::I2cTransfer& transfer) override {
    cut_ += transfer.result == firmware::I2cResult::timeout ? 1 : 0;
    const InterruptsHeld held;
    const bool safe = chips_are_safe();
    if (safe && !safe_) safe_ticks_ = BoardClock::ticks();
    safe_ = safe;
  }

  // Each step_us.
  void step() {
    for (std::uint32_t i = 0; i < bytes_a_step && line_sent_ < line_size_; ++i) {
      link_.on_byte(line_[line_sent_]);
      line_sent_ = line_sent_ + 1;
      line_end_ticks_ = BoardClock::ticks();
    }
    const bool stop = link_.take_stop();
    if (stop) board_.on_stop();
    if ((++steps_ % (1000 / step_us) == 0 || stop) && board_.on_wake()) feedings_ = feedings_ + 1;
  }

  // A line begins to come.
  void send(DatagramWriter& writer) {
    const Text datagram = writer.finish(pnum_, 100000 + pnum_);
    ++pnum_;
    line_size_ = line_sent_ = 0;
    std::size_t size = 0;
    for (const char c : datagram) line_[size++] = c;
    line_[size++] = '\n';
    line_size_ = size;
  }
  void heartbeat() {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    writer.field("H").value(host_heartbeat_word);
    send(writer);
  }
  void command(const Command& command) {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    write_command(writer, command);
    send(writer);
  }
  // Turns of the loop until the line has come and its effect, too.
  void run_ms(std::uint32_t ms) {
    const std::uint32_t began = now_ms();
    while (now_ms() - began < ms || line_sent_ < line_size_) {
      board_.turn();
      board_.rest();
    }
  }
  void execute(const Command& what) {
    command(what);
    run_ms(2);
  }
  // A session, and every output on.
  void drive_everything() {
    heartbeat();
    run_ms(2);
    for (int i = 1; i <= 4; ++i) {
      execute(Command::osmc(1000 + i, Direction::forward, i));
      execute(Command::dhb12(2000 + i, Direction::forward, i));
      execute(Command::bldc(3000 + i, Direction::forward, false, i));
      execute(Command::stepper(1000000, 1000 * i, i));
    }
    for (int i = 1; i <= servo_channels; ++i) execute(Command::servo(600 + 100 * i, i));
    heartbeat();
    for (int i = 1; i <= relay_channels; ++i) execute(Command::relay(i, true));
    run_ms(5);
  }

  sim::ChipPins pins() const { return board_.model().chips().pins(); }
  bool chips_are_safe() const { return pins().is_safe(); }
  bool safe() const { return safe_; }
  std::uint32_t now_ms() { return board_.clock().now_ms(); }
  std::uint32_t safe_ticks() const { return safe_ticks_; }
  std::uint32_t line_end_ticks() const { return line_end_ticks_; }
  bool line_has_come() const { return line_sent_ == line_size_; }
  std::uint32_t cut() const { return cut_; }
  std::uint32_t feedings() const { return feedings_; }
  Board& board() { return board_; }

 private:
  static firmware::Application::Config config() {
    firmware::Application::Config config;
    config.settings.timeout_ms = timeout_ms;
    config.settings.heartbeat_ms = 100;
    return config;
  }

  Uart link_{uart0_base};
  UdpPort udp_{0, 0};
  mutable Board board_;
  char line_[128];
  volatile std::size_t line_size_ = 0;
  volatile std::size_t line_sent_ = 0;
  volatile std::uint32_t line_end_ticks_ = 0;
  std::uint32_t pnum_ = 1;
  std::uint32_t steps_ = 0;
  volatile std::uint32_t feedings_ = 0;
  volatile std::uint32_t cut_ = 0;
  volatile bool safe_ = true;
  volatile std::uint32_t safe_ticks_ = 0;
};
Bench* bench = nullptr;

// A board that is just on; there is room for one.
Bench& new_board() {
  alignas(Bench) static unsigned char room[sizeof(Bench)];
  bench = new (room) Bench;
  return *bench;
}

void step_of_board() { bench->step(); }

}  // namespace

extern "C" void r4_wake() {
  BoardClock::on_wake_interrupt();
  on_step();
}

TEST(Board, EveryCommandReachesItsPins) {
  Bench& host = new_board();
  const Steps steps(step_of_board);
  host.drive_everything();
  const sim::ChipPins pins = host.pins();
  for (int i = 0; i < 4; ++i) {
    EXPECT(pins.osmc[i].pwm == 1001 + i && pins.osmc[i].direction == Direction::forward);
    EXPECT(pins.dhb12[i].pwm == 2001 + i && pins.dhb12[i].direction == Direction::forward);
    EXPECT(pins.bldc[i].speed == 3001 + i && !pins.bldc[i].brake);
    EXPECT(host.board().model().pins().stepper[i].position > 0);
  }
  for (int i = 0; i < servo_channels; ++i) {
    const int off = pins.servo_us[i] - (700 + 100 * i);
    EXPECT(-3 <= off && off <= 3);
  }
  EXPECT(pins.relays == 0xFF);
  EXPECT(host.feedings() > 30);
}

TEST(Board, TheSafeStateInAnInterruptHoldsWhateverTransferItCutsShort) {
  Bench& host = new_board();
  std::uint32_t cut = 0;
  for (std::uint32_t at_us = 1; at_us < 1200; at_us += 31) {
    firmware::BoardHardware& hal = host.board().hal();
    firmware::Outputs outputs;
    outputs.osmc[0] = {static_cast<std::uint16_t>(at_us), Direction::forward};
    for (int i = 0; i < 4; ++i) outputs.bldc[i] = {1000, Direction::forward, false};
    for (std::uint16_t& us : outputs.servo_us) us = 1500;
    outputs.relays = 0xFF;
    const std::uint32_t cut_before = host.cut();
    {
      static bool done = false;
      done = false;
      const Steps steps(
          [] {
            if (!done) bench->board().hal().make_safe();
            done = true;
          },
          at_us);
      hal.apply(outputs);
      hal.poll(host.now_ms() * 1000);
      while (!done) {
      }
    }
    EXPECT(host.chips_are_safe());
    EXPECT(!hal.fault().any());
    for (int i = 0; i < 10; ++i) hal.poll((host.now_ms() + static_cast<std::uint32_t>(i)) * 1000);
    wait_us(2000);
    EXPECT(host.chips_are_safe() && hal.ready() && !hal.fault().any());
    cut += host.cut() != cut_before ? 1 : 0;
  }
  on_target::say_number("transfers that were cut short", cut);
  EXPECT(cut >= 20);
}

TEST(Board, ALoopThatHangsIsMadeSafeByTheTimerAndStarvesTheWatchdog) {
  Bench& host = new_board();
  const Steps steps(step_of_board);
  host.drive_everything();
  host.heartbeat();
  host.run_ms(2);
  EXPECT(!host.safe());
  const std::uint32_t hung = BoardClock::ticks();
  const std::uint32_t feedings = host.feedings();
  while (!host.safe() && us_since(hung) < 500000) {
  }
  const std::uint32_t after_us = (host.safe_ticks() - hung) / BoardClock::ticks_per_us;
  on_target::say_number("us from the loop's last turn to safe", after_us);
  EXPECT(host.safe() && after_us > 5 * 20000 - 2000 && after_us < 5 * 20000 + 5000);
  EXPECT(host.feedings() - feedings <= 1);
  host.run_ms(5);
  EXPECT(host.board().application().reason() == SafeReason::watchdog);
  EXPECT(host.chips_are_safe());
}

TEST(Board, SilenceIsNoticedInTheTimerInterruptWhileTheLoopIsElsewhere) {
  Bench& host = new_board();
  const Steps steps(step_of_board);
  host.drive_everything();
  host.heartbeat();
  host.run_ms(2);
  const std::uint32_t fed_ms = host.board().application().link().fed_ms();
  const std::uint32_t began = BoardClock::ticks();
  while (!host.safe() && us_since(began) < 500000) {
    host.board().application().guard().check_in(firmware::Application::loop_duty);
  }
  const std::uint32_t silence_ms = host.now_ms() - fed_ms;
  on_target::say_number("ms of silence until safe, with a timeout of 200", silence_ms);
  EXPECT(host.safe() && silence_ms >= timeout_ms && silence_ms <= timeout_ms + 3);
  host.run_ms(5);
  EXPECT(host.board().application().reason() == SafeReason::link);
  // The host comes back, and so does what it had set.
  host.heartbeat();
  host.run_ms(20);
  EXPECT(host.board().application().reason() == SafeReason::none && host.pins().relays == 0xFF);
}

// E:STOP at each moment of the bus's busiest time: all outputs are being written anew.
TEST(Board, AStopIsDoneWithinTwoMillisecondsOfItsLastByte) {
  Bench& host = new_board();
  const Steps steps(step_of_board);
  std::uint32_t longest_us = 0;
  for (std::uint32_t at_us = 0; at_us < 6000; at_us += 370) {
    host.execute(Command::clear());
    host.drive_everything();
    host.run_ms(timeout_ms + 10);
    EXPECT(host.safe());
    host.heartbeat();  // what was set comes back
    while (!host.line_has_come()) host.board().turn();
    const std::uint32_t resumed = BoardClock::ticks();
    bool sent = false;
    while (!sent || !host.line_has_come() || !host.safe()) {
      if (!sent && us_since(resumed) >= at_us) {
        host.command(Command::stop());
        sent = true;
      }
      host.board().turn();
      if (us_since(resumed) > 100000) break;
    }
    EXPECT(host.safe());
    const std::uint32_t took =
        (host.safe_ticks() - host.line_end_ticks()) / BoardClock::ticks_per_us;
    if (took > longest_us && took < 100000) longest_us = took;
    host.run_ms(5);
    EXPECT(host.chips_are_safe() && host.board().application().reason() == SafeReason::stop);
  }
  on_target::say_number("us from a stop's last byte to the last safe register, at most",
                        longest_us);
  EXPECT(longest_us <= 2000);
}
