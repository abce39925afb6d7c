// SPDX-License-Identifier: GPL-3.0-or-later
#include "pcap_source.hpp"

#include <algorithm>

#include "r4link/error.hpp"

namespace r4::tool {
namespace {

constexpr std::uint32_t pcap_us = 0xA1B2C3D4;
constexpr std::uint32_t pcap_ns = 0xA1B23C4D;
constexpr std::size_t pcap_header = 24;
constexpr std::size_t pcap_packet_header = 16;
constexpr std::size_t block_ends = 12;  // type, size, and the repeated size
constexpr std::size_t packet_head = 20;
constexpr std::size_t most_interfaces = 70'000;

// True for the block types at which reading continues after a damaged block.
bool is_known_block(std::uint32_t type) {
  return type == pcapng_section || (type >= pcapng_interface && type <= 0x0A);
}

}  // namespace

void PcapSource::feed(std::string_view bytes) {
  if (form_ == Form::broken) return;
  waiting_ += bytes;
  take(false);
}

void PcapSource::finish() {
  take(true);
  if (form_ == Form::unknown) {
    throw Error(ErrorKind::data, name_, "is not a capture of packets",
                "make one: tcpdump -w FILE udp port 2018");
  }
  records_.finish(any_damage_);
}

void PcapSource::take(bool at_end) {
  std::string_view rest = waiting_;
  while (!rest.empty() && form_ != Form::broken) {
    std::size_t taken = 0;
    if (form_ == Form::unknown) {
      if (rest.size() < pcap_header) break;
      begin(rest);
      taken = form_ == Form::pcap ? pcap_header : 0;
      offset_ += taken;
      rest.remove_prefix(taken);
      continue;
    }
    taken = form_ == Form::pcap ? take_pcap_packet(rest, at_end) : take_block(rest, at_end);
    if (taken == 0) break;
    taken = std::min(taken, rest.size());
    offset_ += taken;
    rest.remove_prefix(taken);
  }
  waiting_.erase(0, waiting_.size() - rest.size());
}

void PcapSource::begin(std::string_view bytes) {
  for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
    order_ = order;
    const auto magic = number<std::uint32_t>(bytes, 0);
    if (magic == pcap_us || magic == pcap_ns) {
      form_ = Form::pcap;
      Interface interface;
      // The upper two of the four bytes are the length of the frame checksum.
      interface.link_type = static_cast<std::uint16_t>(number<std::uint32_t>(bytes, 20));
      if (magic == pcap_ns) interface.ticks = 1'000'000'000;
      interfaces_.push_back(interface);
      return;
    }
    if (magic == pcapng_section && number<std::uint32_t>(bytes, 8) == pcapng_magic) {
      form_ = Form::pcapng;
      return;
    }
  }
  throw Error(ErrorKind::data, name_, "is not a capture of packets",
              "make one: tcpdump -w FILE udp port 2018");
}

// Each take_…() returns the number of bytes taken; 0: more bytes are needed.
std::size_t PcapSource::take_pcap_packet(std::string_view bytes, bool at_end) {
  const bool head = bytes.size() >= pcap_packet_header;
  const std::uint32_t size = head ? number<std::uint32_t>(bytes, 8) : 0;
  if (size > max_block) {
    damage("the length of a packet is not valid, so the rest cannot be read");
    form_ = Form::broken;
    return bytes.size();
  }
  if (!head || bytes.size() < pcap_packet_header + size) {
    if (at_end) damage("the last packet is incomplete");
    return at_end ? bytes.size() : 0;
  }
  const Interface& interface = interfaces_.front();
  const std::uint64_t ticks =
      number<std::uint32_t>(bytes, 0) * interface.ticks + number<std::uint32_t>(bytes, 4);
  records_.on_packet(interface,
                     {time_of(interface, ticks), offset_, bytes.substr(pcap_packet_header, size),
                      number<std::uint32_t>(bytes, 12) > size});
  return pcap_packet_header + size;
}

std::size_t PcapSource::take_block(std::string_view bytes, bool at_end) {
  if (bytes.size() < block_ends + 4) {
    if (!at_end) return 0;
    if (bytes.size() < block_ends) {
      if (!searching_) damage("the last block is incomplete");
      return bytes.size();
    }
  }
  auto type = number<std::uint32_t>(bytes, 0);
  const ByteOrder before = order_;
  if (type == pcapng_section && bytes.size() >= block_ends) {
    order_ = ByteOrder::little;
    if (number<std::uint32_t>(bytes, 8) != pcapng_magic) order_ = ByteOrder::big;
    if (number<std::uint32_t>(bytes, 8) != pcapng_magic) {
      order_ = before;
      return damaged_block("a section without its mark");
    }
  }
  const auto size = number<std::uint32_t>(bytes, 4);
  const bool plausible = size >= block_ends && size % 4 == 0 && size <= max_block &&
                         (!searching_ || is_known_block(type));
  if (!plausible) {
    order_ = before;
    return damaged_block("not a block of pcapng");
  }
  if (bytes.size() < size) {
    order_ = before;
    if (!at_end) return 0;
    return damaged_block("the last block is incomplete");
  }
  if (number<std::uint32_t>(bytes, size - 4) != size) {
    order_ = before;
    return damaged_block("a block whose two sizes differ");
  }
  searching_ = false;
  on_block(type, bytes.substr(8, size - block_ends));
  return size;
}

// Reports once for all skipped bytes. Blocks are aligned to four bytes.
std::size_t PcapSource::damaged_block(std::string_view reason) {
  if (!searching_) damage(reason);
  searching_ = true;
  return 4;
}

void PcapSource::on_block(std::uint32_t type, std::string_view body) {
  if (type == pcapng_section) {
    interfaces_.clear();
  } else if (type == pcapng_interface) {
    on_interface(body);
  } else if (type == pcapng_packet) {
    on_pcapng_packet(body);
  } else if (type == pcapng_old_packet) {
    on_old_packet(body);
  } else if (type == pcapng_simple_packet) {
    damage("a packet without a time");
  }
}

void PcapSource::on_interface(std::string_view body) {
  if (interfaces_.size() == most_interfaces) return damage("more interfaces than r4 reads");
  Interface& interface = interfaces_.emplace_back();
  interface.number = interface_count_++;
  if (body.size() < 8) return damage("an incomplete interface");
  interface.link_type = number<std::uint16_t>(body, 0);
  body.remove_prefix(8);
  while (body.size() >= 4) {
    const auto code = number<std::uint16_t>(body, 0);
    const auto size = number<std::uint16_t>(body, 2);
    if (code == 0 || size > body.size() - 4) break;
    const std::string_view value = body.substr(4, size);
    if (code == pcapng_if_name && size <= max_interface_text) interface.name = value;
    // r4's own descriptions are shorter.
    if (code == pcapng_if_description) interface.description = value.substr(0, 64);
    if (code == pcapng_if_tsoffset && size == 8)
      interface.offset_s = number<std::int64_t>(value, 0);
    if (code == pcapng_if_tsresol && size == 1) {
      const auto power = static_cast<std::uint8_t>(value[0]);
      const bool binary = (power & 0x80) != 0;
      if ((power & 0x7F) > (binary ? 62 : 18)) {
        damage("an interface whose time resolution is not valid");
      } else {
        interface.ticks = 1;
        for (int i = power & 0x7F; i > 0; --i) interface.ticks *= binary ? 2 : 10;
      }
    }
    body.remove_prefix(std::min<std::size_t>(body.size(), 4 + (size + 3U) / 4 * 4));
  }
}

void PcapSource::on_pcapng_packet(std::string_view body) {
  if (body.size() < packet_head) return damage("an incomplete packet");
  on_packet_of(number<std::uint32_t>(body, 0), body);
}

// An obsolete packet block has a 16-bit interface, then a count of dropped packets.
void PcapSource::on_old_packet(std::string_view body) {
  if (body.size() < packet_head) return damage("an incomplete packet");
  on_packet_of(number<std::uint16_t>(body, 0), body);
}

void PcapSource::on_packet_of(std::uint32_t index, std::string_view body) {
  if (index >= interfaces_.size()) return damage("a packet of an unknown interface");
  const std::uint64_t ticks =
      std::uint64_t{number<std::uint32_t>(body, 4)} << 32 | number<std::uint32_t>(body, 8);
  const auto size = number<std::uint32_t>(body, 12);
  if (size > body.size() - packet_head) return damage("an incomplete packet");
  records_.on_packet(interfaces_[index],
                     {time_of(interfaces_[index], ticks), offset_, body.substr(packet_head, size),
                      number<std::uint32_t>(body, 16) > size});
}

// Clamps to the range of times in recordings.
Time PcapSource::time_of(const Interface& interface, std::uint64_t ticks) {
  constexpr std::int64_t last_s = 253'402'300'799;
  constexpr std::uint64_t second_us = 1'000'000;
  const std::uint64_t whole = ticks / interface.ticks;
  const std::uint64_t part = ticks % interface.ticks;
  std::uint64_t part_us = 0;
  if (interface.ticks % second_us == 0) {
    part_us = part / (interface.ticks / second_us);
  } else {  // fewer ticks than microseconds, or a power of 2: halved until the product fits
    int shift = 0;
    while (interface.ticks >> shift > UINT64_MAX / second_us) ++shift;
    part_us = (part >> shift) * second_us / (interface.ticks >> shift);
  }
  const auto us = static_cast<std::int64_t>(part_us);
  const std::int64_t offset_s = std::clamp(interface.offset_s, -last_s, last_s);
  const auto seconds =
      static_cast<std::int64_t>(std::min<std::uint64_t>(whole, std::uint64_t{2} * last_s));
  return Time{std::clamp<std::int64_t>(seconds + offset_s, 0, last_s) * 1'000'000 + us};
}

void PcapSource::damage(std::string_view reason) {
  any_damage_ = true;
  records_.on_damage();
  visitor_.on_damage({RecordingDamage::Kind::line, 0, offset_, reason});
}

}  // namespace r4::tool
