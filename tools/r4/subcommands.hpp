// SPDX-License-Identifier: GPL-3.0-or-later
// The subcommands of r4, one file each. An add_… function declares its options below `root`;
// parsing the command line puts what is to be done into `chosen`, which returns the exit code or
// throws Error.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace r4::tool {

using Action = std::function<int()>;

void add_sim(CLI::App& root, Action& chosen);
void add_monitor(CLI::App& root, Action& chosen);
void add_send(CLI::App& root, Action& chosen);
void add_stop(CLI::App& root, Action& chosen);
void add_list(CLI::App& root, Action& chosen);
void add_encode(CLI::App& root, Action& chosen);
void add_decode(CLI::App& root, Action& chosen);
void add_bus(CLI::App& root, Action& chosen);
void add_bench(CLI::App& root, Action& chosen);
void add_key_command(CLI::App& root, Action& chosen);
void add_demo(CLI::App& root, Action& chosen);
void add_completion(CLI::App& root, Action& chosen);

// A subcommand with its one-line meaning, the footer of its --help and its action. `options` lives
// as long as the command line does.
template <class Options>
CLI::App* add_subcommand(CLI::App& root, Action& chosen, const char* name, const char* meaning,
                         const char* footer, std::shared_ptr<Options> options,
                         int (*action)(const Options&)) {
  CLI::App* const command = root.add_subcommand(name, meaning);
  command->group("Commands");
  command->footer(footer);
  command->callback(
      [&chosen, options, action] { chosen = [options, action] { return action(*options); }; });
  return command;
}

}  // namespace r4::tool
