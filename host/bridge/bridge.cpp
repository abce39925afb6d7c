// SPDX-License-Identifier: GPL-3.0-or-later
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/use_future.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

#include "../../transports/file_descriptor.hpp"
#include "../../transports/operation_slot.hpp"
#include "../standard_registry.hpp"
#include "bridge_urls.hpp"
#include "bridged_pair.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {

struct Bridge::Impl {
  Impl(std::string_view hosts, std::string_view board, BridgeOptions options)
      : on_event(std::move(options.on_event)) {
    if (options.timeout <= std::chrono::milliseconds(0)) {
      throw Error(ErrorKind::usage, "a bridge's timeout", "the timeout must be longer than 0 ms",
                  "give the board's timeout, which is 1000 ms by default");
    }
    if (options.keys.size() > max_keys) {
      throw Error(ErrorKind::usage, "a bridge's keys",
                  "there are " + std::to_string(options.keys.size()) +
                      " keys, and a board has at most " + std::to_string(max_keys),
                  "give the keys of the board");
    }
    if (options.open && !options.keys.empty()) {
      throw Error(ErrorKind::usage, "a bridge that is open to everyone",
                  "the bridge also has a key", "choose one: the key (--key, or R4_KEY), or --open");
    }
    for (const BridgedUrls& urls : pair_urls(hosts, board)) {
      const std::string scheme = Url::parse(urls.hosts).scheme();
      // A board obeys every datagram of its cable without a signature.
      const bool cable = Url::parse(urls.board).scheme() == "serial";
      if (cable && options.keys.empty()) permit(urls, options.open);
      BridgedPair::Setup setup;
      setup.keys = options.keys;
      setup.trusted = cable && !options.open;
      setup.hosts = standard_registry().make(io, urls.hosts, Role::board);
      setup.board = make_host_carrier(io, urls.board, BoardRole::control);
      // A device may be plugged in later. A listening port must exist at once.
      setup.hosts_may_be_away = scheme == "serial" || scheme == "can";
      setup.timeout = options.timeout;
      setup.on_event = [this, pair = pairs.size()](BridgeSide side, const CarrierEvent& event) {
        if (on_event) on_event({pair, side, event});
      };
      pairs.push_back(std::make_unique<BridgedPair>(std::move(setup)));
    }
    open();
  }

  ~Impl() { close(); }

  // Throws unless a bridge without a key may serve these hosts. An open bridge causes a warning.
  void permit(const BridgedUrls& urls, bool open) {
    const std::string danger = "every program that reaches the bridge may drive the board at " +
                               urls.board + ", which does not need a key at its cable";
    if (!open && !is_of_this_computer(urls.hosts)) {
      throw Error(ErrorKind::usage, urls.hosts, danger,
                  "give the bridge the board's key (--key FILE), or listen at udp://127.0.0.1; or "
                  "allow every program with --open");
    }
    if (!open || !on_event) return;
    const Problem warning{ErrorKind::usage, urls.hosts, "the bridge is open: " + danger,
                          "give the bridge the board's key instead: --key FILE"};
    on_event({pairs.size(), BridgeSide::hosts, {CarrierEvent::Kind::warning, warning}});
  }

  // Opens the pairs on the loop, so that resolving one name does not delay other pairs.
  void open() {
    tick_later();
    thread = std::thread([this] { io.run(); });
    try {
      on_loop([this] {
        for (const auto& pair : pairs) pair->open();
      });
    } catch (...) {
      close();
      throw;
    }
  }

  void close() {
    const std::lock_guard lock(mutex);
    if (!thread.joinable()) return;
    on_loop([this] {
      last = collect();
      for (const auto& pair : pairs) pair->close();
      ticking.cancel();
      io.stop();
    });
    thread.join();
  }

  std::vector<BridgeStatus> status() {
    const std::lock_guard lock(mutex);
    if (!thread.joinable()) return last;
    return on_loop([this] { return collect(); });
  }

  std::vector<BridgeStatus> collect() const {
    std::vector<BridgeStatus> all;
    all.reserve(pairs.size());
    for (const auto& pair : pairs) all.push_back(pair->status());
    return all;
  }

  template <class Action>
  std::invoke_result_t<Action> on_loop(Action action) {
    return asio::post(io, asio::use_future(std::move(action))).get();
  }

  void tick_later() {
    timer.expires_after(WaitingTime::tick_interval);
    timer.async_wait(ticking.handler([this] {
      for (const auto& pair : pairs) pair->tick();
      tick_later();
    }));
  }

  const std::function<void(const BridgeEvent&)> on_event;
  // Other threads only post to the loop, so the reactor needs no locks.
  asio::io_context io{ASIO_CONCURRENCY_HINT_UNSAFE_IO};
  LoopTimer timer{io};
  OperationSlot ticking;
  std::vector<std::unique_ptr<BridgedPair>> pairs;
  std::mutex mutex;  // between callers in different threads
  std::vector<BridgeStatus> last;
  std::thread thread;
};

Bridge::Bridge(std::string_view hosts, std::string_view board, BridgeOptions options)
    : impl_(with_system_errors("a bridge", [&] {
        require_watches();
        return std::make_unique<Impl>(hosts, board, std::move(options));
      })) {}
Bridge::~Bridge() = default;

void Bridge::close() { impl_->close(); }
std::size_t Bridge::size() const { return impl_->pairs.size(); }
std::vector<BridgeStatus> Bridge::status() const { return impl_->status(); }

}  // namespace r4
