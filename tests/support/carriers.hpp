// SPDX-License-Identifier: GPL-3.0-or-later
// Base classes for the carriers of a test.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "r4link/carrier.hpp"

namespace r4::test {

// A carrier that is up while it is open, discards sent datagrams and receives no datagram.
class IdleCarrier : public Carrier {
 public:
  void open(Handler& handler) override {
    handler_ = &handler;
    handler.on_carrier_event({CarrierEvent::Kind::up, {}});
  }
  void close() noexcept override { handler_ = nullptr; }
  SendResult send(std::string_view, Priority, Peer) override { return SendResult::sent; }
  bool up() const override { return handler_ != nullptr; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 protected:
  Handler* handler_ = nullptr;

 private:
  const std::string name_ = "idle:";
  CarrierCounters counters_;
};

// Forwards all calls between its owner and another carrier.
class WrappedCarrier : public Carrier, protected Carrier::Handler {
 public:
  explicit WrappedCarrier(std::unique_ptr<Carrier> below) : below_(std::move(below)) {}
  void open(Carrier::Handler& handler) override {
    handler_ = &handler;
    below_->open(*this);
  }
  void close() noexcept override { below_->close(); }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    return below_->send(bytes, priority, to);
  }
  bool up() const override { return below_->up(); }
  const std::string& name() const override { return below_->name(); }
  const CarrierCounters& counters() const override { return below_->counters(); }

 protected:
  void on_datagram(std::string_view bytes, Peer from) override {
    handler_->on_datagram(bytes, from);
  }
  void on_carrier_event(const CarrierEvent& event) override { handler_->on_carrier_event(event); }
  void on_drained() override { handler_->on_drained(); }

  const std::unique_ptr<Carrier> below_;
  Carrier::Handler* handler_ = nullptr;
};

}  // namespace r4::test
