// SPDX-License-Identifier: GPL-3.0-or-later
// Notifies the hosts of a loop when an interface of this computer, its carrier or an address has
// changed. So an unplugged cable is noticed even if nothing is sent. One object per loop. Without
// rtnetlink(7), members are not called, and a failing datagram shows the change later.
#pragma once

#include <asio/execution_context.hpp>
#include <asio/io_context.hpp>
#include <vector>

#include "../../operation_slot.hpp"
#include "udp_route.hpp"

namespace r4 {

class NetworkWatch final : public asio::execution_context::service {
 public:
  using key_type = NetworkWatch;
  static asio::execution_context::id id;

  class Member {
   public:
    virtual void on_network_change(const std::vector<OwnAddress>& own) = 0;

   protected:
    ~Member() = default;
  };

  explicit NetworkWatch(asio::execution_context& context);

  static NetworkWatch& of(asio::io_context& io) { return asio::use_service<NetworkWatch>(io); }

  void enter(Member& member);
  // No call of `member` follows. Can be called twice.
  void leave(Member& member);

 private:
  void shutdown() noexcept override;
  void open();
  void wait();
  void tell();

  LoopDescriptor changes_;  // a socket of rtnetlink
  OperationSlot waiting_;
  std::vector<Member*> members_;
};

}  // namespace r4
