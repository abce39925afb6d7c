// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring.hpp"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <string>
#include <string_view>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/output.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/board.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4::tool {
namespace {

struct WiringOptions {
  std::string action;
  std::string first;
  std::string second;
  bool json = false;
};

constexpr std::chrono::seconds patience{5};

BoardWiring ask(const std::string& url) {
  require_cable(url, "the wiring of a board");
  BoardOptions options;
  options.role = BoardRole::watch;
  return Board(url, options).wiring(patience);
}

void give(const std::string& url, const Wiring& wiring) {
  require_cable(url, "a wiring");
  Board(url).give_wiring(wiring, patience);  // the safe state does not matter
}

Wiring wiring_of(const std::string& source) {
  if (is_url(source)) return ask(source).wiring;
  return source == "plan" ? plan_wiring() : load_wiring(source);
}

std::string_view words_of(WiringSource source) {
  switch (source) {
    case WiringSource::plan:
      return "The plan, which is not confirmed: r4 wiring confirm";
    case WiringSource::given:
      return "Given by the owner of the board";
    case WiringSource::damaged:
      break;
  }
  return "The stored wiring is damaged, so no signal is connected";
}

struct Count {
  int connected = 0;
  int as_planned = 0;
};

Count count(const Wiring& wiring) {
  const Wiring plan = plan_wiring();
  Count count;
  for (int i = 0; i < signal_count; ++i) {
    count.connected += wiring.places[i].connected() ? 1 : 0;
    count.as_planned += wiring.places[i] == plan.places[i] ? 1 : 0;
  }
  return count;
}

int check_file(const WiringOptions& options) {
  const auto [connected, as_planned] = count(load_wiring(options.first));
  if (options.json) {
    print_line({{"type", "wiring"},
                {"file", options.first},
                {"signals", signal_count},
                {"connected", connected},
                {"as_planned", as_planned}});
  } else {
    print_text("{}: a valid wiring: {} of {} signals are connected, {} as in the plan\n",
               options.first, connected, signal_count, as_planned);
  }
  return 0;
}

int print_template(const WiringOptions& /*options*/) {
  print_text("{}", write_wiring(plan_wiring()));
  return 0;
}

int diff(const WiringOptions& options) {
  const Wiring a = wiring_of(options.first);
  const Wiring b = wiring_of(options.second);
  for (int i = 0; i < signal_count; ++i) {
    if (a.places[i] == b.places[i]) continue;
    const std::string from = place_name(i, a.places[i]);
    const std::string to = place_name(i, b.places[i]);
    if (options.json) {
      print_line({{"type", "difference"}, {"signal", signal_name(i)}, {"a", from}, {"b", to}});
    } else {
      print_text("{}: {} -> {}\n", signal_name(i), from, to);
    }
  }
  return a == b ? 0 : static_cast<int>(ErrorKind::data);
}

int give_file(const WiringOptions& options) {
  give(options.second, load_wiring(options.first));
  print_text(
      "the board stores this wiring within two seconds, and uses it after its next start\n"
      "first switch the outputs off:   r4 stop {}\n"
      "then press reset, or disconnect the power\n",
      options.second);
  return 0;
}

int show(const WiringOptions& options) {
  const BoardWiring kept = ask(options.first);
  if (options.json) {
    Json places;
    for (int i = 0; i < signal_count; ++i) {
      places[signal_name(i)] = place_name(i, kept.wiring.places[i]);
    }
    print_line({{"type", "wiring"},
                {"source", to_text(kept.source)},
                {"in_use", kept.in_use},
                {"places", places}});
    return 0;
  }
  print_text("{}\n# {}{}\n", write_wiring(kept.wiring), words_of(kept.source),
             kept.in_use ? "" : ". The board uses another wiring until its next start");
  return 0;
}

int confirm(const WiringOptions& options) {
  const BoardWiring kept = ask(options.first);
  switch (kept.source) {
    case WiringSource::given:
      print_text(
          "the board already has a wiring from its owner, so a confirmation is not needed\n");
      return 0;
    case WiringSource::damaged:
      throw Error(ErrorKind::refused, options.first, "the stored wiring of the board is damaged",
                  "give the wiring again: r4 wiring give FILE " + options.first);
    case WiringSource::plan:
      break;
  }
  give(options.first, kept.wiring);
  print_text(
      "the board stores the plan as its wiring within two seconds, and drives its outputs after "
      "its next start\n"
      "until then, clear the fault: r4 send {} E:CLEAR\n",
      options.first);
  return 0;
}

struct WiringAction {
  std::string_view name;
  std::string_view arguments;
  int count;  // number of arguments
  int (*run)(const WiringOptions&);
};
constexpr WiringAction actions[] = {
    {"check", "FILE", 1, check_file}, {"template", "> FILE", 0, print_template},
    {"diff", "FILE FILE", 2, diff},   {"give", "FILE URL", 2, give_file},
    {"show", "URL", 1, show},         {"confirm", "URL", 1, confirm}};

int run(const WiringOptions& options) {
  for (const WiringAction& each : actions) {
    if (each.name != options.action) continue;
    const int given = options.first.empty() ? 0 : options.second.empty() ? 1 : 2;
    if (given == each.count) return each.run(options);
    throw Error(ErrorKind::usage, options.action,
                given < each.count ? "an argument is missing" : "there is one argument too many",
                fmt::format("use r4 wiring {} {}", each.name, each.arguments));
  }
  throw Error(ErrorKind::usage, options.action, "this is not an action",
              "use check, template, diff, give, show or confirm");
}

constexpr const char* wiring_footer =
    R"(A wiring file names the pin of the Giga, or the line of a chip, for each signal of a board
(docs/reference/wiring.md). The paper does not give the wiring, so without a file the wiring is our
plan. A new board keeps its outputs off until it is given a wiring, or its owner confirms the plan.
  check FILE        reports a fault with its line, the reason and the fix
  template          prints the plan as a file; compare it with your board's schematic
  diff FILE FILE    prints the differences in the second wiring; a FILE may be plan, or a URL
  give FILE URL     stores the wiring on the board, which uses it after its next start
  show URL          prints the wiring that the board has stored, as a file
  confirm URL       stores the plan as the wiring; first compare the plan with the board
A board accepts and shows its wiring over USB only.

Examples:
  r4 wiring template > robot.wiring
  r4 wiring check robot.wiring
  r4 wiring diff plan robot.wiring
  r4 wiring give robot.wiring serial:auto
  r4 wiring confirm serial:auto
  r4 sim --wiring robot.wiring         a simulated board with this wiring

Exit codes: 0 done; 1 a wiring is not valid, or diff found a difference; 2 usage, or the URL is not
a cable; 3 the board did not accept the wiring; 4, 5 a file or the transport cannot be opened.)";

}  // namespace

void add_wiring(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<WiringOptions>();
  CLI::App* const command = add_subcommand(
      root, chosen, "wiring", "Check and set how a board is wired", wiring_footer, options, run);
  add_text(*command, "ACTION", options->action, "the action: see below",
           "check|template|diff|give|show|confirm", Need::required);
  add_text(*command, "FILE", options->first, "a wiring file, or a URL", file_type);
  add_text(*command, "SECOND", options->second, "for diff: the second wiring; for give: the URL",
           file_type);
  add_json(*command, options->json, "print the result as JSON, one object a line");
}

}  // namespace r4::tool
