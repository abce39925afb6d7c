// SPDX-License-Identifier: GPL-3.0-or-later
#include "man_page.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <string_view>
#include <vector>

#include "option_tree.hpp"
#include "r4link/config.hpp"

namespace r4::tool {
namespace {

// Escapes words for troff. Hyphens stay searchable and can be copied.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\':
        out += "\\(rs";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '"':
        out += "\\(dq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      default:
        out += c;
    }
  }
  return out.starts_with('.') ? "\\&" + out : out;
}

std::string bold(std::string_view text) { return "\\fB" + escaped(text) + "\\fR"; }
std::string italic(std::string_view text) { return "\\fI" + escaped(text) + "\\fR"; }

// Filled text. Checkers require at most 80 bytes a line, and a character may have several bytes.
std::string filled(std::string_view text) {
  constexpr std::size_t longest = 66;
  std::string out;
  std::string line;
  for (const std::string& each : CLI::detail::split(std::string(text), ' ')) {
    const std::string word = escaped(each);
    if (word.empty()) continue;
    if (!line.empty() && line.size() + 1 + word.size() > longest) {
      out += line + "\n";
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
  }
  return out + line + "\n";
}

std::string today() {
  const char* const epoch = std::getenv("SOURCE_DATE_EPOCH");
  const std::time_t now = epoch != nullptr ? std::strtoll(epoch, nullptr, 10) : std::time(nullptr);
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
}

std::string body_of(const std::vector<std::string>& lines) {
  std::string out;
  bool verbatim = false;
  bool apart = false;
  const auto end_verbatim = [&] {
    if (verbatim) out += ".EE\n";
    apart = apart || verbatim;
    verbatim = false;
  };
  for (const std::string& line : lines) {
    if (line.starts_with(' ')) {
      if (!verbatim) out += out.empty() ? ".EX\n" : ".PP\n.EX\n";
      verbatim = true;
      const std::size_t begin = line.starts_with("  ") ? 2 : 1;
      out += escaped(std::string_view(line).substr(begin)) + "\n";
      continue;
    }
    end_verbatim();
    if (line.empty()) {
      apart = !out.empty();
      continue;
    }
    if (apart) out += ".PP\n";
    apart = false;
    out += filled(line);
  }
  end_verbatim();
  return out;
}

struct Footer {
  std::vector<std::string> description;
  std::vector<std::string> examples;
  std::vector<std::string> exit_codes;
};

Footer footer_of(const CLI::App& command) {
  Footer parts;
  std::vector<std::string>* section = &parts.description;
  bool begins = true;
  for (std::string line : CLI::detail::split(command.get_footer(), '\n')) {
    if (begins) {
      section = &parts.description;
      constexpr std::string_view codes = "Exit codes:";
      if (line == "Examples:") {
        section = &parts.examples;
        line.clear();
      } else if (line.starts_with(codes)) {
        section = &parts.exit_codes;
        line.erase(0, std::min(codes.size() + 1, line.size()));
      }
    }
    begins = line.empty() && section->empty() ? false : line.empty();
    section->push_back(line);
  }
  return parts;
}

bool several(const CLI::Option& option) { return option.get_expected_max() > 1; }

std::string synopsis_of(const CLI::App& root, const CLI::App& command) {
  std::string out =
      bold(&command == &root ? root.get_name() : root.get_name() + " " + command.get_name());
  out += " [" + italic("OPTIONS") + "]";
  for (const CLI::Option* const each : positionals_of(command)) {
    const std::string name = italic(each->get_name(true)) + (several(*each) ? "..." : "");
    out += each->get_required() ? " " + name : " [" + name + "]";
  }
  if (&command == &root) out += " " + italic("COMMAND");
  return out + "\n";
}

std::string arguments_of(const CLI::App& command) {
  std::string out;
  for (const CLI::Option* const each : positionals_of(command)) {
    out +=
        fmt::format(".TP\n{}\n{}", italic(each->get_name(true)), filled(each->get_description()));
  }
  return out;
}

std::string options_text(const CLI::App& command) {
  std::string out;
  for (const CLI::Option* const each : options_of(command)) {
    std::string head;
    for (const std::string& name : names_of(*each)) head += (head.empty() ? "" : ", ") + bold(name);
    if (takes_value(*each)) head += " " + italic(each->get_type_name());
    if (several(*each)) head += " ...";
    out += fmt::format(".TP\n{}\n{}", head, filled(each->get_description()));
  }
  return out;
}

std::string commands_of(const CLI::App& root) {
  std::string out;
  for (const CLI::App* const each : root.get_subcommands({})) {
    out += fmt::format(".TP\n.BR {} (1)\n{}", escaped(page_name(root, *each)),
                       filled(each->get_description()));
  }
  return out;
}

}  // namespace

std::string page_name(const CLI::App& root, const CLI::App& command) {
  return &command == &root ? root.get_name() : root.get_name() + "-" + command.get_name();
}

std::string man_page(const CLI::App& root, const CLI::App& command) {
  const std::string name = page_name(root, command);
  const Footer parts = footer_of(command);
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(), [](char c) {
    return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  });
  std::string page = fmt::format(
      ".\\\" Made by: r4 man\n.TH {} 1 {} \"R4 link {}\" \"R4 link\"\n.SH NAME\n{}", escaped(title),
      today(), R4LINK_VERSION, filled(name + " - " + command.get_description()));
  const auto section = [&page](const char* head, const std::string& body) {
    if (!body.empty()) page += fmt::format(".SH {}\n{}", head, body);
  };
  section("SYNOPSIS", synopsis_of(root, command));
  section("DESCRIPTION", body_of(parts.description));
  if (&command == &root) section("COMMANDS", commands_of(root));
  section("ARGUMENTS", arguments_of(command));
  section("OPTIONS", options_text(command));
  section("EXAMPLES", body_of(parts.examples));
  section("\"EXIT STATUS\"", body_of(parts.exit_codes));
  if (&command != &root) section("\"SEE ALSO\"", ".BR r4 (1)\n");
  return page;
}

}  // namespace r4::tool
