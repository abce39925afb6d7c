// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <asio/io_context.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "../boards/paths.hpp"
#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/async_board.hpp"
#include "r4link/discovery/async_carriers.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {
namespace {

struct StopOptions {
  std::vector<std::string> urls;
  Milliseconds timeout{2000};
  std::string key;  // not read: a key is not needed, and a bad key file must not delay a stop
  bool json = false;
};

// A watcher, which never takes control. Uses its own transport if possible, because the controlling
// program may hang.
std::unique_ptr<AsyncBoard> open(asio::io_context& io, const std::string& url) {
  BoardOptions options;
  options.role = BoardRole::watch;
  auto paths = make_host_carriers(io, {url}, BoardRole::watch);
  const std::vector<std::string> urls = split_paths(url);
  for (std::size_t i = 0; i < urls.size(); ++i) {
    if (Url::parse(urls[i]).scheme() != "serial") paths[i] = make_own_carrier(io, urls[i]);
  }
  auto board = std::make_unique<AsyncBoard>(io, std::move(paths), options);
  try {
    board->open();
  } catch (const Error& error) {
    Problem problem = error.problem();
    problem.fix = fmt::format("{}; {}", stop_last_resort, problem.fix);
    throw Error(problem);
  }
  return board;
}

void print_confirmed(const StopOptions& options, const CommandResult& result) {
  const double ms = std::chrono::duration<double, std::milli>(result.elapsed).count();
  if (options.json) {
    print_line({{"type", "result"}, {"command", "E:STOP"}, {"confirmed", true}, {"ms", ms}});
  } else {
    print_text(
        "stopped: the board reports SAFE (stop), after {:.1f} ms\n"
        "it stays stopped until: r4 send {} E:CLEAR\n"
        "the program in control can also clear the stop, by arm(): to prevent this, end that "
        "program\n",
        ms, join_paths(options.urls));
  }
}

int stop(const StopOptions& options) {
  asio::io_context io(1);
  const std::string url = join_paths(options.urls);
  const std::unique_ptr<AsyncBoard> board = open(io, url);
  std::optional<CommandResult> result;
  Timer repeating(io);
  board->async_send(Command::stop(), options.timeout, [&](const CommandResult& r) {
    result = r;
    if (r.outcome != Outcome::confirmed) return io.stop();
    // Meanwhile the library repeats the stop. Prints only afterwards, because the output may block.
    repeating.after(SessionOptions().stop_linger, [&] { io.stop(); });
  });
  io.run();
  const LinkStatus link = board->link();
  const std::vector<PathStatus> paths = board->paths();
  board->close();
  const bool confirmed = result && result->outcome == Outcome::confirmed;
  if (confirmed) print_confirmed(options, *result);
  tell_paths_down(paths, options.json);
  if (!confirmed) {
    Problem problem = explain(Command::stop(), result.value_or(CommandResult()), link);
    problem.thing = fmt::format("E:STOP to {}", board->name());
    throw Error(problem);
  }
  // The stop was sent to both boards, and one has confirmed it.
  if (link.causes.has_any({LinkCause::two_boards, LinkCause::other_board})) {
    throw Error(explain(paths));
  }
  return 0;
}

constexpr const char* stop_footer =
    R"(The stop works even if another host controls the board, and does not wait for a link. r4 repeats the stop
every 20 ms until the board reports that it has obeyed this stop, and for a moment longer. The board stays
stopped until E:CLEAR. The program in control can send E:CLEAR, also by arm(). If the URLs are paths to one
board, one working path is enough.

Examples:
  r4 stop udp://192.168.0.125
  r4 stop serial:auto udp://192.168.0.125

Exit codes: 0 the board reports that it has stopped; 3 the board did not confirm the stop: cut the power;
or the URLs lead to two boards, and r4 sent the stop to both; 4, 5 the transport cannot be opened: cut the
power.)";

}  // namespace

void add_stop(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<StopOptions>();
  CLI::App* const command = add_subcommand(
      root, chosen, "stop", "Emergency stop: all outputs off, now", stop_footer, options, stop);
  add_paths(*command, options->urls);
  add_seconds(*command, "--timeout", options->timeout,
              "how long to repeat an unconfirmed stop (default 2); r4 always sends it",
              Zero::allowed);
  add_text(*command, "--key", options->key, "not needed: a board obeys a stop from any host",
           file_type);
  add_json(*command, options->json, "print JSON");
}

}  // namespace r4::tool
