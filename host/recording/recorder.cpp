// SPDX-License-Identifier: GPL-3.0-or-later
#include "recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <ctime>
#include <exception>
#include <utility>

#include "../../transports/file_descriptor.hpp"
#include "r4link/recordings/record_line.hpp"

namespace r4 {
namespace {

// A crash loses the records of this interval plus the disk's delay: less than a second.
constexpr std::chrono::milliseconds interval{250};
// Smallest recorded change of the wall clock. Smaller changes add up.
constexpr Time clock_step{std::chrono::milliseconds{100}};

// Signals are for the program's threads. SIGXFSZ (file size limit) would end the program.
class NoSignals {
 public:
  NoSignals() {
    sigset_t all;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~NoSignals() {
    sigset_t limit;
    ::sigemptyset(&limit);
    ::sigaddset(&limit, SIGXFSZ);
    const timespec at_once{};
    ::sigtimedwait(&limit, nullptr, &at_once);
    ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  NoSignals(const NoSignals&) = delete;
  NoSignals& operator=(const NoSignals&) = delete;

 private:
  sigset_t before_;
};

}  // namespace

Recorder::Recorder(const std::string& path, const RecordingOptions& options)
    : writer_(path, options), began_(wall_clock()) {
  waiting_.reserve(capacity);
  const NoSignals inherited;
  writer_.flush();
  with_system_errors(path, [&] { thread_ = std::thread([this] { run(); }); });
}

Recorder::~Recorder() { close(); }

Time Recorder::wall_clock() {
  return std::chrono::duration_cast<Time>(std::chrono::system_clock::now().time_since_epoch());
}

Time Recorder::steady_now() {
  return std::chrono::duration_cast<Time>(std::chrono::steady_clock::now().time_since_epoch());
}

// --- any thread

std::uint16_t Recorder::add_path(std::string url) {
  const std::lock_guard lock(mutex_);
  const auto number = static_cast<std::uint16_t>(paths_.size() + 1);
  paths_.push_back({number, std::move(url), {}});
  undeclared_.push_back(paths_.back());
  return number;
}

void Recorder::name_path(std::uint16_t path, std::string name) {
  const std::lock_guard lock(mutex_);
  RecordedPath& known = paths_[path - 1U];
  if (known.name == name) return;
  known.name = std::move(name);
  undeclared_.push_back(known);
}

void Recorder::add_device(RecordedDevice device) {
  const std::lock_guard lock(mutex_);
  if (closing_) return;
  undeclared_devices_.push_back(std::move(device));
}

void Recorder::record(std::uint16_t path, RecordKind kind, std::string_view bytes, Time at) {
  if (ended()) return;
  bytes = bytes.substr(0, max_record_bytes);
  const std::lock_guard lock(mutex_);
  if (closing_) return;
  const std::size_t before = waiting_.size();
  if (before + sizeof(Head) + bytes.size() > capacity) {
    ++dropped_;
    return;
  }
  const Head head{recorded(at), static_cast<std::uint32_t>(bytes.size()), path, kind};
  waiting_.resize(before + sizeof head + bytes.size());
  std::memcpy(&waiting_[before], &head, sizeof head);
  std::copy(bytes.begin(), bytes.end(), &waiting_[before + sizeof head]);
  ++records_;
  if (waiting_.size() > capacity / 2 && before <= capacity / 2) wanted_.notify_one();
}

void Recorder::close() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  wanted_.notify_one();
  const std::lock_guard lock(joining_);
  if (thread_.joinable()) thread_.join();
}

std::optional<Problem> Recorder::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}
std::optional<Problem> Recorder::news(unsigned& known) const {
  if (news_count() == known) return std::nullopt;
  const std::lock_guard lock(mutex_);
  known = news_count_;
  return news_;
}

// --- the writer's thread

void Recorder::run() {
  batch_.reserve(capacity);
  try {
    for (bool last = false; !last;) {
      std::vector<RecordedPath> fresh;
      std::vector<RecordedDevice> devices;
      {
        std::unique_lock lock(mutex_);
        wanted_.wait_for(lock, interval,
                         [this] { return closing_ || waiting_.size() > capacity / 2; });
        last = closing_;
        batch_.swap(waiting_);
        fresh.swap(undeclared_);
        devices.swap(undeclared_devices_);
      }
      for (const RecordedPath& path : fresh) writer_.declare(path);
      for (const RecordedDevice& device : devices) writer_.declare(device);
      written_until_ = last ? now() : now() - settled;
      write();
      record_dropped();
      record_set_clock();
      writer_.flush();
      record_new_file();
    }
    write_event("end");
    writer_.close();
    record_new_file();
  } catch (const Error& error) {
    report(error.problem(), true);
  } catch (const std::exception& error) {
    report({ErrorKind::open, writer_.path(), error.what(), "record again"}, true);
  }
  ended_ = true;
}

void Recorder::report(const Problem& trouble, bool is_problem) {
  const std::lock_guard lock(mutex_);
  if (is_problem) problem_ = trouble;
  news_ = trouble;
  ++news_count_;
}

// Writes records up to written_until_. Newer records wait, because earlier records may follow.
void Recorder::write() {
  order_.clear();
  put_in_order(unsettled_);
  put_in_order(batch_);
  std::stable_sort(order_.begin(), order_.end(),
                   [](const RecordAt& a, const RecordAt& b) { return a.head.time < b.head.time; });
  std::vector<char> rest;
  for (const auto& [head, at] : order_) {
    if (head.time <= written_until_) {
      writer_.append({head.time, head.path, head.kind, {at + sizeof head, head.size}});
    } else {
      rest.insert(rest.end(), at, at + sizeof head + head.size);
    }
  }
  unsettled_.swap(rest);
  batch_.clear();
}

void Recorder::put_in_order(const std::vector<char>& records) {
  for (std::size_t at = 0; at < records.size();) {
    RecordAt found{{}, &records[at]};
    std::memcpy(&found.head, found.at, sizeof found.head);
    at += sizeof found.head + found.head.size;
    order_.push_back(found);
  }
}

void Recorder::write_event(const std::string& text) {
  writer_.append({written_until_, no_path, RecordKind::event, text});
}

void Recorder::record_dropped() {
  const std::uint64_t all = dropped();
  if (all == recorded_dropped_) return;
  write_event(fmt::format("dropped {}", all - recorded_dropped_));
  recorded_dropped_ = all;
}

// A moved file is not a problem(), because no record is lost.
void Recorder::record_new_file() {
  const std::optional<Problem> trouble = writer_.take_trouble();
  if (!trouble) return;
  write_event("warning " + trouble->text());
  report(*trouble, trouble->kind == ErrorKind::data);
}

void Recorder::record_set_clock() {
  const Time set = wall_clock() - now();
  if (std::chrono::abs(set - recorded_clock_) < clock_step) return;
  write_event(fmt::format("clock {:+} us", set.count()));
  recorded_clock_ = set;
}

}  // namespace r4
