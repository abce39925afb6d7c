// SPDX-License-Identifier: GPL-3.0-or-later
// A carrier (r4link/carrier.hpp) as a port of the board's application.
#pragma once

#include <memory>
#include <string_view>

#include "../../../transports/board_end.hpp"
#include "../../port.hpp"
#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"

namespace r4::sim {

class CarrierPort final : public firmware::Port, private Carrier::Handler {
 public:
  class Owner {
   public:
    virtual void on_datagram(CarrierPort& port, Peer from, std::string_view bytes) = 0;
    virtual void on_drained(CarrierPort& port) = 0;
    virtual void on_carrier_event(CarrierPort& port, const CarrierEvent& event) = 0;

   protected:
    ~Owner() = default;
  };

  CarrierPort(std::unique_ptr<Carrier> carrier, Owner& owner);

  void open() { carrier_->open(*this); }
  void close() noexcept { carrier_->close(); }
  const Carrier& carrier() const { return *carrier_; }

  std::uint8_t number = 0;

  void send(Text datagram, Priority priority, std::uint32_t peer) override;
  std::size_t max_size() const override { return max_datagram; }
  void hold(std::uint32_t peer) override { end_.hold(peer); }
  void also_hold(std::uint32_t peer) override { end_.also_hold(peer); }
  bool reaches(std::uint32_t peer) const override { return end_.reaches(peer); }
  void use_packed_form(bool wanted) override { end_.use_packed_form(wanted); }
  bool is_bus() const override { return carrier_->is_shared(); }
  bool may_configure() const override { return end_.is_own_cable(); }

 private:
  void on_datagram(std::string_view bytes, Peer from) override;
  void on_drained() override;
  void on_carrier_event(const CarrierEvent& event) override;

  std::unique_ptr<Carrier> carrier_;
  BoardEnd& end_;
  Owner& owner_;
};

}  // namespace r4::sim
