// SPDX-License-Identifier: GPL-3.0-or-later
#include "replay_carrier.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "../../protocol/datagram/numbers.hpp"
#include "../../transports/operation_slot.hpp"
#include "r4link/datagram.hpp"
#include "replay_records.hpp"

namespace r4 {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

// Records or file pieces per turn of the loop.
constexpr int steps_in_a_turn = 32;

double speed_of(const Url& url) {
  constexpr std::int32_t max = 100'000'000;
  const std::optional<std::string> text = url.get("speed");
  std::int32_t hundredths = 100;
  if (text && (!parse_hundredths(Text(*text), hundredths) || hundredths < 1 || hundredths > max)) {
    throw Error(ErrorKind::usage, url.text(), "speed " + *text + " is not a valid factor",
                "write replay:FILE?speed=0.5");
  }
  return hundredths / 100.0;
}

class ReplayCarrier final : public Carrier {
 public:
  ReplayCarrier(asio::io_context& io, const Url& url)
      : name_(url.text()),
        file_(url.host().empty() ? url.path() : std::string()),
        path_(static_cast<std::uint16_t>(url.get_number("path", 1, 65535, 1))),
        speed_(speed_of(url)),
        start_(ReplayStart::of(url.text(), url.get("from").value_or("0"))),
        timer_(io) {
    url.allow_only("speed path from");
    if (file_.empty()) {
      throw Error(ErrorKind::usage, name_, "does not name a recording", "write replay:drive.r4log");
    }
  }
  ~ReplayCarrier() override { close(); }

  void open(Carrier::Handler& handler) override {
    records_.emplace(name_, file_, path_, start_);
    handler_ = &handler;
    first_ = records_->next()->time;
    began_ = std::chrono::steady_clock::now();
    change(true, {});
    if (handler_ != nullptr) wait();
  }

  void close() noexcept override {
    handler_ = nullptr;
    playing_.cancel();
    timer_.cancel();
    up_ = false;
  }

  SendResult send(std::string_view bytes, Priority, Peer) override {
    if (!up_) return SendResult::down;
    ++counters_.tx_datagrams;
    counters_.tx_bytes += bytes.size();
    return SendResult::sent;
  }

  bool up() const override { return up_; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  SteadyTime due() const {
    const ReplayRecords::Item* const next = records_->next();
    if (next == nullptr) return began_;
    const std::chrono::duration<double, std::micro> later = (next->time - first_) / speed_;
    return began_ + std::chrono::duration_cast<std::chrono::steady_clock::duration>(later);
  }

  void wait() {
    timer_.expires_at(due());
    timer_.async_wait(playing_.handler([this] { play(); }));
  }

  void play() {
    const SteadyTime now = std::chrono::steady_clock::now();
    for (int i = 0; i < steps_in_a_turn && handler_ != nullptr; ++i) {
      if (records_->next() == nullptr) {
        if (!continue_reading()) return;
        continue;
      }
      if (due() > now) {
        handler_->on_drained();
        break;
      }
      play(records_->take());
    }
    if (handler_ != nullptr) wait();
  }

  // False if the recording has ended, which is then reported.
  bool continue_reading() {
    Problem end{ErrorKind::open, name_, "the recording has ended", "open it again"};
    try {
      if (records_->read_on()) return true;
    } catch (const Error& error) {
      end = error.problem();
    }
    handler_->on_drained();
    if (handler_ != nullptr) change(false, end);
    return false;
  }

  void play(const ReplayRecords::Item& next) {
    const std::string_view words = next.bytes;
    if (next.kind == RecordKind::from_board) {
      ++counters_.rx_datagrams;
      counters_.rx_bytes += words.size();
      handler_->on_datagram(words, everyone);
    } else if (words.starts_with("up ")) {
      if (!up_) change(true, {});
    } else if (words.starts_with("down ")) {
      if (up_) change(false, {ErrorKind::open, name_, std::string(words.substr(5)), ""});
    } else {
      handler_->on_carrier_event({CarrierEvent::Kind::warning,
                                  {ErrorKind::open, name_, std::string(words.substr(8)), ""}});
    }
  }

  void change(bool up, Problem problem) {
    up_ = up;
    ++(up ? counters_.ups : counters_.downs);
    if (up) problem.thing = name_;
    handler_->on_carrier_event({up ? CarrierEvent::Kind::up : CarrierEvent::Kind::down, problem});
  }

  const std::string name_;
  const std::string file_;
  const std::uint16_t path_;
  const double speed_;
  const ReplayStart start_;
  LoopTimer timer_;
  OperationSlot playing_;
  Carrier::Handler* handler_ = nullptr;
  bool up_ = false;
  CarrierCounters counters_;

  std::optional<ReplayRecords> records_;
  Time first_{0};  // of the first played record
  SteadyTime began_;
};

}  // namespace

std::unique_ptr<Carrier> make_replay_carrier(asio::io_context& io, const Url& url, Role role) {
  if (role == Role::board) {
    throw Error(ErrorKind::usage, url.text(), "a recording cannot listen",
                "give the board a transport to listen on, such as udp://:2018");
  }
  return std::make_unique<ReplayCarrier>(io, url);
}

}  // namespace r4
