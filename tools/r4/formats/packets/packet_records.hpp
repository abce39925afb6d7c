// SPDX-License-Identifier: GPL-3.0-or-later
// Packets of a network, or of a CAN bus, as records: UDP datagrams to and from a board's port, frames of boards on a
// bus, and what PcapngSink has made. Whatever else is in a capture is passed over, but a capture in which nothing is
// found is refused with what there is instead.
//
// A packet that passed two interfaces of the capturing computer (tcpdump -i any) is told once.
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

// What a capture tells of an interface.
struct PacketInterface {
  std::uint32_t number = 0;  // in the file, whatever its section
  std::uint16_t link_type = 0;
  std::string name;         // "can0"; empty: not told
  std::string description;  // by which r4 knows its own
};

struct Packet {
  Time time{0};
  std::uint64_t offset = 0;  // in the file
  std::string_view bytes;
  bool cut = false;  // more of it was there than was captured
};

class PacketRecords {
 public:
  // `name`: what errors are about; `port`: of the boards.
  PacketRecords(RecordingVisitor& visitor, std::string name, std::uint16_t port)
      : visitor_(visitor),
        name_(std::move(name)),
        lines_(visitor, name_),
        bus_(visitor),
        port_(port) {}

  // Throws Error{data} for recordings that are mixed.
  void on_packet(const PacketInterface& interface, const Packet& packet);
  // A packet could not be read.
  void on_damage() { lines_.on_damage(); }
  // No more packets come. Throws Error{data} if nothing of a board was found, unless damage may be why.
  void finish(bool any_damage);

 private:
  struct Udp {
    std::string from, to;  // addresses as in a URL
    std::uint16_t from_port = 0, to_port = 0;
    std::uint16_t id = 0;  // of the IPv4 packet; 0: it has none
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
  std::optional<ByteOrder>
      cooked_order_;           // of the ids of CAN frames in cooked captures, as far as is known
  std::array<Seen, 64> seen_;  // the newest datagrams, to find repeated ones
  std::size_t next_seen_ = 0;
  // What there is, for the error when nothing is found.
  bool told_ = false;
  Kind kind_ = Kind::none;
  std::uint64_t packets_ = 0;
  std::map<std::uint16_t, std::uint64_t> unread_links_, ports_;  // and how many packets each has
};

}  // namespace r4::tool
