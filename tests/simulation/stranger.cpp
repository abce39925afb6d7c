// SPDX-License-Identifier: GPL-3.0-or-later
#include "stranger.hpp"

#include <fmt/format.h>

#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::simulation {
namespace {

// The field with this name, its value and its end. Empty if there is no such field.
std::string_view field_in(std::string_view bytes, std::string_view name) {
  for (std::size_t at = bytes.find(name); at != std::string_view::npos;
       at = bytes.find(name, at + 1)) {
    const std::size_t end = bytes.find(';', at);
    if (end != std::string_view::npos && (at == 0 || bytes[at - 1] == ';')) {
      return bytes.substr(at, end + 1 - at);
    }
  }
  return {};
}

}  // namespace

void Stranger::hears(std::string_view bytes) {
  if (const std::string_view id = field_in(bytes, "SID:"); !id.empty()) name_ = id;
  if (const std::string_view cause = field_in(bytes, "CAUSE:"); !cause.empty()) {
    cause_ = static_cast<std::int32_t>(std::stol(std::string(cause.substr(6))));
  }
  Datagram datagram;
  if (!read_datagram(Text(bytes), datagram)) return;
  switch (kind_of(datagram)) {
    case MessageKind::board_heartbeat:
      if (!is_connecting_heartbeat(datagram)) {
        echo_ = static_cast<std::uint32_t>(datagram.time_ms());
      }
      break;
    case MessageKind::nack: {
      Nack nack;
      if (read_nack(datagram, nack) && nack.lease != 0) lease_ = nack.lease;
      break;
    }
    case MessageKind::state: {
      const std::string_view number = field_in(bytes, "CMD:");
      if (!number.empty()) {
        command_ = static_cast<std::uint32_t>(std::stoul(std::string(number.substr(4))));
      }
      break;
    }
    default:
      break;
  }
}

std::string Stranger::say(Random& random, std::uint32_t next) {
  std::string field = "H:ROS2-R4";
  switch (random.below(8)) {
    case 0:
      field = "E:LEAVE";
      break;
    case 1:
      field = fmt::format("E:CLEAR,{}", cause_);
      break;
    case 2:
    case 3:
      field = fmt::format("P:{},1000,1", target);
      break;
    default:
      break;
  }
  std::string name;  // the SID field; empty for a paper host
  switch (random.below(4)) {
    case 0:
      name = own_name;
      break;
    case 1:
      name = name_;
      break;
    case 2:
      name = fmt::format("SID:{:016x};", random.next() | 1U);
      break;
    default:
      break;
  }
  const bool guesses = random.chance(0.5);
  const std::uint32_t pnum =
      guesses ? guess(next) + static_cast<std::uint32_t>(random.below(40)) : ++own_pnum_;
  const bool numbered = !name.empty() || random.chance(0.9);
  const std::string number = numbered ? fmt::format("PNum:{};", pnum) : "";
  std::uint64_t t = echo_;
  if (random.chance(0.1)) t = 0;
  if (random.chance(0.1)) t -= random.below(2000);
  if (random.chance(0.1)) t = random.next() >> 24;  // another clock
  return test::with_crc(fmt::format("{};{}{}T:{};", field, name, number, t));
}

std::uint32_t Stranger::guess(std::uint32_t next) const {
  const bool near = command_ != 0 && next - command_ <= most_guesses;
  return near ? next : command_ + 1;
}

}  // namespace r4::simulation
