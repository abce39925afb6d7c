// SPDX-License-Identifier: GPL-3.0-or-later
#include "options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <optional>
#include <ratio>
#include <system_error>

#include "number.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/discovery/transports.hpp"
#include "r4link/error.hpp"
#include "r4link/state.hpp"

namespace r4::tool {
namespace {

Milliseconds read_seconds(const std::string& name, const std::string& text, Zero zero) {
  constexpr double most = 10'000'000;
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value, std::chars_format::fixed);
  if (read.ec != std::errc() || read.ptr != end || !(value >= 0 && value <= most)) {
    throw Error(ErrorKind::usage, fmt::format("{} {}", name, text), "is not a valid time",
                "write 0 to 10000000 seconds, such as 5 or 0.25");
  }
  const Milliseconds time = std::chrono::round<std::chrono::duration<std::int64_t, std::centi>>(
      std::chrono::duration<double>(value));
  if (time.count() == 0 && zero == Zero::refused) {
    throw Error(ErrorKind::usage, fmt::format("{} {}", name, text), "is too short",
                "write seconds such as 5 or 0.25");
  }
  return time;
}

std::uint64_t read_number(const std::string& name, const std::string& text, std::uint64_t min,
                          std::uint64_t max) {
  const std::optional<std::uint64_t> number = number_in<std::uint64_t>(text);
  if (!number || *number < min || *number > max) {
    const bool is_number = text.find_first_not_of("0123456789") == std::string::npos;
    throw Error(ErrorKind::usage, fmt::format("{} {}", name, text),
                is_number && !text.empty() ? "is out of range" : "is not a whole number",
                fmt::format("write {} to {}", min, max));
  }
  return *number;
}

template <class Out>
CLI::Option* seconds(CLI::App& command, const std::string& name, Out& out,
                     const std::string& meaning, Zero zero) {
  return command
      .add_option_function<std::string>(
          name,
          [&out, name, zero](const std::string& text) { out = read_seconds(name, text, zero); },
          meaning)
      ->type_name("SECONDS");
}

template <class Out>
CLI::Option* number(CLI::App& command, const std::string& name, Out& out, std::uint64_t min,
                    std::uint64_t max, const std::string& meaning) {
  return command
      .add_option_function<std::string>(
          name,
          [&out, name, min, max](const std::string& text) {
            out = read_number(name, text, min, max);
          },
          meaning)
      ->type_name("N");
}

template <class Out>
CLI::Option* url(CLI::App& command, Out& out, const char* meaning) {
  return command.add_option("URL", out, meaning)->required()->type_name(url_type);
}

constexpr const char* paths_meaning =
    "URL of the board, such as udp://192.168.0.125; several URLs are paths to one board";
constexpr const char* boards_meaning =
    "URLs of boards, such as udp://192.168.0.125; a + joins the paths to one board";

}  // namespace

CLI::Option* add_seconds(CLI::App& command, const std::string& name, Milliseconds& out,
                         const std::string& meaning, Zero zero) {
  return seconds(command, name, out, meaning, zero);
}
CLI::Option* add_seconds(CLI::App& command, const std::string& name,
                         std::optional<Milliseconds>& out, const std::string& meaning) {
  return seconds(command, name, out, meaning, Zero::refused);
}
void add_duration(CLI::App& command, std::optional<Milliseconds>& out, const std::string& meaning) {
  seconds(command, "--duration", out, meaning, Zero::refused);
}
void add_duration(CLI::App& command, Milliseconds& out, const std::string& meaning) {
  seconds(command, "--duration", out, meaning, Zero::refused);
}

void add_text(CLI::App& command, const std::string& name, std::string& out,
              const std::string& meaning, const char* type, Need need) {
  command.add_option(name, out, meaning)->type_name(type)->required(need == Need::required);
}
void add_texts(CLI::App& command, const std::string& name, std::vector<std::string>& out,
               const std::string& meaning, const char* type, Need need) {
  command.add_option(name, out, meaning)->type_name(type)->required(need == Need::required);
}
void add_text(CLI::App& command, const std::string& name,
              const std::function<void(const std::string&)>& take, const std::string& meaning,
              const char* type, Need need) {
  command.add_option_function<std::string>(name, take, meaning)
      ->type_name(type)
      ->required(need == Need::required);
}
void add_repeated(CLI::App& command, const std::string& name, std::vector<std::string>& out,
                  const std::string& meaning, const char* type) {
  command.add_option(name, out, meaning)->type_name(type)->allow_extra_args(false);
}

void add_flag(CLI::App& command, const std::string& name, bool& out, const std::string& meaning) {
  command.add_flag(name, out, meaning);
}

void exclude(CLI::App& command, const std::string& name,
             std::initializer_list<const char*> others) {
  for (const char* const other : others) {
    command.get_option(name)->excludes(command.get_option(other));
  }
}

CLI::Option* add_number(CLI::App& command, const std::string& name, std::uint64_t& out,
                        std::uint64_t min, std::uint64_t max, const std::string& meaning) {
  return number(command, name, out, min, max, meaning);
}
CLI::Option* add_number(CLI::App& command, const std::string& name,
                        std::optional<std::uint64_t>& out, std::uint64_t min, std::uint64_t max,
                        const std::string& meaning) {
  return number(command, name, out, min, max, meaning);
}

CLI::Option* add_json(CLI::App& command, bool& out, const std::string& meaning) {
  return command.add_flag("--json", out, meaning);
}

CLI::Option* add_paths(CLI::App& command, std::vector<std::string>& out) {
  return url(command, out, paths_meaning);
}
CLI::Option* add_boards(CLI::App& command, std::vector<std::string>& out) {
  return url(command, out, boards_meaning);
}

CLI::Option* add_url(CLI::App& command, std::string& out) {
  return url(command, out, paths_meaning);
}
void take_paths(std::string& url, std::vector<std::string>& words, const std::string& what) {
  const auto is = [](const std::string& word) { return is_url(word); };
  const auto first = std::find_if_not(words.begin(), words.end(), is);
  for (auto word = words.begin(); word != first; ++word) url += "+" + *word;
  words.erase(words.begin(), first);
  if (words.empty()) {
    throw Error(ErrorKind::usage, what, "is missing", "write it after " + url);
  }
  const auto late = std::find_if(words.begin(), words.end(), is);
  if (late == words.end()) return;
  throw Error(ErrorKind::usage, *late, "a URL cannot follow " + words.front(),
              "write all URLs of the board first");
}

bool is_url(std::string_view text) {
  const std::vector<TransportHelp> all = transports();
  return std::any_of(all.begin(), all.end(), [&](const TransportHelp& each) {
    return text.starts_with(each.scheme + ":");
  });
}

CLI::Option* add_fields(CLI::App& command, std::string& out, const std::string& meaning) {
  return command
      .add_option_function<std::string>(
          "--fields",
          [&out](const std::string& text) {
            FieldSet set;
            if (parse_fields(Text(text), set) != Refusal::none) {
              throw Error(
                  ErrorKind::usage, "--fields " + text, "this is not a list of state fields",
                  "use " + command_help(CommandKind::fields).ranges + ", separated by commas");
            }
            out = text;
          },
          meaning)
      ->type_name("NAMES");
}

}  // namespace r4::tool
