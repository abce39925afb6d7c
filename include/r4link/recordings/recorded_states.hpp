// SPDX-License-Identifier: GPL-3.0-or-later
// The states in a recording's datagrams. A missing field keeps the path's older value.
#pragma once

#include <cstdint>
#include <map>

#include "../config.hpp"
#include "../datagram.hpp"
#include "../state.hpp"
#include "record.hpp"

namespace r4 {

class R4LINK_API RecordedStates {
 public:
  // The state, with older fields of its path; nullptr: not a state. Valid until the next call.
  const State* take(const Record& record);
  // The datagram of the last take(). Valid as long as the record.
  const Datagram& datagram() const { return datagram_; }
  // Call clear() in on_header(), because path numbers may have another meaning.
  void clear() { states_.clear(); }

 private:
  Datagram datagram_;
  std::map<std::uint16_t, State> states_;
};

}  // namespace r4
