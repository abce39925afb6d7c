// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/recordings/recorded_states.hpp"

#include "r4link/messages/message.hpp"

namespace r4 {

const State* RecordedStates::take(const Record& record) {
  if (record.kind != RecordKind::from_board || !read_datagram(Text(record.bytes), datagram_) ||
      kind_of(datagram_) != MessageKind::state) {
    return nullptr;
  }
  State& state = states_[record.path];
  return read_state(datagram_, state) ? &state : nullptr;
}

}  // namespace r4
