// SPDX-License-Identifier: GPL-3.0-or-later
// Options that several subcommands share. Parsing a wrong value throws Error{usage}.
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

// Seconds such as 5 or 0.25, rounded to hundredths, at most 10 million. 0 only with Zero::allowed.
enum class Zero { refused, allowed };
CLI::Option* add_seconds(CLI::App& command, const std::string& name, Milliseconds& out,
                         const std::string& meaning, Zero zero = Zero::refused);
CLI::Option* add_seconds(CLI::App& command, const std::string& name,
                         std::optional<Milliseconds>& out, const std::string& meaning);
void add_duration(CLI::App& command, std::optional<Milliseconds>& out,
                  const std::string& meaning = "end after this time");
void add_duration(CLI::App& command, Milliseconds& out, const std::string& meaning);

// `type` is the value's name in the help and the completion.
enum class Need { optional, required };
void add_text(CLI::App& command, const std::string& name, std::string& out,
              const std::string& meaning, const char* type, Need need = Need::optional);
void add_texts(CLI::App& command, const std::string& name, std::vector<std::string>& out,
               const std::string& meaning, const char* type, Need need = Need::optional);
// `take` checks the text and throws Error{usage} if it is not valid.
void add_text(CLI::App& command, const std::string& name,
              const std::function<void(const std::string&)>& take, const std::string& meaning,
              const char* type, Need need);
void add_repeated(CLI::App& command, const std::string& name, std::vector<std::string>& out,
                  const std::string& meaning, const char* type);

void add_flag(CLI::App& command, const std::string& name, bool& out, const std::string& meaning);

void exclude(CLI::App& command, const std::string& name, std::initializer_list<const char*> others);

CLI::Option* add_number(CLI::App& command, const std::string& name, std::uint64_t& out,
                        std::uint64_t min, std::uint64_t max, const std::string& meaning);
CLI::Option* add_number(CLI::App& command, const std::string& name,
                        std::optional<std::uint64_t>& out, std::uint64_t min, std::uint64_t max,
                        const std::string& meaning);

CLI::Option* add_json(CLI::App& command, bool& out, const std::string& meaning);

// '+' joins the URLs of the paths to one board (r4link/discovery/url_pattern.hpp). For
// add_paths(), which takes one board, each URL is a path; for add_boards() each URL is a board:
//     r4 stop serial:auto udp://192.168.0.125   =   r4 stop serial:auto+udp://192.168.0.125
CLI::Option* add_paths(CLI::App& command, std::vector<std::string>& out);
CLI::Option* add_boards(CLI::App& command, std::vector<std::string>& out);

// Splits "URL... WORD...": the leading URLs are joined into `url`. Throws Error{usage} if a
// URL follows a word, or if there is no word. `what`: the name of the words in the error.
CLI::Option* add_url(CLI::App& command, std::string& out);
void take_paths(std::string& url, std::vector<std::string>& words, const std::string& what);

bool is_url(std::string_view text);

CLI::Option* add_fields(
    CLI::App& command, std::string& out,
    const std::string& meaning = "state fields to request, such as DEFAULT,ENC1,US1 or ALL");

// Type names for which the completion scripts offer values.
inline constexpr const char* url_type = "URL";
inline constexpr const char* file_type = "FILE";

}  // namespace r4::tool
