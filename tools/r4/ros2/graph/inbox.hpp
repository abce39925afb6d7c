// SPDX-License-Identifier: GPL-3.0-or-later
// What comes from the graph, read by a thread of its own and handed to the loop of the boards.
//
// The thread waits for samples, judges their form, and puts them into a queue with little room, in which the newest
// of a subscription wins. The loop takes them out at once, but on average not more often than every 10 ms: however
// many flood in, a board's heartbeats wait for no more than a few such turns. What is urgent, a stop, is always
// taken at once.
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

// Who wrote a sample, and when.
struct Origin {
  std::uint64_t publisher = 0;  // never the same for two
  EntityId writer{};            // the same when it is back; 0: unknown, it has gone
  std::chrono::steady_clock::time_point written;  // by our clock, as far as it is known (Transit)
};

class Inbox {
 public:
  // `clocks`: ours and that of who writes. `on_drained`: called on the loop when it has taken what
  // there was. There is a participant already.
  Inbox(asio::io_context& io, Transit::Clocks clocks, std::function<void()> on_drained);
  ~Inbox() { stop(); }
  Inbox(const Inbox&) = delete;
  Inbox& operator=(const Inbox&) = delete;

  template <class Message, class Value>
  struct Subscription {
    dds_entity_t reader = 0;
    std::size_t room = 1;  // samples that may wait; the oldest goes
    // On the reading thread: none for a sample that is not well formed.
    std::function<std::optional<Value>(const Message&)> read;
    // On the reading thread: is it to be taken at once?
    std::function<bool(const Value&)> urgent;
    // On the loop.
    std::function<void(const Value&, const Origin&)> take;
    // On the loop, when a publisher has gone: those that are left.
    std::function<void(const std::vector<std::uint64_t>&)> left;
  };
  // Before start(), or on the reading thread.
  template <class Message, class Value>
  void add(Subscription<Message, Value> subscription);
  // `look` is called on the reading thread while `entity` has something to be read.
  void watch(dds_entity_t entity, std::function<void()> look);

  void start();
  // Ends the thread; nothing is handed over after that. Idempotent.
  void stop();
  // Samples that were not well formed, or found no room.
  std::uint64_t malformed() const { return malformed_; }
  std::uint64_t dropped() const { return dropped_; }

 private:
  using Clock = std::chrono::steady_clock;
  enum class Kind : std::uint8_t {
    sample,
    urgent,      // never dropped for another sample
    publishers,  // the newest of a subscription counts, behind the samples of who has gone
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
  // To the newest source.
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
  std::vector<std::unique_ptr<Source>> sources_;  // the reading thread adds to it under the mutex
  std::thread thread_;
  std::atomic<std::uint64_t> malformed_{0};
  std::atomic<std::uint64_t> dropped_{0};

  std::mutex mutex_;  // of what waits
  std::uint64_t order_ = 0;
  bool posted_ = false;
  bool urgent_ = false;
  bool ended_ = false;

  // Of the loop's thread.
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
