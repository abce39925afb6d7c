// SPDX-License-Identifier: GPL-3.0-or-later
#include "option_tree.hpp"

#include <CLI/CLI.hpp>
#include <string_view>

#include "r4link/discovery/transports.hpp"

namespace r4::tool {

bool takes_value(const CLI::Option& option) { return option.get_expected_max() != 0; }

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->nonpositional(); });
}
std::vector<const CLI::Option*> positionals_of(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->get_positional(); });
}

std::string choices_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.find('|') == std::string::npos ? "" : CLI::detail::find_and_replace(type, "|", " ");
}

std::vector<std::string> url_beginnings() {
  std::vector<std::string> beginnings;
  for (const TransportHelp& entry : transports()) {
    const std::string_view usage = entry.usage;
    const std::size_t colon = usage.find(':');
    beginnings.emplace_back(usage.substr(0, colon + 1));
    if (usage.substr(colon + 1).starts_with("//")) beginnings.back() += "//";
  }
  return beginnings;
}

}  // namespace r4::tool
