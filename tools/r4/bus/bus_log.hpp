// SPDX-License-Identifier: GPL-3.0-or-later
// What was said on the CAN buses of a dump by candump: the datagrams of every node, joined by the
// ISO-TP receivers that boards and hosts have, and the raw frames, as JSON objects
// (`r4 decode --candump`, docs/can.md).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "../shell/json.hpp"
#include "bus_transfers.hpp"
#include "candump.hpp"

namespace r4::tool {

class BusLog final : BusTransfers::Handler {
 public:
  using Print = std::function<void(const Json&)>;

  explicit BusLog(Print print) : print_(std::move(print)) {}

  // A line of the dump, not empty. Prints what it completes or ends.
  void on_line(std::uint64_t number, std::string_view text);
  // A line that is too long to be one of candump.
  void on_long_line(std::uint64_t number, std::uint64_t size);
  // The dump is over: prints the summary.
  void finish();

  // Was there a damaged line, a transfer that failed, or a datagram that is none?
  bool any_bad() const { return damaged_ + failed_ + bad_ != 0; }

 private:
  void on_frame(const CandumpLine& line, const BusTransfers::Place& place);
  void on_datagram(const BusTransfers::Lane& lane) override;
  void on_failure(const BusTransfers::Lane& lane, const BusTransfers::Place& place,
                  IsotpError error) override;
  void on_raw_frame(const std::string& interface, const CanIdMeaning& meaning,
                    const CanFrame& frame, const BusTransfers::Place& place) override;
  void report_damage(std::uint64_t number, const char* reason, const char* fix, Json rest);

  Print print_;
  BusTransfers transfers_{*this};
  std::uint64_t frames_ = 0;
  std::uint64_t datagrams_ = 0;     // whole ones, good or bad
  std::uint64_t bad_ = 0;           // of those
  std::uint64_t failed_ = 0;        // transfers, and frames that no transfer can have
  std::uint64_t raw_ = 0;           // emergency stops and boards that went safe
  std::uint64_t other_ = 0;         // frames that are none of ours
  std::uint64_t error_frames_ = 0;  // of the controller
  std::uint64_t damaged_ = 0;       // lines
};

}  // namespace r4::tool
