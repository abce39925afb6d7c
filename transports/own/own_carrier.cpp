// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../send_queue.hpp"
#include "exchange.hpp"
#include "own_carriers.hpp"
#include "r4link/datagram.hpp"

namespace r4 {
namespace {

constexpr std::size_t normal_entries = 32;
constexpr std::size_t state_entries = 1;
constexpr std::size_t most_at_once = 32;  // then other work of the loop runs

struct DatagramOutbox {
  using Item = std::string;
  std::optional<Item> next(SendQueue::Time now) {
    const SendQueue::Entry* const entry = queue.front(now);
    if (entry == nullptr) return std::nullopt;
    Item item(entry->text());
    queue.pop();
    return item;
  }
  void clear() { queue.clear(); }

  std::uint64_t dropped = 0;
  SendQueue queue{normal_entries, state_entries, dropped};
};

struct DatagramCalls {
  template <class Received>
  void open(Received received) {
    transport->open([received = std::move(received)](std::string_view datagram) {
      if (datagram.size() > max_datagram) {
        throw Error(ErrorKind::usage, fmt::format("a datagram of {} bytes", datagram.size()),
                    fmt::format("the datagram is longer than {} bytes", max_datagram),
                    "pass one whole datagram at a time");
      }
      received(std::string(datagram));
    });
  }
  void send(const std::string& datagram) { transport->send(datagram); }
  void close() { transport->close(); }

  std::shared_ptr<OwnTransport> transport;
};

class OwnCarrier final : public Carrier {
 public:
  OwnCarrier(Loop& loop, std::shared_ptr<OwnTransport> transport)
      : loop_(loop), transport_(std::move(transport)), name_(transport_->name()) {}
  ~OwnCarrier() override { close(); }

  // If open() throws, the exchange continues, and a later call succeeds when the transport is up.
  void open(Handler& handler) override {
    if (handler_ != nullptr) close();
    if (!exchange_) make_exchange();
    exchange_->start();
    handler_ = &handler;
    post_take(opening_);  // for datagrams that arrived before this call
    report();
  }
  void close() noexcept override {
    handler_ = nullptr;
    opening_.reset();
    reported_up_ = false;
    if (!exchange_) return;
    exchange_->end();
    before_ = counters();
    exchange_.reset();
  }
  SendResult send(std::string_view bytes, Priority priority, Peer) override {
    if (bytes.size() > max_datagram) {
      ++before_.tx_errors;
      return SendResult::full;
    }
    SendResult result = SendResult::down;
    if (!reported_up_) return result;
    exchange_->send([&](DatagramOutbox& outbox) {
      result = outbox.queue.push(bytes, priority, everyone, SendQueue::Time::clock::now());
    });
    if (result == SendResult::sent) before_.tx_bytes += bytes.size();
    return result;
  }
  bool up() const override { return reported_up_; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override {
    counters_ = before_;
    if (!exchange_) return counters_;
    counters_.tx_datagrams += exchange_->sent();
    counters_.tx_dropped += exchange_->dropped();
    counters_.rx_overflows += exchange_->overflows();
    return counters_;
  }

 private:
  void make_exchange() {
    opening_ = std::make_shared<int>();
    exchange_ = std::make_shared<Exchange<DatagramCalls, DatagramOutbox>>(
        name_, std::make_unique<DatagramCalls>(DatagramCalls{transport_}),
        std::make_unique<DatagramOutbox>(),
        [this, opening = std::weak_ptr<int>(opening_)] { post_take(opening); });
  }
  // Runs on any thread.
  void post_take(const std::weak_ptr<int>& opening) {
    loop_.post([this, opening] {
      if (!opening.expired() && handler_ != nullptr) take();
    });
  }
  void take() {
    const std::weak_ptr<int> opening = opening_;
    report();
    if (opening.expired()) return;
    const std::vector<std::string> datagrams = exchange_->take(most_at_once);
    for (const std::string& datagram : datagrams) {
      ++before_.rx_datagrams;
      before_.rx_bytes += datagram.size();
      handler_->on_datagram(datagram, everyone);
      if (opening.expired()) return;
    }
    if (datagrams.size() < most_at_once) handler_->on_drained();
  }
  void report() {
    const bool is_up = exchange_->up();
    if (is_up == reported_up_) return;
    reported_up_ = is_up;
    ++(is_up ? before_.ups : before_.downs);
    Problem problem = is_up ? Problem{} : exchange_->problem();
    problem.thing = name_;
    handler_->on_carrier_event(
        {is_up ? CarrierEvent::Kind::up : CarrierEvent::Kind::down, std::move(problem)});
  }

  Loop& loop_;
  const std::shared_ptr<OwnTransport> transport_;
  const std::string name_;
  Handler* handler_ = nullptr;    // null: not open
  std::shared_ptr<int> opening_;  // made and reset with exchange_
  std::shared_ptr<Exchange<DatagramCalls, DatagramOutbox>> exchange_;
  bool reported_up_ = false;
  CarrierCounters before_;  // without the counts of exchange_
  mutable CarrierCounters counters_;
};

}  // namespace

std::unique_ptr<Carrier> make_own_carrier(Loop& loop, std::shared_ptr<OwnTransport> transport) {
  return std::make_unique<OwnCarrier>(loop, std::move(transport));
}

}  // namespace r4
