// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>

#include "../shell/options.hpp"
#include "../shell/output.hpp"
#include "../shell/subcommands.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/datagram.hpp"
#include "r4link/error.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/message.hpp"
#include "r4link/messages/packed_form.hpp"
#include "r4link/setpoints.hpp"

namespace r4::tool {
namespace {

struct EncodeOptions {
  std::string fields;
  std::uint64_t pnum = 0;
  std::optional<std::uint64_t> time;
  bool force = false;
  bool packed = false;
};

[[noreturn]] void fail(std::string_view thing, std::string reason, std::string fix) {
  throw Error(ErrorKind::usage, std::string(thing), std::move(reason), std::move(fix));
}

void write_fields(DatagramWriter& writer, std::string_view text) {
  if (text.ends_with(';')) text.remove_suffix(1);
  for (bool more = true; more;) {
    const std::size_t semicolon = text.find(';');
    const std::string_view part = text.substr(0, semicolon);
    more = semicolon != std::string_view::npos;
    if (more) text.remove_prefix(semicolon + 1);

    Field field;
    if (!read_field(Text(part), field)) {
      fail(fmt::format("'{}'", part), "is not a field",
           "write NAME:VALUE,VALUE… in printable ASCII without ^, fields separated by ';'");
    }
    if (field.name() == Text("PNum") || field.name() == Text("T")) {
      fail(part, "is added by encode itself", "use --pnum and --time");
    }
    writer.field(field.name()).values(field.values());
  }
}

std::string text_of(const Field& field) {
  return fmt::format("{}:{}", std::string_view(field.name().data(), field.name().size()),
                     std::string_view(field.values().data(), field.values().size()));
}

void check_all(const Datagram& datagram) {
  Setpoints group;
  for (const Field& field : datagram) {
    if (!is_command(field)) continue;
    const OwnCommand command = parse_command_text(text_of(field));
    group.add(command);
  }
}

// Throws if a board or a host would not accept the datagram. Unknown letters may pass.
void check(const Datagram& datagram) {
  const int count = datagram.command_count();
  const Field& field = datagram.command();
  if (count == 0) return;
  if (count > 1) return check_all(datagram);
  const std::string text = text_of(field);
  bool good = true;
  switch (kind_of(datagram)) {
    case MessageKind::nack: {
      Nack nack;
      good = read_nack(datagram, nack);
      break;
    }
    case MessageKind::identity: {
      Identity identity;
      good = read_identity(datagram, identity);
      break;
    }
    case MessageKind::command:
    case MessageKind::host_heartbeat:
      if (std::any_of(std::begin(command_rows), std::end(command_rows),
                      [&](const CommandRow& row) { return row.letter == text.front(); })) {
        parse_command_text(text);
      }
      break;
    case MessageKind::board_heartbeat:
    case MessageKind::state:
      break;
  }
  if (!good) {
    fail(text, "is not the form of this answer",
         "write N:<PNum>,<CODE> or I:R4,<firmware>,<board id>,<capabilities>, or use --force");
  }
}

std::uint64_t epoch_ms() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<Milliseconds>(now).count());
}

int encode(const EncodeOptions& options) {
  std::array<char, max_datagram> buffer;
  DatagramWriter writer(buffer.data(), buffer.size());
  write_fields(writer, options.fields);
  const Text bytes = writer.finish(static_cast<std::uint32_t>(options.pnum),
                                   options.time ? *options.time : epoch_ms());
  Datagram datagram;
  if (bytes.empty() || !read_datagram(bytes, datagram)) {
    fail("the datagram", fmt::format("is longer than {} bytes", max_datagram),
         "write fewer fields");
  }
  if (!options.force) check(datagram);
  std::array<std::uint8_t, max_datagram> packed;
  const std::size_t size = options.packed ? pack(bytes, packed.data(), packed.size()) : 0;
  if (size != 0) {
    print_raw(fmt::format("packed:{:02x}\n", fmt::join(packed.data(), packed.data() + size, "")));
  } else {
    print_raw(std::string(bytes.data(), bytes.size()) + "\n");
  }
  return 0;
}

constexpr const char* encode_footer = R"(Examples:
  r4 encode O:358,1,1 --pnum 66 --time 1699276044383
                              O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^
  r4 encode 'O:358,1,1;O:358,1,2'
                              two commands that are executed together
  r4 encode H:ROS2-R4         a host's heartbeat
  r4 encode 'AIN24:24.28;AIN12:12.15'
                              a board's state, of any fields
  r4 encode O:358,1,1 --pnum 66 --time 1699276044383 --packed
                              packed:8d004218ba4beb85f3b358c1c1df7fefae81

--packed is the form for a CAN bus (docs/reference/packed.md), in hexadecimal. If the packed form is
not shorter, the datagram is printed as text, as it would be sent. r4 decode reads both forms.

Commands of the board (r4 send --help) are checked before they are encoded.

Exit codes: 0 done; 2 the fields or an option are wrong.)";

}  // namespace

void add_encode(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<EncodeOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "encode", "Write a datagram: fields, PNum, T and checksum",
                     encode_footer, options, encode);
  add_text(*command, "CMD", options->fields,
           "the fields, such as O:358,1,1 or 'AIN24:24.28;AIN12:1'", "", Need::required);
  add_number(*command, "--pnum", options->pnum, 0, 0xFFFFFFFFU, "packet number (default 0)");
  add_number(*command, "--time", options->time, 0, ~std::uint64_t{0},
             "T in milliseconds (default: now, since 1970)");
  add_flag(*command, "--packed", options->packed, "in the packed form of a CAN bus, as packed:HEX");
  add_flag(*command, "--force", options->force, "do not check commands and their ranges");
}

}  // namespace r4::tool
