// SPDX-License-Identifier: GPL-3.0-or-later
// A host whose simulation looks at few of the things that its session tells.
#pragma once

#include "host/session/session.hpp"

namespace r4::simulation {

struct IncuriousHost : Session::Handler {
  void on_state(const ReceivedState&, const Datagram&) override {}
  void on_board_heartbeat(const Datagram&) override {}
  void on_identity(const Identity&) override {}
  void on_nack(const Nack&, const Datagram&) override {}
  void on_bad_datagram(const ReadResult&, std::string_view) override {}
  void on_link(const LinkStatus&) override {}
  void on_result(Ticket, const CommandResult&) override {}

 protected:
  ~IncuriousHost() = default;
};

}  // namespace r4::simulation
