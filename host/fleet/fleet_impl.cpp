// SPDX-License-Identifier: GPL-3.0-or-later
#include "fleet_impl.hpp"

#include <asio/post.hpp>
#include <asio/use_future.hpp>
#include <utility>

#include "../session/session.hpp"
#include "r4link/control/boot_clock.hpp"
#include "r4link/discovery/url_pattern.hpp"

namespace r4 {

namespace {

// Each datagram would wake the thread, so in a busy window the thread waits and takes several.
constexpr std::chrono::milliseconds window{10};
constexpr std::size_t busy_window = 200;
constexpr std::chrono::microseconds breather{200};

std::vector<std::string> urls_of(const std::vector<std::string>& patterns) {
  std::vector<std::string> urls;
  for (PatternUrl& each : expand_urls(patterns)) urls.push_back(std::move(each.url));
  if (urls.empty()) {
    throw Error(ErrorKind::usage, "a fleet", "the fleet has no boards", "name at least one URL");
  }
  return urls;
}

}  // namespace

Fleet::Impl::Impl(const std::vector<std::string>& patterns, BoardOptions options)
    // Other threads only post to the loop, so its reactor needs no locks.
    : BlockingLoop({"fleet", "give this program more processor time"},
                   ASIO_CONCURRENCY_HINT_UNSAFE_IO, std::exchange(options.on_wait, nullptr)),
      role(options.role),
      urls(urls_of(patterns)) {
  boards.reserve(urls.size());
  links.resize(urls.size());
  for (std::size_t i = 0; i < urls.size(); ++i) {
    all_boards.push_back(i);
    boards.push_back(std::make_unique<AsyncBoard>(io, urls[i], options));
    listen(i);
  }
  start([this] { run(); });
  try {
    // Opens the boards on the loop, so that resolving a name does not delay open boards.
    asio::post(io, asio::use_future([this] {
                 for (const auto& board : boards) board->open();
               }))
        .get();
  } catch (...) {
    close();
    throw;
  }
}

void Fleet::Impl::close() {
  std::vector<AsyncBoard*> all;
  for (const auto& board : boards) all.push_back(board.get());
  BlockingLoop::close(all);
}

void Fleet::Impl::run() {
  auto since = Clock::now();
  std::size_t handled = 0;
  bool busy = false;
  while (io.run_one() != 0) {
    handled += 1 + io.poll();
    const auto now = Clock::now();
    if (now - since >= window) {
      busy = handled >= busy_window && now - since < 2 * window;
      since = now;
      handled = 0;
    }
    if (busy) std::this_thread::sleep_for(breather);
  }
}

void Fleet::Impl::listen(std::size_t board) {
  AsyncBoard& async = *boards[board];
  const auto reports = [this, board](FleetEvent::Kind kind, auto FleetEvent::*part) {
    return [this, board, kind, part](const auto& fresh) {
      FleetEvent event{kind, board};
      event.*part = fresh;
      notify(std::move(event));
    };
  };
  async.on_link(reports(FleetEvent::Kind::link, &FleetEvent::link));
  async.on_event(reports(FleetEvent::Kind::transport, &FleetEvent::transport));
  async.on_arming(reports(FleetEvent::Kind::arming, &FleetEvent::disarmed_by));
  async.on_refused(reports(FleetEvent::Kind::refused, &FleetEvent::refused));
  async.on_restart([this, board] { notify({FleetEvent::Kind::restart, board}); });
}

void Fleet::Impl::notify(FleetEvent event) {
  const std::lock_guard lock(mutex);
  if (event.kind == FleetEvent::Kind::link) links[event.board] = event.link;
  if (events.size() == most_events) {
    events.pop_front();
    ++missed_events;
  }
  events.push_back(std::move(event));
  news.notify_all();
}

BoardHealth Fleet::Impl::health_of(std::size_t board) const {
  const AsyncBoard& async = *boards[board];
  BoardHealth health;
  health.board = board;
  health.url = urls[board];
  health.identity = async.identity();
  health.link = async.link();
  health.in_control = async.in_control();
  health.disarmed_by = async.disarmed_by();
  health.statistics = async.statistics();
  if (std::vector<PathStatus> paths = async.paths(); paths.size() > 1)
    health.paths = std::move(paths);
  return health;
}

void Fleet::Impl::require_board(std::size_t board) const {
  if (board < boards.size()) return;
  throw Error(ErrorKind::usage, "board " + std::to_string(board), "the fleet has no such board",
              "give 0 to " + std::to_string(boards.size() - 1));
}

Fleet::Impl::CallPtr Fleet::Impl::call_of(std::string text, const Boards& which, Start start,
                                          bool stop) {
  std::vector<AsyncBoard*> called;
  for (const std::size_t board : which) {
    require_board(board);
    called.push_back(boards[board].get());
  }
  return std::make_shared<Call>(std::move(text), std::move(start), called, stop);
}

FleetResults Fleet::Impl::execute(std::string text, const Boards& which, Duration timeout,
                                  Start start, const Why& why, bool stop) {
  const CallPtr call = call_of(std::move(text), which, std::move(start), stop);
  BlockingLoop::run(call, timeout);
  std::vector<FleetResult> results;
  for (const Part& part : call->parts) {
    const std::size_t index = results.size();
    FleetResult& mine = results.emplace_back();
    mine.board = which[index];
    mine.result = part.result;
    if (mine.confirmed()) continue;
    mine.problem = part.trouble                             ? *part.trouble
                   : part.result.outcome == Outcome::closed ? closed_error(call->text).problem()
                                                            : why(index, part.result, part.link);
    mine.problem.thing = urls[mine.board] + ": " + mine.problem.thing;
  }
  return FleetResults(std::move(results));
}

void Fleet::Impl::run_on_loop(std::string_view what, const std::function<void()>& action) {
  if (!BlockingLoop::run_on_loop(what, action)) throw closed_error(what);
}

Fleet::Boards Fleet::Impl::wait_active(const Boards& which, Duration timeout) {
  Boards missing;
  const auto all_active = [&] {
    missing.clear();
    for (const std::size_t board : which) {
      if (!is_ready(role, links[board])) missing.push_back(board);
    }
    return missing.empty();
  };
  const SleepWatch slept;
  if (wait_for_news([] { return "wait_active()"; }, timeout, all_active)) return {};
  // The deadline does not advance while this computer sleeps.
  return slept.time() > bounded(timeout) ? which : missing;
}

std::optional<FleetEvent> Fleet::Impl::next_event(Duration timeout) {
  std::unique_lock lock(mutex);
  wait_until(lock, news, Clock::now() + bounded(timeout), on_wait,
             [this] { return closed || !events.empty(); });
  if (missed_events != 0) {
    FleetEvent event{FleetEvent::Kind::missed};
    event.count = std::exchange(missed_events, 0);
    return event;
  }
  if (events.empty()) {
    if (closed) throw closed_error("next_event()");
    return {};
  }
  FleetEvent event = std::move(events.front());
  events.pop_front();
  return event;
}

FleetResults Fleet::Impl::stop(const Boards& which, Duration timeout) {
  const Command stop = Command::stop();
  return execute(shown(stop), which, std::max(timeout, Duration{1}), start_of(OwnCommand(stop)),
                 why_of(stop), true);
}

void Fleet::Impl::stop_async(const Boards& which) {
  run_unawaited(call_of("E:STOP", which, start_of(OwnCommand(Command::stop())), true));
}

}  // namespace r4
