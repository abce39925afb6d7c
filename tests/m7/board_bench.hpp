// SPDX-License-Identifier: GPL-3.0-or-later
// The whole board on the processor, for tests. The board's drivers use chips on a bus in real time,
// and interrupts occur in the middle of transfers. A host sends commands as lines of text, and a
// listener receives the board's UDP datagrams.
//
// Timer 1 interrupts every 50 us. Each interrupt delivers five bytes of a line at 1 Mbit/s, and
// every millisecond it also runs the board's interrupt.
#pragma once

#include <cstdint>

#include "firmware/ports/m7/board_program.hpp"
#include "on_target.hpp"
#include "protocol/messages/command_field.hpp"
#include "r4link/command.hpp"
#include "r4link/messages/datagram_writer.hpp"

namespace r4 {
namespace m7 {

constexpr std::uint32_t step_us = 50;
constexpr std::uint32_t bytes_a_step = 5;
constexpr std::uint32_t timeout_ms = 200;
constexpr std::uint32_t board_address = 0x0A00020F;
constexpr std::uint16_t board_port = 2018;

extern void (*on_step)();

// Timer 1 interrupts while an object of this class exists.
class Stepping {
 public:
  explicit Stepping(void (*handler)(), std::uint32_t first_us = step_us) {
    on_step = handler;
    BoardClock::wake_every(step_us, first_us);
    give_way(Irq::timer1);
    disable(Irq::timer1);  // clears a pending interrupt
    enable(Irq::timer1);
  }
  ~Stepping() { disable(Irq::timer1); }
  Stepping(const Stepping&) = delete;
  Stepping& operator=(const Stepping&) = delete;
};

inline std::uint32_t us_since(std::uint32_t ticks) {
  return (BoardClock::ticks() - ticks) / BoardClock::ticks_per_us;
}

// Receives the datagrams that the board sends over UDP. The listener sends one datagram first,
// because the board needs its address.
class Listener {
 public:
  void start(UdpPort& board);
  // Reads all datagrams that have arrived.
  void hear();

  const State& state() const { return state_; }                       // the newest state
  std::uint32_t states() const { return states_; }                    // states since forget()
  std::uint32_t longest_step_ms() const { return longest_step_ms_; }  // longest step of T
  std::uint32_t lost() const { return lost_; }  // states lost, by the packet numbers
  std::uint32_t bad() const { return bad_; }    // datagrams that could not be read
  void forget() { states_ = longest_step_ms_ = lost_ = bad_ = 0; }

 private:
  static constexpr std::uint32_t address = 0x0A000202;
  static constexpr std::uint16_t port = 5000;

  void on_datagram(Text bytes);

  Lan9118 chip_;
  UdpFrames frames_{address, port};
  std::uint32_t words_[Lan9118::max_frame / 4];
  State state_;
  bool heard_ = false;
  std::uint32_t pnum_ = 0;
  std::uint32_t states_ = 0;
  std::uint32_t longest_step_ms_ = 0;
  std::uint32_t lost_ = 0;
  std::uint32_t bad_ = 0;
};

// A board, and a host that sends lines of text to it.
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

  // Is called every step_us.
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

  // Starts to deliver a line. step() delivers the bytes of the line.
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
  // Runs the loop for `ms`, and until the whole line has arrived.
  void run_ms(std::uint32_t ms) {
    const std::uint32_t began = now_ms();
    while (now_ms() - began < ms || line_sent_ < line_size_) {
      board_.turn();
      listener_.hear();
      board_.rest();
    }
  }
  // Like run_ms(), with a heartbeat every 100 ms.
  void run_alive_ms(std::uint32_t ms) {
    for (; ms != 0; ms -= ms < 100 ? ms : 100) {
      heartbeat();
      run_ms(ms < 100 ? ms : 100);
    }
  }
  void execute(const Command& what) {
    command(what);
    run_ms(2);
  }
  // Begins a session and switches every output on.
  void drive_everything() {
    heartbeat();
    run_ms(2);
    for (int i = 1; i <= relay_channels; ++i) execute(Command::relay(i, true));
    for (int i = 1; i <= 4; ++i) {
      execute(Command::osmc(i, Pwm(1000 + i), Direction::forward));
      execute(Command::dhb12(i, Pwm(2000 + i), Direction::forward));
      execute(Command::bldc(i, Pwm(3000 + i), Direction::forward, false));
      execute(Command::stepper(i, Steps(1000000), StepsPerSecond(1000 * i)));
    }
    for (int i = 1; i <= servo_channels; ++i)
      execute(Command::servo(i, Microseconds(600 + 100 * i)));
    heartbeat();
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
  BoardProgram& board() { return board_; }
  sim::BoardModel& model() { return board_.model(); }
  SafeReason reason() { return board_.application().reason(); }
  // Starts to receive the board's UDP datagrams.
  Listener& listen() {
    listener_.start(udp_);
    board_.turn();
    return listener_;
  }

 private:
  static firmware::Application::Config config() {
    firmware::Application::Config config;
    config.settings.timeout_ms = timeout_ms;
    config.settings.heartbeat_ms = 100;
    return config;
  }

  Uart link_{uart0_base};
  UdpPort udp_{board_address, board_port};
  mutable BoardProgram board_;
  Listener listener_;
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

// Replaces the only board with a board that was just switched on, and its host. `bench` points to
// the new board.
Bench& new_board();
extern Bench* bench;

inline void step_of_board() { bench->step(); }

}  // namespace m7
}  // namespace r4
