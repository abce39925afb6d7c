// SPDX-License-Identifier: GPL-3.0-or-later
// What people call the wires of a recording.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "host/recording/record.hpp"

namespace r4::tool {

class WireNames {
 public:
  // A wire tells the board's name once that is known, which is not forgotten then.
  void on_wire(const RecordedWire& wire) {
    Wire& known = wires_[wire.number];
    if (known.url == wire.url && wire.name.empty()) return;
    known = {wire.url, wire.name.empty() ? wire.url : wire.name};
  }
  // The name of the board there, else how it is reached; empty if neither was told.
  const std::string& of(std::uint16_t number) const {
    static const std::string none;
    const auto known = wires_.find(number);
    return known == wires_.end() ? none : known->second.name;
  }

 private:
  struct Wire {
    std::string url, name;
  };
  std::unordered_map<std::uint16_t, Wire> wires_;
};

}  // namespace r4::tool
