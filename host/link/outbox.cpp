// SPDX-License-Identifier: GPL-3.0-or-later
#include "outbox.hpp"

#include <array>
#include <bit>

#include "../../protocol/messages/command_field.hpp"

namespace r4 {

// The board never echoes a host's T, so a command of a session has no T.
void Outbox::stamp(DatagramWriter& writer, CommandKind kind, std::uint32_t pnum,
                   std::uint32_t t_ms) const {
  const bool echoes = kind == CommandKind::heartbeat || kind == CommandKind::watch;
  writer.session(session_id());
  echoes || watches() ? writer.stamp(pnum, t_ms) : writer.packet(pnum);
}

Outbox::Sent Outbox::send(const Command& command, Way way, Time now) {
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_command(writer, command);
  const std::uint32_t pnum = link_.take_pnum();
  stamp(writer, command.kind, pnum, way.echo.value_or(to_ms(now)));
  return {pnum, send(writer, command.kind, pnum, way, now)};
}

Outbox::Sent Outbox::send(const Setpoints& group, Time now) {
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  for (std::size_t i = 0; i < group.size(); ++i) write_command(writer, group[i]);
  const std::uint32_t pnum = link_.take_pnum();
  stamp(writer, group[0].kind, pnum, to_ms(now));
  return {pnum, send(writer, group[0].kind, pnum, {}, now)};
}

// Signs for each path separately (docs/reference/protocol.md, "Paths"). A watcher's datagrams need
// no signature.
PathSet Outbox::send(DatagramWriter& writer, CommandKind kind, std::uint32_t pnum, Way way,
                     Time now) {
  if (kind == CommandKind::stop) way.priority = Priority::stop;
  const bool to_any = way.unknown_too || kind == CommandKind::stop;
  if (key_.refuses_board() && !to_any) return 0;
  const PathSet to = to_any ? way.paths : static_cast<PathSet>(way.paths & paths_.speaking());
  const std::size_t size = writer.size();
  PathSet over = 0;
  for (std::size_t i = 0; i < paths_.count(); ++i) {
    if ((to & path_bit(i)) == 0) continue;
    if (!watches()) key_.sign(writer, now);
    const Text bytes = writer.finish();
    if (!bytes.empty()) {  // not too long
      effects_.send(i, way.priority, kind, pnum, {bytes.data(), bytes.size()});
      over |= path_bit(i);
    }
    writer.truncate(size);
  }
  return over;
}

void Delivery::begin(Outbox::Sent sent) {
  pnum_ = sent.pnum;
  open_ = std::popcount(sent.paths);
  result_ = SendResult::down;
}

bool Delivery::on_sent(const Sending& sending, SendResult result) {
  if (open_ == 0 || sending.pnum != pnum_) return false;
  --open_;
  if (result == SendResult::sent || result_ == SendResult::down) result_ = result;
  return true;
}

}  // namespace r4
