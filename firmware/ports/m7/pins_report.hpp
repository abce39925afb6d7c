// SPDX-License-Identifier: GPL-3.0-or-later
// Reports each change of the pins on a UART (`tools/m7 --pins`), so that tests need not rely on the
// board's states. A line: the time in ms and us, the last datagram in us, the last feeding
// heartbeat in ms, 1 if the chips' pins are safe, then the outputs as in sim::Pins. A change is
// noted after its transfer, also in interrupts, and sent by the loop. At most notes_max notes wait.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../../protocol/datagram/numbers.hpp"
#include "../../../protocol/link/board_link.hpp"
#include "../sim/robot/board_model.hpp"
#include "chip/board_clock.hpp"

namespace r4 {
namespace m7 {

class PinsReport final : public sim::I2cObserver {
 public:
  static constexpr int notes_max = 16;

  PinsReport(sim::BoardModel& board, BoardClock& clock, const BoardLink& link, std::uint32_t base);
  void start();

  void on_transfer(const sim::I2cTransfer&) override { look(); }
  void poll();  // in each turn of the loop

  // Call in interrupts: a datagram arrived at `ticks`. Only the newest datagram is reported.
  static void on_datagram(std::uint32_t ticks) {
    if (static_cast<std::int32_t>(ticks - datagram_ticks_) > 0) datagram_ticks_ = ticks;
  }

 private:
  struct Note {
    std::uint32_t t_ms = 0;
    std::uint32_t t_us = 0;
    std::uint32_t heard_us = 0;
    std::uint32_t fed_ms = 0;
    sim::Pins pins;
  };

  void look();
  void write_line(const Note& note);
  void add(const Drive& drive);
  template <class Number>
  void add(Number number);

  static volatile std::uint32_t datagram_ticks_;

  sim::BoardModel& board_;
  BoardClock& clock_;
  const BoardLink& link_;
  const std::uint32_t base_;
  sim::Pins last_;
  Note notes_[notes_max];
  volatile std::uint32_t noted_ = 0;
  volatile std::uint32_t told_ = 0;
  char line_[58 * (max_number_text + 1)];  // up to 58 numbers
  std::size_t size_ = 0;
  std::size_t sent_ = 0;
};

}  // namespace m7
}  // namespace r4
