// SPDX-License-Identifier: GPL-3.0-or-later
// Reads .pcapng and .pcap: captures of UDP or SocketCAN, and PcapngSink's recordings. After damage,
// pcapng continues with the next block; the rest of a pcap file cannot be read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "../byte_order.hpp"
#include "../conversion.hpp"
#include "packet_records.hpp"
#include "packets.hpp"

namespace r4::tool {

class PcapSource final : public Source {
 public:
  PcapSource(RecordingVisitor& visitor, std::string name, std::uint16_t port = board_port)
      : visitor_(visitor), records_(visitor, name, port), name_(std::move(name)) {}
  void feed(std::string_view bytes) override;
  void finish() override;

 private:
  enum class Form : std::uint8_t {
    unknown,
    pcapng,
    pcap,
    broken
  };  // broken: the rest cannot be read
  struct Interface : PacketInterface {
    std::uint64_t ticks = 1'000'000;  // ticks per second
    std::int64_t offset_s = 0;
  };

  void take(bool at_end);
  void begin(std::string_view bytes);
  std::size_t take_block(std::string_view bytes, bool at_end);
  std::size_t take_pcap_packet(std::string_view bytes, bool at_end);
  std::size_t damaged_block(std::string_view reason);
  void on_block(std::uint32_t type, std::string_view body);
  void on_interface(std::string_view body);
  void on_pcapng_packet(std::string_view body);
  void on_old_packet(std::string_view body);
  void on_packet_of(std::uint32_t index, std::string_view body);
  void damage(std::string_view reason);
  template <class Number>
  Number number(std::string_view bytes, std::size_t at) const {
    return read_number<Number>(bytes.substr(at), order_);
  }
  static Time time_of(const Interface& interface, std::uint64_t ticks);

  RecordingVisitor& visitor_;
  PacketRecords records_;
  const std::string name_;
  Form form_ = Form::unknown;
  ByteOrder order_ = ByteOrder::little;
  std::string waiting_;
  std::uint64_t offset_ = 0;  // position of waiting_ in the file
  bool searching_ = false;    // looking for the next block after damage
  std::vector<Interface> interfaces_;
  std::uint32_t interface_count_ = 0;
  bool any_damage_ = false;
};

}  // namespace r4::tool
