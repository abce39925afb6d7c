// SPDX-License-Identifier: GPL-3.0-or-later
// Publishers whose last message was `true`. A pressed button counts once, even if repeated. A
// publisher that was unreachable has not released its button. Remembers the newest 256 publishers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "entity.hpp"

namespace r4::tool::ros2 {

class Pressed {
 public:
  bool on(const EntityId& who, bool pressed) {
    const bool was = std::erase(pressed_, who) != 0;
    if (!pressed) return false;
    if (pressed_.size() == most) pressed_.erase(pressed_.begin());
    pressed_.push_back(who);
    return !was;
  }

  static constexpr std::size_t most = 256;

 private:
  std::vector<EntityId> pressed_;
};

}  // namespace r4::tool::ros2
