// SPDX-License-Identifier: GPL-3.0-or-later
#include "things.hpp"

#include <string_view>

#include "r4link/commissioning/report.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4::commissioning {
namespace {

std::string group_of(SignalKind kind) {
  const std::string name = signal_name(row_of(kind).first);
  return name.substr(0, name.find(' '));
}

void add_channels(SignalKind first, std::vector<Thing>& things) {
  for (int i = 1; i <= row_of(first).channels; ++i) things.push_back({first, i});
}

}  // namespace

std::string name_of(Thing thing) {
  std::string name = group_of(thing.first);
  if (row_of(thing.first).channels > 1) name += " " + std::to_string(thing.channel);
  return name;
}

Thing thing_of(int signal) {
  const SignalKind kind = signal_kind(signal);
  return {kind, signal - row_of(kind).first + 1};
}

int parts_of(SignalKind first) {
  int parts = 1;
  const int kind = static_cast<int>(first);
  while (kind + parts < signal_kind_count &&
         group_of(static_cast<SignalKind>(kind + parts)) == group_of(first)) {
    ++parts;
  }
  return parts;
}

std::vector<Thing> alike(SignalKind first) {
  std::vector<Thing> things;
  if (row_of(first).terminal == Terminal::drive_line) {
    add_channels(SignalKind::osmc_pwm, things);
    add_channels(SignalKind::dhb12_pwm, things);
  } else {
    add_channels(first, things);
  }
  return things;
}

Wiring learnt_wiring(const Report& report) {
  Wiring old = report.wiring;
  for (const CheckResult& check : report.checks) {
    for (const Learnt& learnt : check.learnt) {
      Place& place = old.places[learnt.signal];
      if (learnt.what == Learnt::What::option) place.byte ^= Place::option_bit;
      if (learnt.what == Learnt::What::place) place = learnt.place;
    }
  }
  Wiring wiring = old;
  for (const CheckResult& check : report.checks) {
    for (const Learnt& learnt : check.learnt) {
      if (learnt.what != Learnt::What::serves) continue;
      const Thing from = thing_of(learnt.signal);
      const Thing to = thing_of(learnt.other);
      for (int part = 0; part < parts_of(from.first); ++part) {
        const auto kind = [part](SignalKind first) {
          return static_cast<SignalKind>(static_cast<int>(first) + part);
        };
        wiring.at(kind(to.first), to.channel) = old.at(kind(from.first), from.channel);
      }
    }
  }
  return wiring;
}

}  // namespace r4::commissioning
