// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/output.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/board.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"
#include "r4link/options.hpp"

namespace r4::tool {
namespace {

struct KeyOptions {
  std::string action;
  std::string file;
  std::string url;
  std::optional<std::uint64_t> id;
};

int make(const KeyOptions& options) {
  if (!options.url.empty()) {
    throw Error(ErrorKind::usage, options.url, "is not needed for a new key",
                "remove the URL: r4 key new FILE");
  }
  const auto id = static_cast<std::uint8_t>(options.id.value_or(1));
  make_key_file(options.file, id);
  print_text(
      "{}: key {}\n"
      "give it to the board over USB:   r4 key give {} serial:auto\n"
      "then open the board with it:     r4 monitor udp://... --key {}\n",
      options.file, id, options.file, options.file);
  return 0;
}

int give(const KeyOptions& options) {
  if (options.url.empty()) {
    throw Error(ErrorKind::usage, "URL", "is missing",
                "name the board: r4 key give FILE serial:auto");
  }
  if (options.id) {
    throw Error(ErrorKind::usage, fmt::format("--id {}", *options.id),
                "cannot change the id of a key", "make a new key: r4 key new FILE --id N");
  }
  require_cable(options.url, "the key in " + options.file);
  const Key key = load_key(options.file);
  std::array<char, key_text_size> text;
  write_key(text.data(), key);
  Board board(options.url);
  // A board in the safe state also accepts a key.
  board.setting("key", {text.data(), text.size()}, std::chrono::seconds{5});
  print_text(
      "the board has key {}. From networks and buses, it obeys only hosts with this key. It obeys "
      "a stop from any host\n",
      key.id);
  return 0;
}

int keys(const KeyOptions& options) {
  if (options.file.empty() || is_url(options.file)) {
    throw Error(ErrorKind::usage, fmt::format("'{}'", options.file), "is not a file",
                options.action == "new" ? "name a file: r4 key new FILE"
                                        : "name a file: r4 key give FILE serial:auto");
  }
  return options.action == "new" ? make(options) : give(options);
}

constexpr const char* key_footer =
    R"(A board with a key obeys only hosts that have the key: with --key FILE, or R4_KEY=FILE in the
environment, r4 signs its heartbeats and commands. An emergency stop needs no key. A host at the
board's USB cable needs no key, and can set one.

A key has an id, 1 to 9. A board holds up to four keys. Give each host its own key, so that you
can remove one key: r4 send serial:auto C:key,2:off

Examples:
  r4 key new ~/.r4-key                  makes a key in a file that only you can read
  r4 key give ~/.r4-key serial:auto     sets the key on the board, which then requires the key
  r4 send udp://192.168.0.125 R:1,On O:358,1,1 --key ~/.r4-key

Exit codes: 0 done; 1 the file does not contain a key; 2 usage, or the URL is not a cable; 3 the board did
not accept the key; 4, 5 the file or the transport cannot be opened.)";

}  // namespace

void add_key_command(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<KeyOptions>();
  CLI::App* const command = add_subcommand(
      root, chosen, "key", "Make a key, and give it to a board", key_footer, options, keys);
  add_text(
      *command, "ACTION",
      [options](const std::string& action) {
        if (action != "new" && action != "give") {
          throw Error(ErrorKind::usage, action, "is not a valid action: expected new or give",
                      "use new or give");
        }
        options->action = action;
      },
      "new or give", "new|give", Need::required);
  add_text(*command, "FILE", options->file, "the file with the key", file_type, Need::required);
  add_text(*command, "URL", options->url, "give: where the board is, such as serial:auto",
           url_type);
  add_number(*command, "--id", options->id, 1, max_key_id, "new: the id of the key (default 1)");
}

}  // namespace r4::tool
