// SPDX-License-Identifier: GPL-3.0-or-later
#include "impaired_carrier.hpp"

#include <algorithm>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "../board_end.hpp"
#include "../operation_slot.hpp"

namespace r4 {
namespace {

using Clock = std::chrono::steady_clock;

Time now() { return std::chrono::duration_cast<Time>(Clock::now().time_since_epoch()); }

class Impaired final : public ImpairedCarrier, public BoardEnd, private Carrier::Handler {
 public:
  Impaired(asio::io_context& io, std::unique_ptr<Carrier> below, const Impairment& impairment)
      : below_(std::move(below)), end_(board_end_of(*below_)), impairment_(impairment), timer_(io) {
    begin();
  }
  ~Impaired() override { close(); }

  void open(Carrier::Handler& handler) override {
    close();
    begin();
    handler_ = &handler;
    try {
      below_->open(*this);
    } catch (...) {
      close();
      throw;
    }
  }
  void close() noexcept override {
    handler_ = nullptr;
    waiting_.cancel();
    below_->close();
  }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    if (!below_->up()) return below_->send(bytes, priority, to);
    out_->put(now(), {std::string(bytes), to, static_cast<std::uint8_t>(priority)});
    pass();
    return SendResult::sent;
  }
  void hold(Peer peer) override { end_.hold(peer); }
  void also_hold(Peer peer) override { end_.also_hold(peer); }
  bool reaches(Peer peer) const override { return end_.reaches(peer); }
  void use_packed_form(bool wanted) override { end_.use_packed_form(wanted); }
  bool is_own_cable() const override { return end_.is_own_cable(); }
  bool is_shared() const override { return below_->is_shared(); }
  void change_role(BoardRole role) override { below_->change_role(role); }
  bool up() const override { return below_->up(); }
  TransportTrouble trouble() const override { return below_->trouble(); }
  const std::string& name() const override { return below_->name(); }
  const CarrierCounters& counters() const override { return below_->counters(); }
  const ImpairmentCounters& received() const override { return in_->counters(); }
  const ImpairmentCounters& sent() const override { return out_->counters(); }

 private:
  void begin() {
    in_.emplace(impairment_, 1, now());
    out_.emplace(impairment_, 2, now());
  }

  void on_datagram(std::string_view bytes, Peer from) override {
    in_->put(now(), {std::string(bytes), from, 0});
    deliver();
    if (handler_ != nullptr) pass();
  }
  void on_carrier_event(const CarrierEvent& event) override { handler_->on_carrier_event(event); }
  void on_drained() override { handler_->on_drained(); }
  void on_overheard(std::string_view bytes) override { handler_->on_overheard(bytes); }
  void on_oversize(std::string_view beginning) override { handler_->on_oversize(beginning); }

  void deliver() {
    while (handler_ != nullptr) {
      const auto item = in_->take(now());
      if (!item) return;
      handler_->on_datagram(item->bytes, item->peer);
    }
  }

  void pass() {
    while (const auto item = out_->take(now())) {
      below_->send(item->bytes, static_cast<Priority>(item->priority), item->peer);
    }
    const std::optional<Time> in = in_->due();
    const std::optional<Time> out = out_->due();
    if (!in && !out) return;
    const Time next = in && out ? std::min(*in, *out) : in ? *in : *out;
    timer_.expires_at(Clock::time_point(next));
    timer_.async_wait(waiting_.handler([this] {
      const bool any = in_->due() && *in_->due() <= now();
      deliver();
      if (any && handler_ != nullptr) handler_->on_drained();
      if (handler_ != nullptr) pass();
    }));
  }

  const std::unique_ptr<Carrier> below_;
  BoardEnd& end_;
  const Impairment impairment_;
  LoopTimer timer_;
  OperationSlot waiting_;
  Carrier::Handler* handler_ = nullptr;
  std::optional<ImpairedDirection> in_, out_;
};

}  // namespace

std::unique_ptr<ImpairedCarrier> make_impaired_carrier(asio::io_context& io,
                                                       std::unique_ptr<Carrier> below,
                                                       const Impairment& impairment) {
  return std::make_unique<Impaired>(io, std::move(below), impairment);
}

}  // namespace r4
