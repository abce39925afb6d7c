// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <string>

#include "check_functions.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4::commissioning {
namespace {

using namespace std::chrono_literals;

int chip_at(const Wiring& wiring, std::uint8_t address) {
  for (int i = signals::osmc_chip; i <= signals::dac_chip; ++i) {
    if (wiring.places[i].connected() && wiring.places[i].number() == address) return i;
  }
  return signals::count;
}

void find_chip(Checking& c, std::uint8_t address) {
  const int chip = chip_at(c.report.wiring, address);
  const std::string thing = chip == signals::count ? chip_name(address) : signal_name(chip);
  const double seen =
      c.number(Topic::address_seen,
               fmt::format("{} does not answer at {:#04x}. The line `report` in a serial monitor "
                           "lists the addresses that answer (docs/how-to/firmware.md). Which "
                           "address answers, but is not the address of another chip? 0: none.",
                           thing, address),
               "address");
  const auto at = static_cast<std::uint8_t>(std::lround(seen));
  if (at == 0 || at == address) return c.found_at(thing, Finding::chip_absent);
  c.found_at(thing, Finding::chip_at_another_address, fmt::format("{:#04x}", at));
  if (chip != signals::count) c.learnt({Learnt::What::place, chip, 0, Place{at}, 1});
}

}  // namespace

void check_identity(Checking& c, int) {
  const Report& report = c.report;
  if (report.board_id.empty()) {
    Checking::give_up(Status::unsupported,
                      "the board does not report its identity: it runs the paper's firmware");
  }
  c.note(fmt::format("{}, firmware {}, {}", report.board_id, report.firmware, report.capabilities));
}

void check_settings(Checking& c, int) {
  if (c.report.wiring_source.empty()) {
    Checking::give_up(Status::unsupported, "the board accepts a wiring and settings over USB only");
  }
  if (c.report.wiring_source == to_text(WiringSource::damaged)) {
    return c.found(Finding::wiring_damaged);
  }
  if (c.report.wiring_source == to_text(WiringSource::plan)) {
    return c.note("the board has no stored wiring yet, so it uses the plan");
  }
  c.say("This check shows whether the board keeps its settings over a restart.");
  const BoardWiring kept = c.wiring_after_restart();
  if (kept.source != WiringSource::given || kept.wiring != c.report.wiring) {
    c.found(Finding::not_kept);
  }
}

void check_chips(Checking& c, int) {
  LinkStatus link = c.board.link();
  if (link.reason == SafeReason::fault && link.chip.trouble == ChipTrouble::not_confirmed) {
    c.make_ready();  // this fault hides the faults of the chips
    link = c.board.link();
  }
  if (link.reason != SafeReason::fault || !link.chip.any()) return;
  switch (link.chip.trouble) {
    case ChipTrouble::no_acknowledge:
      return find_chip(c, link.chip.address);
    case ChipTrouble::other_bus: {
      const Place named = c.report.wiring.at(SignalKind::chip_bus);
      const Place other{static_cast<std::uint8_t>(1 - named.number())};
      c.found_at("chip bus", Finding::chips_on_the_other_bus, place_name(signals::chip_bus, other));
      return c.learnt({Learnt::What::place, signals::chip_bus, 0, other, 1});
    }
    case ChipTrouble::damaged:
      return c.found(Finding::wiring_damaged);
    default:
      c.found_at(chip_name(link.chip.address), Finding::chip_in_trouble,
                 to_text(link.chip.trouble));
  }
}

void check_user_bus(Checking& c, int) {
  try {
    const auto addresses = c.board.scan();
    c.measured("devices", static_cast<double>(addresses.size()), "");
    std::string list;
    for (const std::uint8_t each : addresses) list += fmt::format(" {:#04x}", each);
    c.note(list.empty() ? "no address answers" : "addresses" + list);
  } catch (const Error& error) {
    if (error.outcome() != Outcome::refused) throw;
    if (error.refusal() == Refusal::unknown || error.refusal() == Refusal::auth) {
      Checking::give_up(Status::unsupported, "this board does not offer a bus to its user");
    }
    c.found(Finding::user_bus_stuck, error.problem().reason);
  }
}

void check_uart(Checking& c, int channel) {
  const double baud = c.number(
      Topic::baud,
      fmt::format("At how many baud does the device at UART {} send? 0: no device is connected.",
                  channel),
      "baud");
  if (baud < uart_min_baud || baud > uart_max_baud) {
    Checking::give_up(Status::skipped, "nothing is connected");
  }
  const std::string key = fmt::format("uart{}", channel);
  const std::string value = fmt::format("{:.0f}:8N1", baud);
  c.send(Command::setting(Text(key), Text(value)));
  c.select_fields(fmt::format("UART{}", channel));
  c.collect(100ms);
  c.board.forget_states();
  const auto states = c.collect(2s);
  c.send(Command::setting(Text(key), Text("off")));
  const UartBytes& first = states.front().raw.uart[channel - 1];
  const UartBytes& last = states.back().raw.uart[channel - 1];
  const std::uint32_t bytes = last.position + last.data.size - first.position;
  const std::uint32_t lost = last.lost - first.lost;
  c.measured("bytes", bytes, "in 2 s");
  c.measured("damaged", lost, "in 2 s");
  if (lost > bytes / 10) return c.found(Finding::uart_damaged);
  if (bytes == 0) c.found(Finding::uart_silent);
}

}  // namespace r4::commissioning
