// SPDX-License-Identifier: GPL-3.0-or-later
#include "attacker.hpp"

#include <fmt/format.h>

#include "protocol/messages/command_field.hpp"
#include "protocol/messages/message.hpp"
#include "r4link/command.hpp"
#include "tests/support/datagrams.hpp"
#include "tests/support/signing.hpp"

namespace r4::simulation {

namespace {

constexpr std::size_t memory = 4096;

// The fields of a datagram, without its checksum.
std::string fields_of(const std::string& bytes) { return bytes.substr(0, bytes.find('^')); }
std::string unsigned_fields_of(const std::string& bytes) {
  const std::string fields = fields_of(bytes);
  return fields.substr(0, fields.rfind(";A:") + 1);
}

}  // namespace

const char* to_text(Attack::Kind kind) {
  switch (kind) {
    case Attack::Kind::replay:
      return "replay";
    case Attack::Kind::change:
      return "change";
    case Attack::Kind::strip:
      return "strip";
    case Attack::Kind::heartbeat:
      return "heartbeat";
    case Attack::Kind::command:
      return "command";
    case Attack::Kind::other_key:
      return "other_key";
    case Attack::Kind::stop:
      return "stop";
    case Attack::Kind::count:
      break;
  }
  return "?";
}

// Keeps only datagrams that need a signature. A board obeys stops and answers questions without a
// signature.
void Attacker::keep(std::vector<Heard>& list, Origin from, std::string_view bytes) {
  Datagram datagram;
  if (!read_datagram(Text(bytes), datagram) || asks_to_stop(datagram)) return;
  if (datagram.command().name() == Text("Q") || asks_to_watch(datagram)) return;
  if (list.size() == memory) return;
  list.push_back({std::string(bytes), from});
}

void Attacker::on_board(std::string_view bytes) {
  Datagram datagram;
  if (!read_datagram(Text(bytes), datagram)) return;
  board_t_ = static_cast<std::uint32_t>(datagram.time_ms());
  if (kind_of(datagram) != MessageKind::board_heartbeat) return;
  nonce_ = test::str(heartbeat_nonce(datagram));
  echo_ = is_connecting_heartbeat(datagram) ? "0" : fmt::format("{}", board_t_);
}

// `field` with the next packet number of the host of `like`.
std::string Attacker::own(const std::string& field, const Heard& like, Random& random) const {
  Datagram datagram;
  read_datagram(Text(like.bytes), datagram);
  const auto ahead = static_cast<std::uint32_t>(random.between(1, 3));
  return fmt::format("{};PNum:{};T:{};", field, datagram.pnum() + ahead, echo_);
}

Attack Attacker::next(Random& random) {
  Attack attack;
  attack.kind = static_cast<Attack::Kind>(random.below(static_cast<int>(Attack::Kind::count)));
  // Stops are rare, because the schedule tests little after a stop.
  if (attack.kind == Attack::Kind::stop && !random.chance(0.05)) attack.kind = Attack::Kind::replay;
  const std::vector<Heard>& heard_of = attack.kind == Attack::Kind::replay ? received_ : sent_;
  if (heard_of.empty()) return attack;
  // The newest datagram is as likely as all the other datagrams together.
  const Heard* const heard =
      random.chance(0.5) ? &heard_of.back() : &heard_of[random.below(heard_of.size())];
  attack.like = heard->from;
  if (random.chance(0.7)) attack.host = heard->from.host;
  constexpr const char* drive = "P:-7777,1000,1";
  std::string fields;
  switch (attack.kind) {
    case Attack::Kind::replay:
      attack.bytes = heard->bytes;
      return attack;
    case Attack::Kind::change: {
      fields = fields_of(heard->bytes);
      char& byte = fields[random.below(fields.size())];
      if (byte < '0' || byte > '9') return attack;
      byte = static_cast<char>('0' + (byte - '0' + 1 + random.below(9)) % 10);
      break;
    }
    case Attack::Kind::strip:
      fields = unsigned_fields_of(heard->bytes);
      if (fields.empty()) return attack;
      break;
    case Attack::Kind::heartbeat:
      fields = own("H:ROS2-R4", *heard, random);
      break;
    case Attack::Kind::command:
      fields = own(drive, *heard, random);
      if (random.chance(0.5)) {
        fields += fmt::format("A:{},18446744073709551615,{},AAAAAAAAAAA;", random.between(1, 3),
                              board_t_);
      }
      break;
    case Attack::Kind::other_key: {
      const Key guess = test::key_of(static_cast<std::uint8_t>(random.between(1, 2)), 200);
      const char* const field = random.chance(0.5) ? drive : "H:ROS2-R4";
      fields = test::with_signature(own(field, *heard, random), guess, nonce_, ~std::uint64_t{0},
                                    board_t_);
      break;
    }
    case Attack::Kind::stop:
    case Attack::Kind::count:
      fields = own("E:STOP", *heard, random);
      break;
  }
  attack.bytes = test::with_crc(fields);
  return attack;
}

}  // namespace r4::simulation
