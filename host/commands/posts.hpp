// SPDX-License-Identifier: GPL-3.0-or-later
// Commands that are sent once, without waiting for their end. A refusal is reported. Without I/O.
#pragma once

#include <cstdint>
#include <vector>

#include "../link/effects.hpp"
#include "../link/outbox.hpp"
#include "../measurement/time.hpp"
#include "r4link/command.hpp"
#include "r4link/link.hpp"
#include "r4link/setpoints.hpp"

namespace r4 {

class Posts {
 public:
  Posts(Effects& effects, Outbox& outbox, Statistics& counts)
      : effects_(effects), outbox_(outbox), counts_(counts) {}

  // After `sent`, perform the effects; then result() returns the final result.
  PostResult send(const Command& command, Time now);
  PostResult send(const Setpoints& group, Time now);
  void on_sent(const Sending& sending, SendResult result) { delivery_.on_sent(sending, result); }
  PostResult result();
  bool is_clear() const { return kind_ == CommandKind::clear; }
  // `nack` proves that the board did not execute the command.
  void on_refusal(const Nack& nack);

 private:
  // A command, or the first command of a group, that the board may refuse.
  struct Posted {
    bool open = false;
    bool is_group = false;
    std::uint32_t pnum = 0;
    Command command;
  };

  PostResult begin(Outbox::Sent sent, const Command& command, bool is_group);
  const Posted* take(std::uint32_t pnum);

  Effects& effects_;
  Outbox& outbox_;
  Statistics& counts_;
  Delivery delivery_;
  CommandKind kind_ = CommandKind::heartbeat;
  // By packet number; as many as the board remembers. Empty until the first post or group.
  std::vector<Posted> posted_;
  std::vector<Setpoints> groups_;
};

}  // namespace r4
