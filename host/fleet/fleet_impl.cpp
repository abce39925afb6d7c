// SPDX-License-Identifier: GPL-3.0-or-later
#include "fleet_impl.hpp"

#include <asio/post.hpp>
#include <exception>
#include <random>
#include <utility>

#include "../../transports/url_pattern.hpp"
#include "../measurement/boot_clock.hpp"

namespace r4 {

namespace {

// The session ends every command at its deadline, which is that of the call: more than this beyond it, the thread
// is held up.
constexpr std::chrono::milliseconds grace{500};

// So long does close() wait for the boards to say that they are free.
constexpr std::chrono::milliseconds farewell_limit{100};

// A day is as good as for ever, and cannot overflow.
Fleet::Duration bounded(Fleet::Duration timeout) {
  return std::clamp<Fleet::Duration>(timeout, Fleet::Duration{0}, std::chrono::hours{24});
}

// Where more than this happens in a window, each datagram of hundreds of boards would wake the thread: then it looks
// again after a pause, and finds several.
constexpr std::chrono::milliseconds window{10};
constexpr std::size_t busy_window = 200;
constexpr std::chrono::microseconds breather{200};

Error closed_error(std::string_view what) {
  return Error(Problem{ErrorKind::refused, std::string(what), "the fleet was closed",
                       "open it again with another Fleet", Outcome::closed});
}

// `instead`: what that means for what was asked.
Error blocked_error(std::string_view what, std::string_view instead,
                    std::string_view fix = "see that this computer has time for it") {
  return Error(Problem{ErrorKind::refused, std::string(what),
                       std::string(instead) + ": the fleet's thread does not answer",
                       std::string(fix), Outcome::blocked});
}

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
    : role(options.role), on_wait(std::move(options.on_wait)), urls(urls_of(patterns)) {
  options.on_wait = nullptr;
  boards.reserve(urls.size());
  links.resize(urls.size());
  for (std::size_t i = 0; i < urls.size(); ++i) {
    all_boards.push_back(i);
    boards.push_back(std::make_unique<AsyncBoard>(io, urls[i], options));
    listen(i);
  }
  thread = std::thread([this] { run(); });
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
  {
    const std::lock_guard lock(mutex);
    if (!closed) asio::post(io, [this] { shut(); });
  }
  const std::lock_guard lock(joining);
  if (thread.joinable()) thread.join();
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

// A stop is sent however late it is, and repeated.
void Fleet::Impl::begin(const CallPtr& call, Clock::time_point deadline) {
  auto left = std::chrono::ceil<Duration>(deadline - Clock::now());
  {
    const std::lock_guard lock(mutex);
    if (!call->stop && (call->abandoned || left <= Duration{0})) return;
    call->begun = true;
  }
  if (left <= Duration{0}) left = call->stop ? default_timeout : Duration{1};
  for (std::size_t at = 0; at < call->boards.size(); ++at) {
    BoundEnd end(call->cancelled[at].slot(), End{this, call, at});
    try {
      call->start(call->boards[at], at, left, std::move(end));
    } catch (const Error& error) {
      call->results[at].problem = error.problem();
      finish(*call, at, CommandResult{Outcome::refused});
    }
  }
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
  const std::lock_guard lock(mutex);
  if (--call.left == 0) call.ended.notify_all();
}

// After this, nothing more is put on the loop; what is on it is carried out, then the loop ends.
void Fleet::Impl::shut() {
  {
    const std::lock_guard lock(mutex);
    if (closed) return;
    closed = true;
  }
  news.notify_all();
  leaving = boards.size();
  for (const auto& board : boards) {
    board->async_close(farewell_limit, [this](const CommandResult&) {
      if (--leaving != 0) return;
      work.reset();
      // Twice around: the ends of commands that begin() finds closed come behind this one.
      asio::post(io, [this] { asio::post(io, [this] { io.stop(); }); });
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
  if (std::vector<Wire> wires = async.wires(); wires.size() > 1) health.wires = std::move(wires);
  return health;
}

// --- on any thread

void Fleet::Impl::require_board(std::size_t board) const {
  if (board < boards.size()) return;
  throw Error(ErrorKind::usage, "board " + std::to_string(board), "the fleet has no such board",
              "they are 0 to " + std::to_string(boards.size() - 1));
}

Fleet::Impl::CallPtr Fleet::Impl::call_of(std::string text, const Boards& which,
                                          Start start) const {
  auto call = std::make_shared<Call>();
  call->text = std::move(text);
  call->boards = which;
  call->start = std::move(start);
  call->cancelled.resize(which.size());
  call->left = which.size();
  for (const std::size_t board : which) {
    require_board(board);
    call->results.push_back({board, {}, {}});
  }
  return call;
}

FleetResults Fleet::Impl::execute(std::string text, const Boards& which, Duration timeout,
                                  Start start, bool stop) {
  const CallPtr call = call_of(std::move(text), which, std::move(start));
  call->stop = stop;
  const auto deadline = Clock::now() + bounded(timeout);
  std::unique_lock lock(mutex);
  if (closed) throw closed_error(call->text);
  asio::post(io, [this, call, deadline] { begin(call, deadline); });
  const auto is_done = [&] { return call->left == 0; };
  bool done = false;
  try {
    done = wait_until(lock, call->ended, deadline, is_done) ||
           (call->begun && wait_until(lock, call->ended, deadline + grace, is_done));
  } catch (...) {
    if (!lock.owns_lock()) lock.lock();
    call->abandoned = true;
    if (!closed) {
      asio::post(io, [call] {
        for (auto& each : call->cancelled) each.emit(asio::cancellation_type::terminal);
      });
    }
    throw;
  }
  if (!done) {
    call->abandoned = true;
    if (call->stop) {
      throw blocked_error(call->text, "not confirmed; it goes out when it can", stop_last_resort);
    }
    throw blocked_error(
        call->text, call->begun ? "not confirmed, it may have been executed or not" : "not sent");
  }
  return FleetResults(call->results);
}

void Fleet::Impl::run_on_loop(std::string_view what, const std::function<void()>& action) {
  struct Turn {
    std::condition_variable ended;
    bool begun = false;
    bool abandoned = false;
    bool done = false;
    std::exception_ptr trouble;
  };
  const auto turn = std::make_shared<Turn>();
  std::unique_lock lock(mutex);
  if (closed) throw closed_error(what);
  // `action` is the caller's, who is here as long as it runs.
  asio::post(io, [this, turn, &action] {
    {
      const std::lock_guard begin_lock(mutex);
      if (turn->abandoned) return;
      turn->begun = true;
    }
    try {
      action();
    } catch (...) {
      turn->trouble = std::current_exception();
    }
    const std::lock_guard end_lock(mutex);
    turn->done = true;
    turn->ended.notify_all();
  });
  const auto is_done = [&] { return turn->done; };
  if (!turn->ended.wait_for(lock, default_timeout, is_done)) {
    if (!turn->begun) {
      turn->abandoned = true;
      throw blocked_error(what, "not done");
    }
    turn->ended.wait(lock, is_done);
  }
  if (turn->trouble) std::rethrow_exception(turn->trouble);
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
    return closed || missing.empty();
  };
  const SleepWatch slept;
  std::unique_lock lock(mutex);
  wait_until(lock, news, Clock::now() + bounded(timeout), all_active);
  if (closed) throw closed_error("wait_active()");
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

// One number for the boards on CAN, which hear the same frames (can_bus.hpp).
Fleet::Impl::Start Fleet::Impl::start_of_stop() {
  std::random_device device;
  return
      [this, number = device() | 1U](std::size_t board, std::size_t, Duration left, BoundEnd end) {
        const bool on_a_bus = has_wire(urls[board], "can");
        AsyncBoard& async = *boards[board];
        async.start_stop(left, async.make_completion(std::move(end)),
                         on_a_bus ? std::optional<std::uint32_t>(number) : std::nullopt);
      };
}

FleetResults Fleet::Impl::stop(const Boards& which, Duration timeout) {
  const Start start = start_of_stop();
  FleetResults results = execute("E:STOP", which, std::max(timeout, Duration{1}), start, true);
  // Whoever does not wait for it any longer does not mean that it may be lost.
  if (!results.all_confirmed()) stop_async(results.failed(), start);
  return results;
}

void Fleet::Impl::stop_async(const Boards& which, Start start) {
  const CallPtr call = call_of("E:STOP", which, std::move(start));
  call->stop = true;
  const std::lock_guard lock(mutex);
  if (closed) return;
  asio::post(io, [this, call] { begin(call, Clock::now() + default_timeout); });
}

}  // namespace r4
