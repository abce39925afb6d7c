// SPDX-License-Identifier: GPL-3.0-or-later
#include "control.hpp"

namespace r4::tool::web {

bool Control::take(Client client, Time now) {
  if (is_held_by(client)) return true;
  if (holder_ || leaving_) return false;
  holder_ = client;
  last_ = now;
  return true;
}

bool Control::release(Client client) {
  if (!is_held_by(client)) return false;
  holder_.reset();
  leaving_ = true;
  return true;
}

bool Control::alive(Client client, Time echoed, Time now) {
  if (!is_held_by(client) || echoed > now || echoed <= last_) return false;
  last_ = echoed;
  return true;
}

std::optional<Control::Time> Control::deadline() const {
  return holder_ ? std::optional(last_ + limit) : std::nullopt;
}

}  // namespace r4::tool::web
