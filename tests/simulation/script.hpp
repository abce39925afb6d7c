// SPDX-License-Identifier: GPL-3.0-or-later
// A script decides in place of chance which events occur in a world: which processes run, which
// host commands, and what happens to each datagram (search/play.hpp).
#pragma once

#include <cstdint>
#include <string_view>

#include "world.hpp"

namespace r4::simulation {

class World::Script {
 public:
  // All hosts exist, and no host runs.
  virtual void begin() = 0;
  // The time of the schedule is over, and no promise was broken.
  virtual void end() = 0;
  // An event that the script has requested.
  virtual void on_event(int index) = 0;
  // Is called after each event.
  virtual void check() = 0;

  virtual void set(SessionOptions& options) const = 0;
  // True if that host is on that path.
  virtual bool has_place(int host, int path) const = 0;

  // A host or the board has sent this datagram. The script delivers it.
  virtual void on_sent(const Packet& sent) = 0;
  // A datagram has arrived. True if the script holds this datagram back for now.
  virtual bool takes(const Packet& arrived) = 0;
  virtual void before_board(const Packet& packet) = 0;
  virtual void after_board(const Packet& packet) = 0;
  // The board sends a datagram. True if the script delivers the datagram to the hosts itself.
  virtual bool on_board_sent(std::uint8_t port, std::uint32_t peer, Priority priority,
                             std::string_view bytes) = 0;
  // The board has executed a command. False if a stranger sent the command.
  virtual bool on_executed(const Command& command) = 0;
  // The board has become SAFE(link).
  virtual void on_link_lost() = 0;

 protected:
  ~Script() = default;
};

}  // namespace r4::simulation
