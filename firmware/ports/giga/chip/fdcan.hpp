// SPDX-License-Identifier: GPL-3.0-or-later
// An FDCAN controller of the STM32H747 for classic frames, by its registers and its message RAM
// (RM0399, chapter FDCAN). The core's own library has no filters, no error state and no way out of
// bus-off, and loses frames between polls.
//
//     received    the emergency stop   -> FIFO 1,  8 frames, the newest stay
//                 commands to us, and
//                 who watches us       -> FIFO 0, 64 frames: 7 ms of a full bus
//                 all else             -> nowhere
//     to send     what is urgent       -> a buffer of its own, which overtakes the queue by its id
//                 the rest, in order   -> FIFO of 8 frames
//
// An interrupt wakes the loop and tells of a stop: the hardware keeps the frames. Times are
// microseconds of a clock that wraps. Nothing waits for the bus.
#pragma once

#include <cstdint>

#include "chip.hpp"
#include "r4link/can/can_frame.hpp"

namespace r4 {
namespace giga {

// Where the bit is sampled: at 86.7 %, as near as the clock allows.
struct CanBitTiming {
  std::uint32_t prescaler = 1;
  std::uint32_t before_sample = 0;  // quanta, without the one of synchronisation
  std::uint32_t after_sample = 0;
  std::uint32_t jump = 0;
  bool valid = false;
};
// For `kernel_hz` / `bit_rate` quanta a bit, which must be a whole number of 15 to 255.
CanBitTiming can_bit_timing(std::uint32_t kernel_hz, std::uint32_t bit_rate);

enum class CanState : std::uint8_t { off, active, warning, passive, bus_off };
// "off", "active", "warning", "passive", "bus-off".
const char* to_text(CanState state);

struct FdcanCounters {
  std::uint32_t received = 0;
  std::uint32_t sent = 0;  // handed to the controller
  std::uint32_t lost = 0;  // times that FIFO 0 was full
  std::uint32_t bus_offs = 0;
  std::uint32_t stale = 0;  // times that what nobody acknowledged was thrown away
};

class Fdcan {
 public:
  // How long bus-off lasts at least, before 128 times 11 recessive bits let the controller return.
  static constexpr std::uint32_t bus_off_us = 100000;
  // What has not left for this long is thrown away: it is old.
  static constexpr std::uint32_t stale_us = 50000;

  // `message_ram`: the first word of the RAM, of which words_used are this controller's.
  Fdcan(FDCAN_GlobalTypeDef& registers, volatile std::uint32_t* message_ram)
      : registers_(registers), ram_(message_ram) {}

  // False: the clock does not fit, or the controller does not follow. Its clock must be on.
  bool start(const CanBitTiming& timing, std::uint32_t stop_id, std::uint32_t command_id,
             std::uint32_t watch_id);

  // The oldest frame that was received, stops first. False: none.
  bool receive(CanFrame& frame);
  // False: no room now.
  bool send(const CanFrame& frame);
  bool send_urgent(const CanFrame& frame);

  // What a turn of the loop finds.
  enum class Event : std::uint8_t { none, bus_off, stale };
  // Looks after the controller. bus_off: it has just left the bus; stale: nothing went out for
  // stale_us. In both cases whatever waited is gone.
  Event poll(std::uint32_t now_us);
  // In its interrupt: takes it back. True: an emergency stop has come in; it waits to be received,
  // too.
  bool on_interrupt();

  CanState state() const;
  bool on_bus() const { return started_ && !bus_off_; }
  std::uint32_t transmit_errors() const { return registers_.ECR & 0xFFU; }
  std::uint32_t receive_errors() const { return registers_.ECR >> 8 & 0x7FU; }
  const FdcanCounters& counters() const { return counters_; }

  static constexpr std::uint32_t words_used = 2 + 2 + 64 * 4 + 8 * 4 + 9 * 4;

 private:
  bool set_init(bool wanted);
  void write_element(std::uint32_t index, const CanFrame& frame);
  void read_element(std::uint32_t word, CanFrame& frame) const;
  void drop_pending();

  FDCAN_GlobalTypeDef& registers_;
  volatile std::uint32_t* const ram_;
  bool started_ = false;
  bool bus_off_ = false;
  std::uint32_t bus_off_since_us_ = 0;
  // At the last poll; what is refilled must have left.
  std::uint32_t pending_before_ = 0;
  std::uint32_t sent_before_ = 0;
  std::uint32_t moved_us_ = 0;  // when something left last
  FdcanCounters counters_;
};

}  // namespace giga
}  // namespace r4
