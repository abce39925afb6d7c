// SPDX-License-Identifier: GPL-3.0-or-later
// Converts frames of CAN buses to records. Each node of each interface is a path,
// can://can0?node=3, numbered as first heard. A datagram gets the time of its last frame.
// Events: an emergency stop, "stop can0", without a path; a board that goes safe, "link safe stop".
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "../bus/bus_transfers.hpp"
#include "r4link/recordings/recording_visitor.hpp"

namespace r4::tool {

// The URL of the board. A name that a URL cannot hold, such as python-can's /dev/ttyACM0 or
// ff15::1, is put in brackets: can://[%2Fdev%2FttyACM0]?node=3.
std::string bus_url(std::string_view interface, std::uint8_t node);
std::string bus_interface(const std::string& host);

class BusRecords final : BusTransfers::Handler {
 public:
  explicit BusRecords(RecordingVisitor& visitor) : visitor_(visitor) {}

  // `position` must have a time. Ignores frames of other protocols.
  void on_frame(std::string_view interface, const CanFrame& frame,
                const BusTransfers::LogPosition& position);
  void finish();
  bool told() const { return told_; }
  // Reports a path and returns its number. Call also for paths that are not on CAN.
  std::uint16_t add_path(const std::string& url);

 private:
  void on_datagram(const BusTransfers::Lane& lane) override;
  void on_failure(const BusTransfers::Lane& lane, const BusTransfers::LogPosition& position,
                  IsotpError error) override;
  void on_raw_frame(const std::string& interface, const CanIdMeaning& meaning,
                    const CanFrame& frame, const BusTransfers::LogPosition& position) override;
  std::uint16_t path_of(const std::string& interface, std::uint8_t node);
  void tell(const Record& record);
  void damage(const BusTransfers::LogPosition& position, const std::string& reason);

  RecordingVisitor& visitor_;
  BusTransfers transfers_{*this};
  std::map<std::pair<std::string, std::uint8_t>, std::uint16_t> paths_;
  std::uint16_t last_path_ = 0;
  bool told_ = false;
};

}  // namespace r4::tool
