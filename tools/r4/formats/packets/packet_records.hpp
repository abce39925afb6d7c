// SPDX-License-Identifier: GPL-3.0-or-later
// Converts packets of a network or a CAN bus to records: UDP datagrams to and from a board's port,
// CAN frames of boards, and PcapngSink's output. A capture without any record is refused.
// A packet captured on two interfaces of the computer (tcpdump -i any) is reported once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "../../bus/bus_transfers.hpp"
#include "../bus_records.hpp"
#include "../byte_order.hpp"
#include "r4link/recordings/recording_reader.hpp"

namespace r4::tool {

struct PacketInterface {
  std::uint32_t number = 0;  // number in the file, across sections
  std::uint16_t link_type = 0;
  std::string name;         // "can0"; empty: unknown
  std::string description;  // identifies r4's own interfaces
};

struct Packet {
  Time time{0};
  std::uint64_t offset = 0;
  std::string_view bytes;
  bool cut = false;  // the packet was longer than its captured part
};

class PacketRecords {
 public:
  PacketRecords(RecordingVisitor& visitor, std::string name, std::uint16_t port)
      : visitor_(visitor),
        name_(std::move(name)),
        lines_(visitor, name_),
        bus_(visitor),
        port_(port) {}

  // Throws Error{data} for mixed recordings.
  void on_packet(const PacketInterface& interface, const Packet& packet);
  void on_damage() { lines_.on_damage(); }
  // Throws Error{data} if no data of a board was found, and damage cannot be the reason.
  void finish(bool any_damage);

 private:
  struct Udp {
    std::string from, to;  // addresses as in a URL
    std::uint16_t from_port = 0, to_port = 0;
    std::uint16_t id = 0;  // IPv4 id; 0: none
    std::string_view payload;
    bool cut = false;
  };
  static bool read_ip(std::string_view bytes, Udp& out);
  enum class Kind : std::uint8_t { none, recorded, captured };
  void be(Kind kind);
  void on_line(const PacketInterface& interface, const Packet& packet);
  void on_own(const PacketInterface& interface, const Packet& packet);
  void on_ip(std::string_view bytes, const Packet& packet);
  void on_can(std::string_view interface, std::uint32_t id, std::string_view bytes,
              const Packet& packet);
  void on_cooked(std::uint16_t protocol, std::string_view bytes, std::string_view interface,
                 const Packet& packet);
  std::uint32_t cooked_id(std::string_view bytes);
  bool is_repeated(const Udp& udp, Time time);
  std::uint16_t path_of(const std::string& address);
  void damage(const Packet& packet, std::string_view reason);

  struct Seen {
    std::size_t hash = 0;
    Time time{-1'000'000'000};
  };

  RecordingVisitor& visitor_;
  const std::string name_;
  RecordingLines lines_;
  BusRecords bus_;
  const std::uint16_t port_;
  std::map<std::string, std::uint16_t> paths_;
  std::optional<ByteOrder> cooked_order_;  // byte order of CAN ids in cooked captures, if known
  std::array<Seen, 64> seen_;
  std::size_t next_seen_ = 0;
  bool told_ = false;
  Kind kind_ = Kind::none;
  std::uint64_t packets_ = 0;
  std::map<std::uint16_t, std::uint64_t> unread_links_, ports_;
};

}  // namespace r4::tool
