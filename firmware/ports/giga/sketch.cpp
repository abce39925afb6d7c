// SPDX-License-Identifier: GPL-3.0-or-later
#include "sketch.hpp"

#include "chip/timers.hpp"
#include "system.hpp"

r4::giga::Sketch R4Link;  // NOLINT

namespace r4 {
namespace giga {

namespace {

System* running = nullptr;  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

}  // namespace

void Sketch::begin() {
  if (running != nullptr) return;
  static System system;
  running = &system;
  system.boot();
}

void Sketch::poll() {
  running->poll();
  rest();
}

}  // namespace giga
}  // namespace r4
