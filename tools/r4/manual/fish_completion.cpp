// SPDX-License-Identifier: GPL-3.0-or-later
#include "fish_completion.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <string_view>
#include <vector>

#include "option_tree.hpp"
#include "tools/r4/shell/options.hpp"

namespace r4::tool {
namespace {

std::string fish_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') out += '\\';
    out += c;
  }
  return out + "'";
}

std::string value_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  if (type == file_type) return " -F";
  if (type == url_type)
    return " -a " + fish_quoted(fmt::format("{}", fmt::join(url_beginnings(), " ")));
  const std::string choices = choices_of(option);
  return choices.empty() ? "" : " -a " + fish_quoted(choices);
}

std::string lines_of(const CLI::App& command, const std::string& name) {
  const std::string begin =
      fmt::format("complete -c r4 -n {}", fish_quoted(fmt::format("__r4_is '{}'", name)));
  std::string lines;
  for (const CLI::Option* const option : options_of(command)) {
    lines += begin;
    for (const std::string& each : option->get_snames()) lines += " -s " + each;
    for (const std::string& each : option->get_lnames()) lines += " -l " + each;
    if (takes_value(*option)) lines += " -r" + value_of(*option);
    lines += fmt::format(" -d {}\n", fish_quoted(option->get_description()));
  }
  for (const CLI::Option* const positional : positionals_of(command)) {
    const std::string value = value_of(*positional);
    if (!value.empty()) lines += begin + value + "\n";
  }
  return lines;
}

}  // namespace

std::string fish_script(const CLI::App& root) {
  std::string script = R"(# fish completion of r4, made by: r4 completion fish
# For this shell: r4 completion fish | source
# For all: r4 completion fish > ~/.config/fish/completions/r4.fish
function __r4_is -d 'Is this the command in the line?'
  set -l words (commandline -opc)
  set -e words[1]
  set -l words (string match -v -- '-*' $words)
  test "$words[1]" = "$argv[1]"
end
complete -c r4 -f
)";
  script += lines_of(root, "");
  for (const CLI::App* const command : root.get_subcommands({})) {
    script += fmt::format("complete -c r4 -n \"__r4_is ''\" -a {} -d {}\n", command->get_name(),
                          fish_quoted(command->get_description()));
    script += lines_of(*command, command->get_name());
  }
  return script;
}

}  // namespace r4::tool
