// SPDX-License-Identifier: GPL-3.0-or-later
#include "memory_carrier.hpp"

#include <array>
#include <asio/post.hpp>
#include <chrono>
#include <cstring>

#include "operation_slot.hpp"
#include "r4link/datagram.hpp"
#include "send_queue.hpp"

namespace r4 {
namespace {

constexpr std::size_t normal_entries = 128;
constexpr std::size_t state_entries = 32;
constexpr int datagrams_in_a_turn = 64;  // then other work of the loop runs

class MemoryCarrier final : public Carrier {
 public:
  MemoryCarrier(asio::io_context& io, std::string name)
      : io_(io), name_(std::move(name)), inbox_(normal_entries, state_entries, dropped_) {}
  ~MemoryCarrier() override {
    close();
    if (other_ != nullptr) other_->other_ = nullptr;
  }

  static void join(MemoryCarrier& a, MemoryCarrier& b) {
    a.other_ = &b;
    b.other_ = &a;
  }

  void open(Handler& handler) override {
    close();
    handler_ = &handler;
    report();
    if (up()) other_->report_later();
  }

  void close() noexcept override {
    const bool was_open = handler_ != nullptr;
    handler_ = nullptr;
    reported_up_ = false;
    delivery_.cancel();
    delivering_ = false;
    reporting_.cancel();
    inbox_.clear();
    if (was_open && other_ != nullptr && other_->handler_ != nullptr) other_->report_later();
  }

  SendResult send(std::string_view bytes, Priority priority, Peer) override {
    if (!up()) return SendResult::down;
    if (bytes.size() > max_datagram) {
      ++counters_.tx_errors;
      return SendResult::full;
    }
    const std::uint64_t dropped = other_->dropped_;
    const SendResult result =
        other_->inbox_.push(bytes, priority, everyone, std::chrono::steady_clock::now());
    counters_.tx_dropped += other_->dropped_ - dropped;
    if (result == SendResult::sent) {
      ++counters_.tx_datagrams;
      counters_.tx_bytes += bytes.size();
      other_->deliver_later();
    }
    return result;
  }

  bool up() const override {
    return handler_ != nullptr && other_ != nullptr && other_->handler_ != nullptr;
  }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 private:
  void deliver_later() {
    if (delivering_) return;
    delivering_ = true;
    asio::post(io_, delivery_.handler([this] { deliver(); }));
  }

  void deliver() {
    delivering_ = false;
    for (int i = 0; i < datagrams_in_a_turn; ++i) {
      const SendQueue::Entry* const entry = inbox_.front(std::chrono::steady_clock::now());
      if (entry == nullptr) break;
      // Copied, because the handler may send, and a new entry may replace this entry.
      const std::size_t size = entry->size;
      std::memcpy(datagram_.data(), entry->bytes, size);
      inbox_.pop();
      ++counters_.rx_datagrams;
      counters_.rx_bytes += size;
      handler_->on_datagram({datagram_.data(), size}, everyone);
      if (handler_ == nullptr) return;
    }
    if (!inbox_.empty()) return deliver_later();
    handler_->on_drained();
  }

  void report_later() {
    asio::post(io_, reporting_.handler([this] { report(); }));
  }

  void report() {
    if (up() == reported_up_) return;
    reported_up_ = up();
    ++(reported_up_ ? counters_.ups : counters_.downs);
    handler_->on_carrier_event(
        {reported_up_ ? CarrierEvent::Kind::up : CarrierEvent::Kind::down,
         Problem{ErrorKind::open, name_, reported_up_ ? "" : "the other end was closed", ""}});
  }

  asio::io_context& io_;
  const std::string name_;
  MemoryCarrier* other_ = nullptr;
  Handler* handler_ = nullptr;
  bool reported_up_ = false;
  bool delivering_ = false;
  OperationSlot delivery_;
  OperationSlot reporting_;
  CarrierCounters counters_;
  std::uint64_t dropped_ = 0;
  SendQueue inbox_;
  std::array<char, max_datagram> datagram_;
};

}  // namespace

std::pair<std::unique_ptr<Carrier>, std::unique_ptr<Carrier>> make_memory_pair(asio::io_context& io,
                                                                               std::string name) {
  auto a = std::make_unique<MemoryCarrier>(io, name);
  auto b = std::make_unique<MemoryCarrier>(io, std::move(name));
  MemoryCarrier::join(*a, *b);
  return {std::move(a), std::move(b)};
}

}  // namespace r4
