// SPDX-License-Identifier: GPL-3.0-or-later
#include "inbox.hpp"

#include <algorithm>
#include <asio/post.hpp>

namespace r4::tool::ros2 {
namespace {

constexpr std::chrono::milliseconds turn{10};
constexpr int turns_saved = 3;                // most turns that a quiet time saves
constexpr std::size_t most_publishers = 256;  // distinguished publishers of a topic

EntityId writer_of(dds_entity_t reader, dds_instance_handle_t publication) {
  dds_builtintopic_endpoint_t* const data = dds_get_matched_publication_data(reader, publication);
  if (data == nullptr) return {};
  const EntityId id = id_from(data->key);
  dds_builtintopic_free_endpoint(data);
  return id;
}

}  // namespace

Inbox::Inbox(asio::io_context& io, Transit::Clocks clocks, std::function<void()> on_drained)
    : io_(io),
      clocks_(clocks),
      on_drained_(std::move(on_drained)),
      waitset_(dds_create_waitset(DDS_CYCLONEDDS_HANDLE), "the reading thread"),
      end_(dds_create_guardcondition(DDS_CYCLONEDDS_HANDLE), "the reading thread"),
      timer_(io) {
  (void)dds_waitset_attach(waitset_.get(), end_.get(), 0);
}

Inbox::Source& Inbox::add_source() {
  const std::lock_guard lock(mutex_);
  return *sources_.emplace_back(std::make_unique<Source>());
}

void Inbox::watch(dds_entity_t entity, std::function<void()> look) {
  Source& source = add_source();
  source.look = std::move(look);
  source.condition = Entity(dds_create_readcondition(entity, DDS_ANY_STATE), "a subscription");
  attach(source.condition.get());
}

void Inbox::attach(dds_entity_t entity) {
  (void)dds_waitset_attach(waitset_.get(), entity, static_cast<dds_attach_t>(sources_.size()));
}

void Inbox::start() {
  thread_ = std::thread([this] { run(); });
}

void Inbox::stop() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  (void)dds_set_guardcondition(end_.get(), true);
  if (thread_.joinable()) thread_.join();
  timer_.cancel();
}

void Inbox::run() {
  std::array<dds_attach_t, 32> triggered{};
  for (;;) {
    const dds_return_t count =
        dds_waitset_wait(waitset_.get(), triggered.data(), triggered.size(), DDS_INFINITY);
    bool end = false;
    (void)dds_read_guardcondition(end_.get(), &end);
    if (end || count < 0) return;
    const std::size_t told = std::min(static_cast<std::size_t>(count), triggered.size());
    for (std::size_t i = 0; i < told; ++i) {
      const auto number = static_cast<std::size_t>(triggered[i]);  // from 1; 0 ends the thread
      if (number != 0) sources_[number - 1]->look();
    }
  }
}

Inbox::Source::Publisher& Inbox::publisher_of(dds_entity_t reader, Source& source,
                                              dds_instance_handle_t publication) const {
  const auto known = source.publishers.find(publication);
  if (known != source.publishers.end()) {
    Source::Publisher& publisher = known->second;
    if (publisher.writer == EntityId{}) publisher.writer = writer_of(reader, publication);
    return publisher;
  }
  const Source::Publisher publisher{writer_of(reader, publication), Transit(clocks_)};
  return source.publishers.emplace(publication, publisher).first->second;
}

Origin Inbox::origin_of(dds_entity_t reader, Source& source, const dds_sample_info_t& info) const {
  const auto now = std::chrono::nanoseconds(dds_time());
  Source::Publisher& publisher = publisher_of(reader, source, info.publication_handle);
  const auto delay = publisher.transit.delay(std::chrono::nanoseconds(info.source_timestamp), now);
  return {info.publication_handle, publisher.writer,
          Clock::now() - std::chrono::duration_cast<Clock::duration>(delay)};
}

void Inbox::look_at_publishers(dds_entity_t reader, Source& source,
                               const std::function<void(const std::vector<std::uint64_t>&)>& left) {
  dds_subscription_matched_status_t status{};
  if (dds_get_subscription_matched_status(reader, &status) < 0) return;
  if (status.current_count_change == 0 && status.total_count_change == 0) return;
  std::vector<std::uint64_t> there(most_publishers);
  const dds_return_t count = dds_get_matched_publications(reader, there.data(), there.size());
  there.resize(
      std::clamp<std::size_t>(count < 0 ? 0 : static_cast<std::size_t>(count), 0, most_publishers));
  // A departed publisher may have left an unread sample.
  for (const dds_instance_handle_t each : there) publisher_of(reader, source, each);
  if (source.publishers.size() > most_publishers) {
    std::erase_if(source.publishers, [&there](const auto& each) {
      return std::find(there.begin(), there.end(), each.first) == there.end();
    });
  }
  if (left) put(source, Kind::publishers, [left, there = std::move(there)] { left(there); });
}

void Inbox::put(Source& source, Kind kind, std::function<void()> deliver) {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  std::deque<Waiting>& waiting = source.waiting;
  if (kind == Kind::publishers) {
    std::erase_if(waiting, [](const Waiting& each) { return each.kind == Kind::publishers; });
  } else {
    const auto is_sample = [](const Waiting& each) { return each.kind != Kind::publishers; };
    if (static_cast<std::size_t>(std::count_if(waiting.begin(), waiting.end(), is_sample)) ==
        source.room) {
      ++dropped_;
      const auto oldest = std::find_if(waiting.begin(), waiting.end(), [](const Waiting& each) {
        return each.kind == Kind::sample;
      });
      if (oldest == waiting.end()) return;
      waiting.erase(oldest);
    }
  }
  waiting.push_back({order_++, kind, std::move(deliver)});
  const bool urgent = kind == Kind::urgent;
  urgent_ = urgent_ || urgent;
  if (posted_ && !urgent) return;
  posted_ = true;
  asio::post(io_, [this] { on_posted(); });
}

void Inbox::on_posted() {
  bool urgent = false;
  {
    const std::lock_guard lock(mutex_);
    if (ended_) return;
    urgent = urgent_;
  }
  const Clock::time_point now = Clock::now();
  if (urgent || now >= next_) {
    drain();
    return;
  }
  timer_.at(next_, [this] { drain(); });
}

void Inbox::drain() {
  std::vector<Waiting> all;
  {
    const std::lock_guard lock(mutex_);
    posted_ = urgent_ = false;
    for (const auto& source : sources_) {
      std::move(source->waiting.begin(), source->waiting.end(), std::back_inserter(all));
      source->waiting.clear();
    }
  }
  if (all.empty()) return;
  // Urgent samples are taken immediately and delay other samples by at most one turn.
  const Clock::time_point now = Clock::now();
  next_ = std::min(std::max(next_, now - turns_saved * turn), now) + turn;
  std::sort(all.begin(), all.end(), [](const Waiting& a, const Waiting& b) {
    const bool a_first = a.kind == Kind::urgent;
    const bool b_first = b.kind == Kind::urgent;
    return a_first != b_first ? a_first : a.order < b.order;
  });
  for (const Waiting& each : all) each.deliver();
  on_drained_();
}

}  // namespace r4::tool::ros2
