// SPDX-License-Identifier: GPL-3.0-or-later
// Keeps the link of a session alive: sends heartbeats or a watcher's leases, requests the state
// fields that the session needs, and decides whether commands may be sent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "../../protocol/link/host_link.hpp"
#include "../measurement/time.hpp"
#include "../paths/paths.hpp"
#include "field_selection.hpp"
#include "host_key.hpp"
#include "host_role.hpp"
#include "outbox.hpp"
#include "r4link/carrier.hpp"
#include "r4link/command.hpp"
#include "r4link/link.hpp"
#include "r4link/options.hpp"

namespace r4 {

class LinkKeeper {
 public:
  // All references must outlive the keeper.
  LinkKeeper(const SessionOptions& options, HostLink& link, HostKey& key, Paths& paths,
             Outbox& outbox, Statistics& counts);

  void on_transport(std::size_t path, bool up, bool can_ask, Time now);
  void on_transport_trouble(TransportTrouble trouble) { trouble_ = trouble; }
  void on_sent(const Sending& sending, SendResult result, Time now);
  // As Paths::on_busy().
  void on_busy(std::size_t path, std::optional<std::uint32_t> t_ms, Time now);
  void on_own_command(std::uint32_t t_ms, Time now);
  FieldSelection& fields() { return fields_; }

  // Sends Q:ID on paths whose board is unknown. The session begins when the boards are known.
  void ask_paths(Time now);
  void keep_alive(Time now);
  // Sends F if the states lack needed fields, or to prove control.
  void select_fields(Time now);
  // When one of these three actions is due; Time::max() for never.
  Time next(Time now) const;
  // Ends the link: the keeper then sends nothing.
  void leave(Time now);
  void begin_anew();
  void hold(bool held);
  void hold_for_stop(bool stopping);

  // Call update() before the functions below: update() applies changes of the link to the role.
  void update() { role_.on_link(is_up()); }
  // True if the board receives this host's heartbeats.
  bool is_up() const;
  // True if this host receives the board's datagrams; for a controlling host, as is_up().
  bool hears_board() const { return watches() ? is_heard(link_.state()) : is_up(); }
  // True if commands may be sent at once: the link is up, the board has executed a command of this
  // session, and neither a callback nor the watchdog holds commands back.
  bool in_control(Time now) const;
  bool controls() const { return role_.controlling(); }
  bool is_leaving() const { return leaving_; }
  LinkStatus status(ChipFault fault, Time now) const;

  // Adds the needed fields to an F, and remembers the fields. The text is valid until the next
  // call.
  Command with_needed_fields(const Command& command);

 private:
  bool watches() const { return outbox_.watches(); }
  void send_lease(Time now);
  void send_heartbeat(Time now);

  const SessionOptions& options_;
  HostLink& link_;
  HostKey& key_;
  Paths& paths_;
  Outbox& outbox_;
  Statistics& counts_;
  HostRoleMachine role_;
  FieldSelection fields_;
  Delivery heartbeat_;
  TransportTrouble trouble_ = TransportTrouble::none;
  bool transport_down_ = false;
  bool held_ = false;
  bool stopping_ = false;
  bool leaving_ = false;
};

}  // namespace r4
