// SPDX-License-Identifier: GPL-3.0-or-later
// Any bytes: a datagram that the protocol accepts reads equal after it is written again. The input
// is used unchanged, and as fields with the right checksum, so that the fuzzer need not find CRCs.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "protocol/datagram/crc32.hpp"
#include "protocol/datagram/numbers.hpp"
#include "protocol/messages/command_field.hpp"
#include "protocol/messages/command_group.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/settings.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/command.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/state.hpp"

namespace r4 {
namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

std::string str(Text text) { return {text.data(), text.size()}; }

// The fields that `write` puts into a datagram, without PNum, T and CRC.
template <class Write>
std::string written(Write write) {
  static char buffer[4 * max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  write(writer);
  require(writer.ok());
  return {buffer, writer.size()};
}

Field field_of(const std::string& text) {
  Field field;
  require(read_field(text, field));
  return field;
}

void fields_read_equal(const Datagram& datagram) {
  const std::string fields = written([&](DatagramWriter& writer) {
    for (const Field& field : datagram) {
      std::vector<Text> values(field.count());
      require(field.split(values.data(), values.size()) == values.size());
      writer.field(field.name());
      for (const Text value : values) writer.value(value);
    }
  });
  require(str(datagram.bytes()).starts_with(fields + ";^0x"));

  static char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  for (const Field& field : datagram) writer.field(field.name()).values(field.values());
  const Text again = writer.finish();
  require(!again.empty());
  Datagram second;
  require(static_cast<bool>(read_datagram(again, second)));
  require(second.has_pnum() == datagram.has_pnum() && second.pnum() == datagram.pnum());
  require(second.has_time() == datagram.has_time() && second.time_ms() == datagram.time_ms());
  for (auto a = datagram.begin(), b = second.begin(); a != datagram.end(); ++a, ++b) {
    require(b != second.end() && a->name() == b->name() && a->values() == b->values());
  }
}

std::string fields_of(const State& state) {
  return written([&](DatagramWriter& writer) {
    for (const StateField field : state.present) write_field(writer, field, state);
    writer.field("PNum").value(state.pnum);
    writer.field("T").value(state.t_ms);
  });
}

void state_reads_equal(const Datagram& datagram) {
  State state;
  if (!read_state(datagram, state)) {
    require(state.present.empty() && fields_of(state) == fields_of(State()));
    return;
  }
  FieldSet named;  // read_state() and the iteration read the bytes in different ways
  for (const Field& field : datagram) named.add(state_field(field.name()));
  named.remove(StateField::count);
  require(state.present == named);
  const std::string fields = fields_of(state);
  std::string bytes = fields + ";^";
  char hex[max_number_text];
  char* const hex_end = write_hex(hex, crc32(bytes));
  bytes += "0x" + std::string(hex, hex_end) + '^';
  if (bytes.size() > max_datagram) return;
  Datagram second;
  require(static_cast<bool>(read_datagram(bytes, second)));
  State back;
  require(read_state(second, back));
  require(back.present == state.present && fields_of(back) == fields);
}

std::string text_of(const Command& command) {
  return written([&](DatagramWriter& writer) { write_command(writer, command); });
}

void command_reads_equal(const Field& field) {
  Command command;
  const Refusal refusal = parse_command(field, command);
  require(refusal_from(name_of(refusal)) == refusal);
  if (refusal != Refusal::none) return;
  require(check_command(command) == Refusal::none);
  const std::string text = text_of(command);
  Command again;
  require(parse_command(field_of(text), again) == Refusal::none);
  require(again.kind == command.kind && again.channel == command.channel &&
          again.value == command.value && again.speed == command.speed &&
          again.direction == command.direction && again.on == command.on &&
          again.text == command.text && again.text2 == command.text2);
  require(text_of(again) == text);
  FieldSet set;
  if (command.kind == CommandKind::fields && parse_fields(command.text, set) == Refusal::none) {
    require(!set.empty());
  }
  Settings settings;
  if (command.kind == CommandKind::setting) {
    set = FieldSet();
    static_cast<void>(r4::set(settings, command.text, command.text2));
    require(settings.heartbeat_ms < settings.timeout_ms && settings.state_rate_hz >= 1);
  }
}

void group_reads_equal(const Datagram& datagram) {
  std::uint8_t at = 0;
  CommandGroup group;
  const bool good = read_group(datagram, group, at) == Refusal::none;
  require(good == (at == 0) && at <= datagram.command_count() && at <= max_group + 1);
  if (!good) return;
  require(group.count == datagram.command_count());
  for (const Command& command : group) {
    require(check_command(command) == Refusal::none && drives_output(command.kind));
  }
}

void messages_read_equal(const Datagram& datagram) {
  require(to_text(kind_of(datagram)) != nullptr);
  require(static_cast<int>(heartbeat_reason(datagram)) < safe_reason_count);
  Nack nack;
  if (read_nack(datagram, nack)) {
    static char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    write_nack(writer, nack);
    Datagram again;
    Nack back;
    require(static_cast<bool>(read_datagram(writer.finish(1, 2), again)) && read_nack(again, back));
    require(back.pnum == nack.pnum && back.code == nack.code && back.at == nack.at &&
            back.lease == nack.lease && back.has_session == nack.has_session &&
            (!nack.has_session || back.session == nack.session));
  }
  Identity identity;
  if (read_identity(datagram, identity)) {
    const std::string text =
        written([&](DatagramWriter& writer) { write_identity(writer, identity); });
    require(text == "I:" + str(datagram.find("I").values()));
    require(identity.name.empty() || identity.name == datagram.find("NAME").values());
  }
}

void try_bytes(const std::string& bytes) {
  Datagram datagram;
  const ReadResult result = read_datagram(bytes, datagram);
  if (!result) {
    require(result.position <= bytes.size());
    return;
  }
  fields_read_equal(datagram);
  state_reads_equal(datagram);
  messages_read_equal(datagram);
  group_reads_equal(datagram);
  int commands = 0;
  for (const Field& field : datagram) {
    command_reads_equal(field);
    if (field.name().size() != 1 || !is_command_letter(field.name()[0])) continue;
    if (++commands > 1) continue;
    require(datagram.command().name().begin() == field.name().begin());
    require(datagram.command().values() == field.values());
  }
  require(datagram.command_count() == commands);
}

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string bytes(reinterpret_cast<const char*>(data), size);
  r4::try_bytes(bytes);
  bytes = bytes.substr(0, bytes.find('^')) + '^';
  char hex[r4::max_number_text];
  char* const hex_end = r4::write_hex(hex, r4::crc32(bytes));
  r4::try_bytes(bytes + "0x" + std::string(hex, hex_end) + '^');
  return 0;
}
