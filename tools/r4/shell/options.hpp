// SPDX-License-Identifier: GPL-3.0-or-later
// Options that several subcommands share, and how their values are read. A wrong value throws
// Error{usage} from the parsing of the command line. The templates of CLI11 that make options are
// compiled in options.cpp, once: in each subcommand they would take longer than all the rest of it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cli_fwd.hpp"

namespace r4::tool {

using Milliseconds = std::chrono::milliseconds;

// Seconds such as 5 or 0.25, to the hundredth, at most 10 million; 0 only where it means something.
enum class Zero { refused, allowed };
CLI::Option* add_seconds(CLI::App& command, const std::string& name, Milliseconds& out,
                         const std::string& meaning, Zero zero = Zero::refused);
CLI::Option* add_seconds(CLI::App& command, const std::string& name,
                         std::optional<Milliseconds>& out, const std::string& meaning);
// --duration, the same in every command that runs until it is ended.
void add_duration(CLI::App& command, std::optional<Milliseconds>& out,
                  const std::string& meaning = "end after that time");
void add_duration(CLI::App& command, Milliseconds& out, const std::string& meaning);

// One text, or a list of them; `type` is what the help and the completion call it.
enum class Need { optional, required };
void add_text(CLI::App& command, const std::string& name, std::string& out,
              const std::string& meaning, const char* type, Need need = Need::optional);
void add_texts(CLI::App& command, const std::string& name, std::vector<std::string>& out,
               const std::string& meaning, const char* type, Need need = Need::optional);
// A text that `take` looks at, and throws Error{usage} if it is none of those that can be.
void add_text(CLI::App& command, const std::string& name,
              const std::function<void(const std::string&)>& take, const std::string& meaning,
              const char* type, Need need);
// A list of which each is given with the option's name again.
void add_repeated(CLI::App& command, const std::string& name, std::vector<std::string>& out,
                  const std::string& meaning, const char* type);

void add_flag(CLI::App& command, const std::string& name, bool& out, const std::string& meaning);

// `name` cannot be given together with one of `others`.
void exclude(CLI::App& command, const std::string& name, std::initializer_list<const char*> others);

// A whole number from `min` to `max`.
CLI::Option* add_number(CLI::App& command, const std::string& name, std::uint64_t& out,
                        std::uint64_t min, std::uint64_t max, const std::string& meaning);
CLI::Option* add_number(CLI::App& command, const std::string& name,
                        std::optional<std::uint64_t>& out, std::uint64_t min, std::uint64_t max,
                        const std::string& meaning);

CLI::Option* add_json(CLI::App& command, bool& out, const std::string& meaning);

// Where a board is. A '+' may join the URLs of several paths to it
// (r4link/discovery/url_pattern.hpp), for every command. A command for one board also takes several
// URLs as its paths:
//
//     r4 stop serial:auto udp://192.168.0.125             is         r4 stop serial:auto+udp://192.168.0.125
//
// Of several boards each URL is one.
CLI::Option* add_paths(CLI::App& command, std::vector<std::string>& out);
CLI::Option* add_boards(CLI::App& command, std::vector<std::string>& out);

// URL... and then other words: the URLs in front of those are put to `url`. Throws Error{usage} for a URL behind a
// word, and if no word is left, which `what` names.
CLI::Option* add_url(CLI::App& command, std::string& out);
void take_paths(std::string& url, std::vector<std::string>& words, const std::string& what);

// Does it begin as the URL of a transport?
bool is_url(std::string_view text);

// State fields for `F`, checked.
CLI::Option* add_fields(
    CLI::App& command, std::string& out,
    const std::string& meaning = "state fields to ask for, such as DEFAULT,ENC1,US1 or ALL");

// What the completion scripts offer for an option's or a positional's value, by its type name.
inline constexpr const char* url_type = "URL";
inline constexpr const char* file_type = "FILE";

}  // namespace r4::tool
