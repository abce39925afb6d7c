// SPDX-License-Identifier: GPL-3.0-or-later
// The 11-bit ids on the bus (docs/reference/can.md). The lower id wins.
//     0x010    emergency stop from a host   one raw frame, any content, obeyed by every board; with
//                                           29 bits, the same with a number for its confirmation
//     0x020+n  board n went safe            one raw frame: the reason
//     0x180+n  host to board n              ISO-TP; the board's flow control on 0x200+n
//     0x200+n  board n's replies            ISO-TP; the host's flow control on 0x180+n
//     0x400+n  board n's telemetry          ISO-TP without flow control: any number may listen
//     0x600+n  a watcher of board n         one raw frame, any content, the same from every watcher
//
// n, the node, is 0–31. Every other id is `other`.
#pragma once

#include <cstdint>

#include "can_frame.hpp"

namespace r4 {

constexpr std::uint32_t can_nodes = 32;

// `node` must be below can_nodes; higher bits are ignored.
constexpr std::uint32_t emergency_stop_id = 0x010;
// The number of a stop is in the 18 low bits of a 29-bit id, after 0x010. If the number were in the
// data, simultaneous stops with one id and different data would destroy each other for ever.
constexpr std::uint32_t short_stop_number(std::uint32_t number) { return number & 0x3FFFF; }
constexpr std::uint32_t numbered_stop_id(std::uint32_t number) {
  return emergency_stop_id << 18 | short_stop_number(number);
}
constexpr std::uint32_t went_safe_id(std::uint32_t node) { return 0x020 | (node % can_nodes); }
constexpr std::uint32_t command_id(std::uint32_t node) { return 0x180 | (node % can_nodes); }
constexpr std::uint32_t reply_id(std::uint32_t node) { return 0x200 | (node % can_nodes); }
constexpr std::uint32_t telemetry_id(std::uint32_t node) { return 0x400 | (node % can_nodes); }
// Differs from command_id(), because a watcher's frame would destroy a host's simultaneous frames.
constexpr std::uint32_t watch_id(std::uint32_t node) { return 0x600 | (node % can_nodes); }

enum class CanIdKind : std::uint8_t {
  other,
  emergency_stop,
  went_safe,
  command,
  reply,
  telemetry,
  watch,
};

struct CanIdMeaning {
  CanIdKind kind = CanIdKind::other;
  std::uint8_t node = 0;  // 0 if the kind has no node
};

// `id`: 11 bits.
constexpr CanIdMeaning classify(std::uint32_t id) {
  CanIdMeaning meaning;
  const std::uint32_t node = id % can_nodes;
  if (id == emergency_stop_id) {
    meaning.kind = CanIdKind::emergency_stop;
  } else if (id == went_safe_id(node)) {
    meaning.kind = CanIdKind::went_safe;
  } else if (id == command_id(node)) {
    meaning.kind = CanIdKind::command;
  } else if (id == reply_id(node)) {
    meaning.kind = CanIdKind::reply;
  } else if (id == telemetry_id(node)) {
    meaning.kind = CanIdKind::telemetry;
  } else if (id == watch_id(node)) {
    meaning.kind = CanIdKind::watch;
  }
  if (meaning.kind != CanIdKind::other && meaning.kind != CanIdKind::emergency_stop) {
    meaning.node = static_cast<std::uint8_t>(node);
  }
  return meaning;
}

// Remote requests, and 29-bit ids except stops, are `other`.
constexpr CanIdMeaning classify(const CanFrame& frame) {
  if (frame.remote) return CanIdMeaning();
  if (!frame.extended) return classify(frame.id);
  CanIdMeaning meaning;
  if (frame.id >> 18 == emergency_stop_id) meaning.kind = CanIdKind::emergency_stop;
  return meaning;
}

}  // namespace r4
