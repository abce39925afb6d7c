// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "man_page.hpp"
#include "r4link/error.hpp"
#include "tools/r4/shell/options.hpp"
#include "tools/r4/shell/output.hpp"
#include "tools/r4/shell/subcommands.hpp"

namespace r4::tool {
namespace {

struct ManOptions {
  const CLI::App* root = nullptr;
  std::string command;
  std::string folder;
};

void write_page(const CLI::App& root, const CLI::App& command, const std::string& folder) {
  const std::string path = fmt::format("{}/{}.1", folder, page_name(root, command));
  errno = 0;
  std::ofstream file(path, std::ios::binary);
  file << man_page(root, command);
  file.close();
  if (file) return;
  throw Error(errno == EACCES ? ErrorKind::permission : ErrorKind::open, path,
              fmt::format("cannot be written ({})", std::strerror(errno)),
              "give an existing folder that you may write to");
}

int print_pages(const ManOptions& options) {
  const CLI::App& root = *options.root;
  if (!options.folder.empty()) {
    write_page(root, root, options.folder);
    for (const CLI::App* const each : root.get_subcommands({})) {
      write_page(root, *each, options.folder);
    }
    return 0;
  }
  const CLI::App* shown = &root;
  for (const CLI::App* const each : root.get_subcommands({})) {
    if (each->get_name() == options.command) shown = each;
  }
  if (shown == &root && !options.command.empty()) {
    throw Error(ErrorKind::usage, options.command, "this is not a command",
                "use a command that r4 --help lists");
  }
  print_raw(man_page(root, *shown));
  return 0;
}

constexpr const char* man_footer =
    R"(The page has the same content as r4 --help and r4 COMMAND --help. If r4 is installed as a package,
man r4-send shows the page without this command.

Examples:
  r4 man send | man -l -
  r4 man -o ~/.local/share/man/man1           all pages: r4.1, r4-send.1 …

Exit codes: 0 done; 2 the command does not exist; 4, 5 a page cannot be written.)";

}  // namespace

void add_man(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<ManOptions>();
  options->root = &root;
  CLI::App* const command = add_subcommand(
      root, chosen, "man", "Print the manual page of a command", man_footer, options, print_pages);
  add_text(*command, "COMMAND", options->command, "such as send (default: r4 itself)", "COMMAND");
  add_text(*command, "-o,--output", options->folder,
           "write the pages of all commands into this folder", "FOLDER");
  exclude(*command, "--output", {"COMMAND"});
}

}  // namespace r4::tool
