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
    known = {wire.url, wire.name};
  }
  // The name of the board there, and how it is reached; empty if that was not told.
  const std::string& name_of(std::uint16_t number) const { return wire_of(number).name; }
  const std::string& url_of(std::uint16_t number) const { return wire_of(number).url; }
  // The one, or else the other.
  const std::string& of(std::uint16_t number) const {
    const Wire& wire = wire_of(number);
    return wire.name.empty() ? wire.url : wire.name;
  }

 private:
  struct Wire {
    std::string url, name;
  };
  const Wire& wire_of(std::uint16_t number) const {
    static const Wire none;
    const auto known = wires_.find(number);
    return known == wires_.end() ? none : known->second;
  }
  std::unordered_map<std::uint16_t, Wire> wires_;
};

}  // namespace r4::tool
