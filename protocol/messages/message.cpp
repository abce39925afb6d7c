// SPDX-License-Identifier: GPL-3.0-or-later
#include "message.hpp"

#include "../datagram/numbers.hpp"
#include "command_field.hpp"
#include "r4link/command.hpp"
#include "r4link/state.hpp"
#include "site_settings.hpp"
#include "state_fields.hpp"

namespace r4 {
namespace {

constexpr Text board_heartbeat_word("R4-ROS2");
constexpr Text board_word("R4");
constexpr Text nonce_name("AN");
constexpr Text safe_name("SAFE");
constexpr Text cause_name("CAUSE");
constexpr Text session_name("SESSION");
constexpr Text lease_name("LEASE");
constexpr Text board_name("NAME");
constexpr Text busy_name("BUSY");
constexpr Text asked_name("ASKED");
constexpr Text wiring_name("WIRING");
constexpr Text at_name("AT");

template <class Number>
bool find_number(const Datagram& datagram, Text name, Number& out) {
  const Field field = datagram.find(name);
  return !field.name().empty() && parse_number(field.values(), out);
}

}  // namespace

const char* to_text(MessageKind kind) {
  switch (kind) {
    case MessageKind::board_heartbeat:
    case MessageKind::host_heartbeat:
      return "heartbeat";
    case MessageKind::command:
      return "command";
    case MessageKind::nack:
      return "nack";
    case MessageKind::identity:
      return "identity";
    case MessageKind::state:
      break;
  }
  return "state";
}

bool asks_to_watch(const Datagram& datagram) {
  return datagram.command_count() == 1 && datagram.command().name() == Text("W");
}

MessageKind kind_of(const Datagram& datagram) {
  if (datagram.command_count() == 0) return MessageKind::state;
  if (datagram.command_count() > 1) return MessageKind::command;  // a group, or refused as a group
  const Field& field = datagram.command();
  if (field.name() == Text("H")) {
    if (field.values() == board_heartbeat_word) return MessageKind::board_heartbeat;
    if (field.values() == host_heartbeat_word) return MessageKind::host_heartbeat;
  }
  if (field.name() == Text("N")) return MessageKind::nack;
  if (field.name() == Text("I")) return MessageKind::identity;
  return MessageKind::command;
}

Text write_board_heartbeat(char* buffer, std::size_t capacity, std::uint32_t pnum,
                           std::uint32_t t_ms, const SafeReport& safe, Text nonce) {
  DatagramWriter writer(buffer, capacity);
  writer.field("H").value(board_heartbeat_word);
  writer.field("PNum").value(pnum);
  writer.field("T").value(t_ms);
  if (safe.reason != SafeReason::none) {
    writer.field(safe_name).value(static_cast<std::uint32_t>(safe.reason));
  }
  if (safe.cause != 0) writer.field(cause_name).value(safe.cause);
  if (safe.has_stop) writer.field(stop_number_name).value(safe.stop);
  if (!nonce.empty()) writer.field(nonce_name).value(nonce);
  return writer.finish();
}

SafeReport heartbeat_report(const Datagram& datagram) {
  SafeReport report(heartbeat_reason(datagram));
  if (!find_number(datagram, cause_name, report.cause) || report.cause < 0) report.cause = 0;
  report.has_stop = find_number(datagram, stop_number_name, report.stop);
  return report;
}

SafeReason heartbeat_reason(const Datagram& datagram) {
  const Field field = datagram.find(safe_name);
  if (field.name().empty()) return SafeReason::none;
  SafeReason reason = SafeReason::none;
  return parse_safe_reason(field.values(), reason) ? reason : SafeReason::fault;
}

Text heartbeat_nonce(const Datagram& datagram) {
  const Text nonce = datagram.find(nonce_name).values();
  return nonce.size() == nonce_size ? nonce : Text();
}

bool is_connecting_heartbeat(const Datagram& datagram) {
  if (!datagram.has_pnum() || datagram.pnum() != 0) return false;
  return datagram.time_ms() == 0 || !heartbeat_nonce(datagram).empty();
}

bool read_nack(const Datagram& datagram, Nack& out) {
  Text values[2];
  if (datagram.find("N").split(values, 2) != 2) return false;
  Nack nack;
  nack.code = refusal_from(values[1]);
  if (nack.code == Refusal::none || !parse_number(values[0], nack.pnum)) return false;
  std::uint32_t at = 0;
  if (find_number(datagram, at_name, at) && at <= 0xFF) nack.at = static_cast<std::uint8_t>(at);
  nack.sid = datagram.session_id();
  nack.has_session = find_number(datagram, session_name, nack.session);
  if (!find_number(datagram, lease_name, nack.lease)) nack.lease = 0;
  out = nack;
  return true;
}

void write_nack(DatagramWriter& writer, const Nack& nack) {
  writer.field("N").value(nack.pnum).value(name_of(nack.code));
  if (nack.at != 0) writer.field(at_name).value(std::uint32_t{nack.at});
  if (nack.has_session) writer.field(session_name).value(nack.session);
  if (nack.lease != 0) writer.field(lease_name).value(nack.lease);
  writer.session(nack.sid);
}

bool read_identity(const Datagram& datagram, Identity& out) {
  Text values[4];
  if (datagram.find("I").split(values, 4) != 4 || values[0] != board_word ||
      !is_board_id(values[2])) {
    return false;
  }
  out.firmware = values[1];
  out.board_id = values[2];
  out.capabilities = values[3];
  const Text name = datagram.find(board_name).values();
  out.name = is_board_name(name) ? name : Text();
  const Text busy = datagram.find(busy_name).values();
  out.busy = busy == Text("1");
  out.has_busy = out.busy || busy == Text("0");
  out.has_asked = parse_number(datagram.find(asked_name).values(), out.asked);
  out.wiring = datagram.find(wiring_name).values();
  out.sid = datagram.session_id();
  return true;
}

bool has_capability(Text capabilities, Text word) {
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= capabilities.size(); ++i) {
    if (i != capabilities.size() && capabilities[i] != '+') continue;
    if (Text(capabilities.data() + begin, i - begin) == word) return true;
    begin = i + 1;
  }
  return false;
}

void write_identity(DatagramWriter& writer, const Identity& identity) {
  writer.field("I")
      .value(board_word)
      .value(identity.firmware)
      .value(identity.board_id)
      .value(identity.capabilities);
}

void write_identity_fields(DatagramWriter& writer, const Identity& identity) {
  if (!identity.name.empty()) writer.field(board_name).value(identity.name);
  if (identity.has_busy) writer.field(busy_name).value(identity.busy ? Text("1") : Text("0"));
  if (identity.has_asked) writer.field(asked_name).value(identity.asked);
  if (!identity.wiring.empty()) writer.field(wiring_name).values(identity.wiring);
  writer.session(identity.sid);
}

}  // namespace r4
