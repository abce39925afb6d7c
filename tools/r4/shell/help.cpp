// SPDX-License-Identifier: GPL-3.0-or-later
#include "help.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <numeric>
#include <string_view>
#include <vector>

#include "json.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/discovery/transports.hpp"

namespace r4::tool {
namespace {

// Levenshtein distance: how many characters must be changed, added or removed to turn `a` into `b`.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

class Layout : public CLI::Formatter {
 public:
  Layout() {
    column_width(28);
    label("REQUIRED", "");
    label("SUBCOMMAND", "COMMAND");
    label("SUBCOMMANDS", "COMMAND");
    label("Positionals", "Arguments");
  }
  std::string make_usage(const CLI::App* app, std::string name) const override {
    return "\n" + CLI::Formatter::make_usage(app, std::move(name));
  }
  // The name of a positional already states its type.
  std::string make_option_opts(const CLI::Option* option) const override {
    return option->get_positional() ? "" : CLI::Formatter::make_option_opts(option);
  }
};

}  // namespace

std::string url_table() {
  std::string table;
  for (const TransportHelp& entry : transports()) {
    table += fmt::format("  {}\n      {}\n", entry.usage, entry.meaning);
  }
  return table;
}

void print_url_schemes() {
  for (const TransportHelp& entry : transports()) {
    print_line({{"type", "scheme"},
                {"scheme", entry.scheme},
                {"usage", entry.usage},
                {"meaning", entry.meaning}});
  }
}

std::string command_table() {
  constexpr std::size_t widest = 100;
  std::string table;
  for (const CommandHelp& each : all_command_help()) {
    const bool by_itself = each.kind == CommandKind::heartbeat || each.kind == CommandKind::leave ||
                           each.kind == CommandKind::watch;
    if (by_itself) continue;
    const std::string first =
        fmt::format("  {:<21} {}{}", each.form, each.meaning, each.ranges.empty() ? "" : ":");
    const bool fits = first.size() + each.ranges.size() < widest;
    table += first + (fits ? " " : "\n      ");
    std::string_view ranges = each.ranges;
    while (6 + ranges.size() > widest) {
      const std::size_t end = ranges.rfind(' ', widest - 6);
      table += fmt::format("{}\n      ", ranges.substr(0, end));
      ranges.remove_prefix(end + 1);
    }
    table += fmt::format("{}\n", ranges);
  }
  return table;
}

std::string root_footer() {
  return "First steps: start r4 sim in one terminal, then in another terminal\n"
         "  r4 sim                          a simulated board, at udp://127.0.0.1:2018\n"
         "  r4 monitor udp://127.0.0.1      the board's state, a hundred times a second\n"
         "  r4 send udp://127.0.0.1 R:1,On O:358,1,1 --hold 5\n"
         "                                  motor 1 forward at 358 of 4095, for five seconds\n"
         "  r4 demo                         an explanation, over every transport\n"
         "\nURLs of a board, or of the place where a simulated board listens:\n" +
         url_table() +
         "\nExit codes:\n"
         "  0 done    1 a datagram or file is bad    2 wrong usage    3 refused, or not in time\n"
         "  4 the transport cannot be opened    5 permission denied    6 the kernel lacks support\n"
         "\nAn error is one line on stderr, \"r4: thing: reason; fix\". With --json it is also an "
         "object.";
}

void set_help_layout(CLI::App& root) {
  const auto layout = std::make_shared<Layout>();
  root.formatter(layout);
  for (CLI::App* const command : root.get_subcommands({})) command->formatter(layout);
}

std::string nearest_name(const CLI::App& command, const std::string& word) {
  std::vector<std::string> names;
  for (const CLI::App* const each : command.get_subcommands({})) names.push_back(each->get_name());
  for (const CLI::Option* const option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  std::string best;
  std::size_t best_distance = 3;
  for (const std::string& name : names) {
    const std::size_t d = distance(word, name);
    if (d < best_distance && d < word.size()) {
      best = name;
      best_distance = d;
    }
  }
  return best;
}

}  // namespace r4::tool
