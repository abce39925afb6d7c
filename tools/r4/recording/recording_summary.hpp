// SPDX-License-Identifier: GPL-3.0-or-later
// Contents of a recording for `r4 info`. Memory does not grow with the recording.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "../shell/json.hpp"
#include "r4link/messages/packet_tracker.hpp"
#include "r4link/recordings/recording_visitor.hpp"

namespace r4::tool {

// A board sends at least twice a second, so a silence of 1 s is a gap even if a datagram is late.
constexpr Time shortest_gap{std::chrono::seconds{1}};

struct PathSummary {
  RecordedPath recorded;
  std::vector<std::string> devices;  // "bno055@0x28:1"
  // From the board:
  std::uint64_t received = 0;  // valid datagrams
  std::uint64_t states = 0;
  std::uint64_t damaged = 0;
  std::uint64_t oversize = 0;  // longer than a datagram may be
  PacketTracker packets;
  Time first{0}, last{0};
  // To the board:
  std::uint64_t sent = 0;
  std::uint64_t heartbeats = 0;
  std::uint64_t stops = 0;
  // The board's safe states:
  SafeReason safe = SafeReason::none;
  Time safe_since{0};
  Time safe_for{0};
  std::array<std::uint64_t, safe_reason_count> safe_times{};
  std::uint64_t downs = 0;  // transport down
  std::uint64_t gaps = 0;
  Time longest_gap{0};
  Time longest_gap_at{0};
};

class RecordingSummary final : public RecordingVisitor {
 public:
  void on_header() override;
  void on_path(const RecordedPath& path) override;
  void on_device(const RecordedDevice& device) override;
  void on_record(const Record& record) override;
  void on_damage(const RecordingDamage& damage) override;

  std::string text(const std::string& name) const;
  Json json(const std::string& name) const;
  bool damaged() const { return damage_count_ != 0; }

 private:
  struct Damage {
    std::string where;
    std::uint64_t line, offset;
    std::string reason;
  };

  PathSummary& of(std::uint16_t number);
  std::size_t add(std::uint16_t number);
  void on_event(const Record& record);
  static void on_received(PathSummary& path, const Record& record);
  static void on_sent(PathSummary& path, const Record& record);
  static void be_safe(PathSummary& path, SafeReason reason, Time now);

  // Indexes of paths_ by number since the last header; paths_ is by number and URL.
  std::map<std::uint16_t, std::size_t> numbers_;
  std::vector<PathSummary> paths_;
  bool any_ = false;
  Time first_{0}, last_{0};
  std::uint64_t records_ = 0;
  std::uint64_t dropped_ = 0;  // dropped because the disk was too slow
  std::uint64_t unended_ = 0;  // recordings without an end
  bool ended_ = true;
  std::uint64_t damage_count_ = 0;
  std::vector<Damage> damage_;
};

}  // namespace r4::tool
