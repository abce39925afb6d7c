// SPDX-License-Identifier: GPL-3.0-or-later
// The things that a person can distinguish, and their signals in a wiring. The parts of a motor,
// such as pwm and direction, are consecutive kinds of signals.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "r4link/wiring/wiring.hpp"

namespace r4::commissioning {

struct Thing {
  SignalKind first;  // its first signal
  int channel;       // from 1
  int signal() const { return signal_index(first, channel); }
  friend bool operator==(const Thing&, const Thing&) = default;
};
std::string name_of(Thing thing);
// The thing of a signal. `signal`: an index in Wiring.
Thing thing_of(int signal);
int parts_of(SignalKind first);
// The things that can be exchanged with each other: of one kind, or motors on H-bridges.
std::vector<Thing> alike(SignalKind first);

}  // namespace r4::commissioning
