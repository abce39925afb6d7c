// SPDX-License-Identifier: GPL-3.0-or-later
// A queue of whole datagrams, each with a note, between two threads: no locks, no waits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "../../../port.hpp"
#include "../../byte_ring.hpp"
#include "r4link/datagram.hpp"

namespace r4 {
namespace giga {

struct DatagramNote {
  std::uint32_t peer = everyone;
  std::uint32_t time_ms = 0;
  Priority priority = Priority::normal;
};

template <std::uint32_t capacity>
class DatagramRing {
 public:
  static constexpr std::uint32_t overhead = 12;  // bytes beside the datagram's text

  // False if the datagram is too long, or less than `keep_free` bytes would stay free.
  bool put(const DatagramNote& note, Text datagram, std::uint32_t keep_free = 0) {
    if (datagram.size() > max_datagram) return false;
    const std::uint32_t size = overhead + static_cast<std::uint32_t>(datagram.size());
    if (bytes_.room() < size + keep_free) return false;
    Head head;
    head.peer = note.peer;
    head.time_ms = note.time_ms;
    head.priority = static_cast<std::uint16_t>(note.priority);
    head.size = static_cast<std::uint16_t>(datagram.size());
    char flat[overhead + max_datagram];
    std::memcpy(flat, &head, overhead);
    std::memcpy(flat + overhead, datagram.data(), datagram.size());
    return bytes_.put(flat, size);
  }

  // Takes the oldest datagram; its text is in `buffer`. False: none.
  bool take(DatagramNote& note, char (&buffer)[max_datagram], Text& datagram) {
    Head head;
    char flat[sizeof head];
    if (bytes_.take(flat, sizeof flat) == 0) return false;  // a datagram is put as a whole
    std::memcpy(&head, flat, sizeof head);
    bytes_.take(buffer, head.size);
    note.peer = head.peer;
    note.time_ms = head.time_ms;
    note.priority = static_cast<Priority>(head.priority);
    datagram = Text(buffer, head.size);
    return true;
  }

  bool empty() const { return bytes_.empty(); }

 private:
  struct Head {
    std::uint32_t peer;
    std::uint32_t time_ms;
    std::uint16_t priority;
    std::uint16_t size;
  };
  static_assert(sizeof(Head) == overhead, "as it is copied");

  firmware::ByteRing<capacity> bytes_;
};

}  // namespace giga
}  // namespace r4
