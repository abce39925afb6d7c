// SPDX-License-Identifier: GPL-3.0-or-later
#include "fleet_impl.hpp"

#include <asio/post.hpp>
#include <exception>
#include <utility>

#include "../../transports/url_pattern.hpp"
#include "../measurement/boot_clock.hpp"

namespace r4 {

namespace {

// Where more than this happens in a window, each datagram of hundreds of boards would wake the thread: then it looks
// again after a pause, and finds several.
constexpr std::chrono::milliseconds window{10};
constexpr std::size_t busy_window = 200;
constexpr std::chrono::microseconds breather{200};

std::vector<std::string> urls_of(const std::vector<std::string>& patterns) {
  std::vector<std::string> urls;
  for (PatternUrl& each : expand_urls(patterns)) urls.push_back(std::move(each.url));
  if (urls.empty()) {
    throw Error(ErrorKind::usage, "a fleet", "it has no boards", "name at least one URL");
  }
  return urls;
}

}  // namespace

Fleet::Impl::Impl(const std::vector<std::string>& patterns, BoardOptions options)
    // Other threads do nothing on it but post: what the reactor does needs no locks.
    : BlockingLoop({"fleet", "see that this computer has time for it"},
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
  // On the loop, where no name that is looked up holds the others up.
  std::exception_ptr trouble;
  asio::post(io, [&] {
    try {
      for (const auto& board : boards) board->open();
    } catch (...) {
      trouble = std::current_exception();
    }
    const std::lock_guard lock(mutex);
    opened = true;
    news.notify_all();
  });
  {
    std::unique_lock lock(mutex);
    news.wait(lock, [this] { return opened; });
  }
  if (!trouble) return;
  close();
  std::rethrow_exception(trouble);
}

void Fleet::Impl::close() {
  BlockingLoop::close([this] { shut(); });
}

// --- on the loop

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
  async.on_link([this, board](const LinkStatus& fresh) {
    {
      const std::lock_guard lock(mutex);
      links[board] = fresh;
    }
    FleetEvent event{FleetEvent::Kind::link, board};
    event.link = fresh;
    tell(std::move(event));
  });
  async.on_event([this, board](const CarrierEvent& fresh) {
    FleetEvent event{FleetEvent::Kind::transport, board};
    event.transport = fresh;
    tell(std::move(event));
  });
  async.on_arming([this, board](DisarmCause fresh) {
    FleetEvent event{FleetEvent::Kind::arming, board};
    event.disarmed_by = fresh;
    tell(std::move(event));
  });
  async.on_restart([this, board] { tell({FleetEvent::Kind::restart, board}); });
  async.on_refused([this, board](const RefusedPost& fresh) {
    FleetEvent event{FleetEvent::Kind::refused, board};
    event.refused = fresh;
    tell(std::move(event));
  });
}

void Fleet::Impl::tell(FleetEvent event) {
  {
    const std::lock_guard lock(mutex);
    if (events.size() == most_events) {
      events.pop_front();
      ++missed_events;
    }
    events.push_back(std::move(event));
  }
  news.notify_all();
}

void Fleet::Impl::finish(Call& call, std::size_t at, const CommandResult& result) {
  FleetResult& mine = call.results[at];
  mine.result = result;
  const std::string& url = urls[mine.board];
  if (result.outcome == Outcome::confirmed) {
    mine.problem = {};
  } else if (result.outcome == Outcome::closed) {
    mine.problem = closed_error(call.text).problem();
  } else if (mine.problem.reason.empty()) {
    mine.problem = explain(call.text, result, boards[mine.board]->link());
  }
  if (!mine.confirmed()) mine.problem.thing = url + ": " + mine.problem.thing;
  BlockingLoop::finish(call, [] {});
}

void Fleet::Impl::shut() {
  if (!mark_closed([] {})) return;
  leaving = boards.size();
  for (const auto& board : boards) {
    board->async_close(farewell_limit, [this](const CommandResult&) {
      if (--leaving == 0) end_loop();
    });
  }
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

// --- on any thread

void Fleet::Impl::require_board(std::size_t board) const {
  if (board < boards.size()) return;
  throw Error(ErrorKind::usage, "board " + std::to_string(board), "the fleet has no such board",
              "they are 0 to " + std::to_string(boards.size() - 1));
}

std::shared_ptr<Fleet::Impl::Call> Fleet::Impl::call_of(std::string text, const Boards& which,
                                                        Start start, bool stop) {
  auto call = std::make_shared<Call>();
  call->text = std::move(text);
  call->stop = stop;
  call->boards = which;
  call->cancelled.resize(which.size());
  call->parts = which.size();
  for (const std::size_t board : which) {
    require_board(board);
    call->results.push_back({board, {}, {}});
  }
  call->start = [this, start = std::move(start)](const CallPtr& base, Duration left) {
    const auto begun = std::static_pointer_cast<Call>(base);
    for (std::size_t at = 0; at < begun->boards.size(); ++at) {
      BoundEnd end(begun->cancelled[at].slot(), End{this, begun, at});
      try {
        start(begun->boards[at], at, left, std::move(end));
      } catch (const Error& error) {
        begun->results[at].problem = error.problem();
        finish(*begun, at, CommandResult{Outcome::refused});
      }
    }
  };
  return call;
}

FleetResults Fleet::Impl::execute(std::string text, const Boards& which, Duration timeout,
                                  Start start, bool stop) {
  const auto call = call_of(std::move(text), which, std::move(start), stop);
  BlockingLoop::run(call, timeout);
  return FleetResults(call->results);
}

void Fleet::Impl::run_on_loop(std::string_view what, const std::function<void()>& action) {
  if (!BlockingLoop::run_on_loop(what, action)) throw closed_error(what);
}

Fleet::Boards Fleet::Impl::wait_active(const Boards& which, Duration timeout) {
  Boards missing;
  const auto all_active = [&] {
    missing.clear();
    for (const std::size_t board : which) {
      const LinkStatus& link = links[board];
      const bool active = role == BoardRole::watch ? is_heard(link.state)
                                                   : link.state == HostLinkState::active &&
                                                         link.in_control && !link.gated();
      if (!active) missing.push_back(board);
    }
    return missing.empty();
  };
  const SleepWatch slept;
  if (wait_for_news([] { return "wait_active()"; }, timeout, all_active)) return {};
  // The deadline stands still while this computer sleeps.
  return slept.time() > bounded(timeout) ? which : missing;
}

std::optional<FleetEvent> Fleet::Impl::next_event(Duration timeout) {
  std::unique_lock lock(mutex);
  wait_until(lock, news, Clock::now() + bounded(timeout),
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

Fleet::Impl::Start Fleet::Impl::start_of_stop() {
  return [this](std::size_t board, std::size_t, Duration left, BoundEnd end) {
    boards[board]->async_stop(left, std::move(end));
  };
}

FleetResults Fleet::Impl::stop(const Boards& which, Duration timeout) {
  FleetResults results =
      execute("E:STOP", which, std::max(timeout, Duration{1}), start_of_stop(), true);
  // Whoever does not wait for it any longer does not mean that it may be lost.
  if (!results.all_confirmed()) stop_async(results.failed());
  return results;
}

void Fleet::Impl::stop_async(const Boards& which) {
  run_unawaited(call_of("E:STOP", which, start_of_stop(), true));
}

}  // namespace r4
