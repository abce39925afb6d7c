// SPDX-License-Identifier: GPL-3.0-or-later
// Decodes a candump log to datagrams and raw frames (`r4 decode --candump`, docs/reference/can.md).
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

  void on_line(std::uint64_t number, std::string_view text);
  void on_long_line(std::uint64_t number, std::uint64_t size);
  void finish();

  bool any_bad() const { return damaged_ + failed_ + bad_ != 0; }

 private:
  void on_frame(const CandumpLine& line, const BusTransfers::LogPosition& position);
  void on_datagram(const BusTransfers::Lane& lane) override;
  void on_failure(const BusTransfers::Lane& lane, const BusTransfers::LogPosition& position,
                  IsotpError error) override;
  void on_raw_frame(const std::string& interface, const CanIdMeaning& meaning,
                    const CanFrame& frame, const BusTransfers::LogPosition& position) override;
  void report_damage(std::uint64_t number, const char* reason, const char* fix, Json rest);

  Print print_;
  BusTransfers transfers_{*this};
  std::uint64_t frames_ = 0;
  std::uint64_t datagrams_ = 0;  // complete, valid or not
  std::uint64_t bad_ = 0;
  std::uint64_t failed_ = 0;  // failed transfers, and frames that fit no transfer
  std::uint64_t raw_ = 0;     // emergency stops and went-safe frames
  std::uint64_t other_ = 0;   // frames of other protocols
  std::uint64_t error_frames_ = 0;
  std::uint64_t damaged_ = 0;
};

}  // namespace r4::tool
