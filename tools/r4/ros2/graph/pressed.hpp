// SPDX-License-Identifier: GPL-3.0-or-later
// Who has said `true` and not `false` since: a button that is pressed counts once, however often it is said. Whoever
// is out of reach for a while and comes back has not let go. The newest 256 are remembered.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "entity.hpp"

namespace r4::tool::ros2 {

class Pressed {
 public:
  // True if it is pressed now and was not before.
  bool on(const EntityId& who, bool pressed) {
    const bool was = std::erase(pressed_, who) != 0;
    if (!pressed) return false;
    if (pressed_.size() == most) pressed_.erase(pressed_.begin());
    pressed_.push_back(who);
    return !was;
  }

  static constexpr std::size_t most = 256;

 private:
  std::vector<EntityId> pressed_;  // the newest last
};

}  // namespace r4::tool::ros2
