// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers for the hosts that send valid datagrams to a board over UDP. If no place is free, a new
// host replaces the host that was silent longest. The controlling host keeps its place, because the
// board recognizes the host by its number. Datagrams for everyone go to one sender, the audience,
// which is the controlling host if there is one. A watcher never becomes the audience, because its
// lease brings it all datagrams. A number is never given twice.
#pragma once

#include <cstdint>

#include "r4link/datagram.hpp"

namespace r4 {

template <class Address, int places>
class PeerTable {
 public:
  static constexpr int capacity = places;
  static constexpr std::uint32_t nobody = 0;

  std::uint32_t heard(const Address& from, Text bytes) {
    Datagram datagram;
    if (!read_datagram(bytes, datagram)) return nobody;
    const bool one = datagram.command_count() == 1;
    const Text name = datagram.command().name();
    return heard(from, one && name == "W"   ? Says::watch
                       : one && name == "H" ? Says::heartbeat
                                            : Says::other);
  }
  // The number of the sender of a valid datagram that is not a W.
  std::uint32_t heard(const Address& from) { return heard(from, Says::other); }

  // True if the sender of that number has requested to watch, and has sent no heartbeat since.
  bool watches(std::uint32_t number) const {
    for (const Entry& entry : entries_) {
      if (number != nobody && entry.number == number) return entry.watches;
    }
    return false;
  }

  // Host `number` has control and keeps its place. `nobody`: the controlling host lost control, and
  // may regain it.
  void hold(std::uint32_t number) {
    in_control_ = number != nobody;
    if (!in_control_) return;
    audience_ = held_[0] = number;
    held_count_ = 1;
  }
  // The controlling host also sends from the address of that number.
  void also_hold(std::uint32_t number) {
    if (!in_control_ || number == nobody || held_count_ == most_held || is_held(number)) return;
    held_[held_count_++] = number;
  }

  const Address* find(std::uint32_t number) const {
    for (const Entry& entry : entries_) {
      if (number != nobody && entry.number == number) return &entry.address;
    }
    return nullptr;
  }
  // The controlling host, else the newest sender that does not watch; `nobody` if there is none.
  std::uint32_t audience() const { return audience_; }

 private:
  struct Entry {
    Address address = Address();
    std::uint32_t number = nobody;  // nobody: free
    bool watches = false;
    std::uint64_t heard = 0;  // turn_ at the host's newest datagram
  };
  enum class Says : std::uint8_t { other, watch, heartbeat };

  std::uint32_t heard(const Address& from, Says says) {
    Entry* place = nullptr;
    for (Entry& entry : entries_) {
      if (entry.number != nobody && entry.address == from) place = &entry;
    }
    if (place == nullptr) {
      place = &place_for_new();
      place->address = from;
      place->watches = false;
      if (++given_ == nobody) ++given_;
      place->number = given_;
    }
    place->heard = ++turn_;
    const bool controls = in_control_ && is_held(place->number);
    if (says != Says::other) place->watches = says == Says::watch && !controls;
    if (controls || (!in_control_ && !place->watches)) audience_ = place->number;
    return place->number;
  }

  bool is_held(std::uint32_t number) const {
    for (int i = 0; i < held_count_; ++i) {
      if (held_[i] == number) return true;
    }
    return false;
  }

  Entry& place_for_new() {
    Entry* silent = nullptr;
    for (Entry& entry : entries_) {
      if (entry.number == nobody) return entry;
      if (is_held(entry.number)) continue;
      if (silent == nullptr || entry.heard < silent->heard) silent = &entry;
    }
    return *silent;
  }

  static constexpr int most_held = 4;  // as many paths as a session has
  static_assert(places > most_held, "all but these may be taken");
  Entry entries_[places];
  std::uint64_t turn_ = 0;
  std::uint32_t given_ = nobody;
  std::uint32_t audience_ = nobody;
  std::uint32_t held_[most_held] = {};
  int held_count_ = 0;
  bool in_control_ = false;  // true if the held host has control
};

}  // namespace r4
