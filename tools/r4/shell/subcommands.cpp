// SPDX-License-Identifier: GPL-3.0-or-later
#include "subcommands.hpp"

#include <CLI/CLI.hpp>
#include <utility>

namespace r4::tool {

CLI::App* add_subcommand(CLI::App& root, const char* name, const char* meaning,
                         const std::string& footer, std::function<void()> on_chosen) {
  CLI::App* const command = root.add_subcommand(name, meaning);
  command->group("Commands");
  command->footer(footer);
  command->callback(std::move(on_chosen));
  return command;
}

}  // namespace r4::tool
