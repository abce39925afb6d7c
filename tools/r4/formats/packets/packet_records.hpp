// SPDX-License-Identifier: GPL-3.0-or-later
// Packets of a network, or of a CAN bus, as records: UDP datagrams to and from a board's port, frames of boards on a
// bus, and what PcapngSink has made. Whatever else is in a capture is passed over.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "../../bus/bus_transfers.hpp"
#include "../bus_records.hpp"
#include "host/recording/recording_reader.hpp"

namespace r4::tool {

// What a capture tells of an interface.
struct PacketInterface {
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
  // `port`: of the boards.
  PacketRecords(RecordingReader::Handler& handler, std::uint16_t port)
      : handler_(handler), bus_(handler), port_(port) {}

  void on_packet(const PacketInterface& interface, const Packet& packet);
  // No more come.
  void finish() { bus_.finish(); }

 private:
  struct Udp {
    std::string from, to;  // addresses as in a URL
    std::uint16_t from_port = 0, to_port = 0;
    std::string_view payload;
    bool cut = false;
  };
  static bool read_ip(std::string_view bytes, Udp& out);
  void on_line(const Packet& packet);
  void on_own(std::string_view wire, const Packet& packet);
  void on_ip(std::string_view bytes, const Packet& packet);
  void on_can(std::string_view interface, std::string_view bytes, const Packet& packet);
  void on_protocol(std::uint16_t protocol, std::string_view bytes, std::string_view interface,
                   const Packet& packet);
  std::uint16_t wire_of(const std::string& address);
  void damage(const Packet& packet, std::string_view reason);

  RecordingReader::Handler& handler_;
  BusRecords bus_;
  const std::uint16_t port_;
  std::map<std::string, std::uint16_t> wires_;
  RecordLine line_;
};

}  // namespace r4::tool
