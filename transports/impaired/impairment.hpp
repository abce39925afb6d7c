// SPDX-License-Identifier: GPL-3.0-or-later
// A deliberately bad link. Its effects depend only on seed, datagrams and their times. No I/O.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <string_view>

#include "r4link/link.hpp"

namespace r4 {

struct Impairment {
  // Shares of the datagrams of each direction, 0-1.
  double loss = 0;
  double duplicate = 0;
  double corrupt = 0;  // a bit is flipped
  // A datagram takes `delay` ± `jitter`, evenly distributed, so datagrams overtake each other.
  Time delay{0};
  Time jitter{0};
  // Nothing passes for `cut_for`, from `cut_at` after the link was opened.
  Time cut_at{0};
  Time cut_for{0};
  std::uint64_t seed = 1;

  // "loss=5%,delay=20ms±10,corrupt=0.1%,cut=10s+2s,seed=7"; +- also means ±. Throws Error{usage}.
  static Impairment parse(std::string_view text);
};

struct ImpairmentCounters {
  std::uint64_t passed = 0;  // passed datagrams, with duplicates
  std::uint64_t lost = 0;
  std::uint64_t duplicated = 0;
  std::uint64_t corrupted = 0;
  std::uint64_t cut = 0;
  std::uint64_t overflow = 0;  // dropped because too many datagrams were on their way
};

class ImpairedDirection {
 public:
  static constexpr std::size_t most_on_their_way = 4096;
  struct Item {
    std::string bytes;
    std::uint32_t peer = 0;
    std::uint8_t priority = 0;
  };

  // `stream`: different for each direction. `opened`: when the link was opened.
  ImpairedDirection(const Impairment& impairment, std::uint64_t stream, Time opened);

  void put(Time now, Item item);
  std::optional<Time> due() const;
  std::optional<Item> take(Time now);
  const ImpairmentCounters& counters() const { return counters_; }

 private:
  bool happens(double chance);
  void send_off(Time now, Item item);

  const Impairment impairment_;
  const Time opened_;
  std::mt19937_64 random_;
  std::multimap<Time, Item> on_their_way_;
  ImpairmentCounters counters_;
};

}  // namespace r4
