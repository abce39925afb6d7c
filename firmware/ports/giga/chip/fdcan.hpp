// SPDX-License-Identifier: GPL-3.0-or-later
// An FDCAN controller of the STM32H747 for classic frames (RM0399, chapter FDCAN). The core's
// library has no filters, no error state, no recovery from bus-off, and loses frames between polls.
//     received    emergency stop            -> FIFO 1,  8 frames, the newest stay
//                 commands to this board,
//                 watchers' requests        -> FIFO 0, 64 frames: 7 ms of a full bus
//                 everything else           -> rejected
//     to send     urgent frames             -> own buffer; a lower id overtakes the queue
//                 other frames, in order    -> FIFO of 8 frames
//
// An interrupt wakes the loop and reports a stop. Never waits for the bus. Times are us, and wrap.
#pragma once

#include <cstdint>

#include "chip.hpp"
#include "r4link/can/can_frame.hpp"

namespace r4 {
namespace giga {

constexpr std::uint32_t can_bit_rate = 1000000;  // for all nodes of the bus

// Sample point at 86.7 %, as near as the clock allows.
struct CanBitTiming {
  std::uint32_t prescaler = 1;
  std::uint32_t before_sample = 0;  // quanta without the synchronisation quantum
  std::uint32_t after_sample = 0;
  std::uint32_t jump = 0;
  bool valid = false;
};
// `kernel_hz` / `bit_rate`, the quanta per bit, must be a whole number from 15 to 255.
CanBitTiming can_bit_timing(std::uint32_t kernel_hz, std::uint32_t bit_rate);

enum class CanState : std::uint8_t { off, active, warning, passive, bus_off };
const char* to_text(CanState state);

struct FdcanCounters {
  std::uint32_t received = 0;
  std::uint32_t sent = 0;  // frames given to the controller
  std::uint32_t lost = 0;  // times that FIFO 0 was full
  std::uint32_t bus_offs = 0;
  std::uint32_t stale = 0;  // times that unacknowledged frames were dropped
};

class Fdcan {
 public:
  // Shortest time in bus-off. Then 128 times 11 recessive bits let the controller return.
  static constexpr std::uint32_t bus_off_us = 100000;
  // Frames that could not leave for this time are dropped as old.
  static constexpr std::uint32_t stale_us = 50000;

  // `message_ram` points to the words_used words of this controller.
  Fdcan(FDCAN_GlobalTypeDef& registers, volatile std::uint32_t* message_ram)
      : registers_(registers), ram_(message_ram) {}

  // The controller's clock must be on. False: invalid timing, or the controller does not respond.
  bool start(const CanBitTiming& timing, std::uint32_t stop_id, std::uint32_t command_id,
             std::uint32_t watch_id);

  // Takes the oldest frame, stops first. False: none.
  bool receive(CanFrame& frame);
  bool send(const CanFrame& frame);
  bool send_urgent(const CanFrame& frame);

  enum class Event : std::uint8_t { none, bus_off, stale };
  // bus_off: the controller left the bus; stale: nothing was sent for stale_us. In both cases all
  // waiting frames are dropped.
  Event poll(std::uint32_t now_us);
  // Call in the controller's interrupt, to clear it. True: an emergency stop waits in FIFO 1.
  bool on_interrupt();

  CanState state() const;
  bool on_bus() const { return started_ && !bus_off_; }
  std::uint32_t transmit_errors() const { return started_ ? registers_.ECR & 0xFFU : 0; }
  std::uint32_t receive_errors() const { return started_ ? registers_.ECR >> 8 & 0x7FU : 0; }
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
  // Values at the last poll. If `sent` rose, the queue has moved, even if it was refilled.
  std::uint32_t pending_before_ = 0;
  std::uint32_t sent_before_ = 0;
  std::uint32_t moved_us_ = 0;  // when a frame last left the queue
  FdcanCounters counters_;
};

}  // namespace giga
}  // namespace r4
