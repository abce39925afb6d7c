// SPDX-License-Identifier: GPL-3.0-or-later
// Reads samples from the graph on its own thread and passes them to the boards' loop.
// Newer samples of a subscription replace waiting samples. On average the loop takes samples at
// most every 10 ms, so a flood delays heartbeats by only a few turns. Stops are taken at once.
#pragma once

#include <dds/dds.h>

#include <array>
#include <asio/io_context.hpp>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "entity.hpp"
#include "tools/r4/boards/timer.hpp"
#include "transit.hpp"

namespace r4::tool::ros2 {

struct Origin {
  std::uint64_t publisher = 0;  // unique
  EntityId writer{};            // the same after a reconnect; 0: unknown, because the writer left
  std::chrono::steady_clock::time_point written;  // by our clock, as far as known (Transit)
};

class Inbox {
 public:
  // Calls `on_drained` on the loop when no sample waits. A participant must exist.
  Inbox(asio::io_context& io, Transit::Clocks clocks, std::function<void()> on_drained);
  ~Inbox() { stop(); }
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;

  template <class Message, class Value>
  struct Subscription {
    dds_entity_t reader = 0;
    std::size_t room = 1;  // samples that may wait; the oldest is dropped
    // `read` (empty: malformed) and `urgent` (true: take it immediately) run on the reading thread.
    // `take` and `left` (after a publisher has left: the remaining publishers) run on the loop.
    std::function<std::optional<Value>(const Message&)> read;
    std::function<bool(const Value&)> urgent;
    std::function<void(const Value&, const Origin&)> take;
    std::function<void(const std::vector<std::uint64_t>&)> left;
  };
  // Call before start(), or on the reading thread.
  template <class Message, class Value>
  void add(Subscription<Message, Value> subscription);
  // Calls `look` on the reading thread while `entity` has data.
  void watch(dds_entity_t entity, std::function<void()> look);

  void start();
  // Ends the thread; no callback follows. Idempotent.
  void stop();
  std::uint64_t malformed() const { return malformed_; }
  std::uint64_t dropped() const { return dropped_; }

 private:
  using Clock = std::chrono::steady_clock;
  enum class Kind : std::uint8_t {
    sample,
    urgent,      // never dropped for another sample
    publishers,  // newest list of publishers, after the samples of departed publishers
  };
  struct Waiting {
    std::uint64_t order = 0;
    Kind kind = Kind::sample;
    std::function<void()> deliver;
  };
  struct Source {
    std::function<void()> look;
    Entity condition;
    std::deque<Waiting> waiting;
    std::size_t room = 1;
    struct Publisher {
      EntityId writer;
      Transit transit;
    };
    std::map<std::uint64_t, Publisher> publishers;
  };

  template <class Message, class Value>
  void receive(const Subscription<Message, Value>& subscription, Source& source);
  Source::Publisher& publisher_of(dds_entity_t reader, Source& source,
                                  dds_instance_handle_t publication) const;
  Origin origin_of(dds_entity_t reader, Source& source, const dds_sample_info_t& info) const;
  void look_at_publishers(dds_entity_t reader, Source& source,
                          const std::function<void(const std::vector<std::uint64_t>&)>& left);
  void put(Source& source, Kind kind, std::function<void()> deliver);
  Source& add_source();
  void attach(dds_entity_t entity);
  void run();
  void on_posted();
  void drain();

  static constexpr std::size_t most_at_once = 16;

  asio::io_context& io_;
  const Transit::Clocks clocks_;
  const std::function<void()> on_drained_;
  Entity waitset_;
  Entity end_;
  std::vector<std::unique_ptr<Source>> sources_;  // the reading thread adds sources under the mutex
  std::thread thread_;
  std::atomic<std::uint64_t> malformed_{0};
  std::atomic<std::uint64_t> dropped_{0};

  std::mutex mutex_;  // protects the waiting samples
  std::uint64_t order_ = 0;
  bool posted_ = false;
  bool urgent_ = false;
  bool ended_ = false;

  // Used on the loop's thread:
  Timer timer_;
  Clock::time_point next_{};
};

template <class Message, class Value>
void Inbox::add(Subscription<Message, Value> subscription) {
  Source& source = add_source();
  source.room = subscription.room;
  source.condition =
      Entity(dds_create_readcondition(subscription.reader, DDS_ANY_STATE), "a subscription");
  (void)dds_set_status_mask(subscription.reader, DDS_SUBSCRIPTION_MATCHED_STATUS);
  const auto entity = subscription.reader;
  source.look = [this, &source, subscription = std::move(subscription)] {
    receive(subscription, source);
    look_at_publishers(subscription.reader, source, subscription.left);
  };
  attach(source.condition.get());
  attach(entity);
}

template <class Message, class Value>
void Inbox::receive(const Subscription<Message, Value>& subscription, Source& source) {
  std::array<void*, most_at_once> samples{};
  std::array<dds_sample_info_t, most_at_once> infos{};
  const dds_return_t count =
      dds_take(subscription.reader, samples.data(), infos.data(), most_at_once, most_at_once);
  if (count <= 0) return;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    if (!infos[i].valid_data) continue;
    const Origin origin = origin_of(subscription.reader, source, infos[i]);
    std::optional<Value> value = subscription.read(*static_cast<const Message*>(samples[i]));
    if (!value) {
      ++malformed_;
      continue;
    }
    const bool urgent = subscription.urgent && subscription.urgent(*value);
    put(source, urgent ? Kind::urgent : Kind::sample,
        [take = subscription.take, value = std::move(*value), origin] { take(value, origin); });
  }
  (void)dds_return_loan(subscription.reader, samples.data(), count);
}

}  // namespace r4::tool::ros2
