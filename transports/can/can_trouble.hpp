// SPDX-License-Identifier: GPL-3.0-or-later
// Whether a board and other hosts are heard on a CAN bus, and why datagrams do not pass. No I/O.
//     foreign frames   frames came on the board's command id for host_completes, but no whole
//                      datagram. A host sends ten heartbeats a second: another protocol has the id
//     late frames      the board is heard, but late_transfers transfers within late_within were not
//                      answered in time (N_Bs, N_Cr): frames are held back, or lost
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "r4link/carrier.hpp"

namespace r4 {

class CanTrouble {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::milliseconds;
  static constexpr Duration board_silence{3000};  // six heartbeats of a board
  static constexpr Duration host_silence{300};    // three heartbeats of a host
  static constexpr Duration host_completes{500};  // five heartbeats of a host
  static constexpr Duration frames_over{1000};    // after a longer pause, host_completes restarts
  static constexpr std::size_t late_transfers = 3;
  static constexpr Duration late_within{2000};

  void on_board(Time now) { board_heard_ = now; }
  // A frame on the board's command id that this host did not send.
  void on_host_frame(Time now) {
    if (now - host_heard_ > frames_over || !incomplete()) frames_since_ = now;
    host_heard_ = now;
  }
  void on_host_datagram(Time now) { host_completed_ = now; }
  // `count`: the total of transfers that were not answered in time.
  void on_late(std::uint64_t count, Time now) {
    for (; late_count_ < count; ++late_count_) late_[place(late_count_)] = now;
  }

  std::uint64_t late() const { return late_count_; }

  bool hears_board(Time now) const { return now - board_heard_ <= board_silence; }
  bool hears_host(Time now) const {
    return now - host_heard_ < host_silence && !hears_foreign_frames(now);
  }
  TransportTrouble now(Time now) const {
    if (hears_foreign_frames(now)) return TransportTrouble::foreign_frames;
    const Time oldest = late_[place(late_count_)];
    const bool late = late_count_ >= late_.size() && now - oldest < late_within;
    return late && hears_board(now) ? TransportTrouble::late_frames : TransportTrouble::none;
  }

 private:
  static std::size_t place(std::uint64_t count) {
    return static_cast<std::size_t>(count % late_transfers);
  }
  bool incomplete() const { return frames_since_ > host_completed_; }
  bool hears_foreign_frames(Time now) const {
    return now - host_heard_ < frames_over && incomplete() &&
           host_heard_ - frames_since_ >= host_completes;
  }

  Time board_heard_;
  Time host_heard_;
  Time host_completed_;
  Time frames_since_;  // the first frame after the last datagram or pause
  std::uint64_t late_count_ = 0;
  std::array<Time, late_transfers> late_;  // the newest late transfers, in a ring
};

}  // namespace r4
