// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>

#include "../shell/json.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "bus_live.hpp"
#include "bus_plan.hpp"
#include "protocol/messages/command_field.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/command.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

constexpr double full = 1.0;
constexpr double nearly_full_bus = 0.8;  // leaves room for retransmissions and unplanned traffic
constexpr std::uint64_t usual_data_rate = 5000000;

struct Options {
  std::uint64_t boards = 8;
  std::uint64_t rate = 100;
  std::uint64_t commands = 20;
  std::string fields = "DEFAULT,SAFE,CMD";
  std::optional<std::uint64_t> bit_rate;
  std::optional<std::uint64_t> data_bit_rate;
  bool fd = false;
  bool plain = false;
  bool json = false;
  std::optional<std::string> url;
  std::optional<Milliseconds> duration;
};

BusPlan plan_of(const Options& options) {
  const std::uint64_t bit_rate = options.bit_rate.value_or(usual_bit_rate);
  const std::uint64_t data_rate = options.data_bit_rate.value_or(usual_data_rate);
  if (options.data_bit_rate && !options.fd) {
    throw Error(ErrorKind::usage, fmt::format("--dbitrate {}", data_rate),
                "classic frames have one bit rate only", "add --fd, or remove --dbitrate");
  }
  if (options.fd && data_rate < bit_rate) {
    throw Error(ErrorKind::usage, fmt::format("--dbitrate {}", data_rate),
                "is below the nominal bit rate",
                fmt::format("write {} or more, or a lower --bitrate", bit_rate));
  }
  BusPlan plan;
  plan.boards = static_cast<std::uint32_t>(options.boards);
  plan.states_hz = static_cast<std::uint32_t>(options.rate);
  plan.commands_hz = static_cast<std::uint32_t>(options.commands);
  parse_fields(Text(options.fields), plan.fields);
  plan.bit_rate.nominal = static_cast<std::uint32_t>(bit_rate);
  plan.bit_rate.data = options.fd ? static_cast<std::uint32_t>(data_rate) : 0;
  plan.packed = !options.plain;
  return plan;
}

std::string bit_rate_text(std::uint32_t rate) {
  return rate % 1000000 == 0 ? fmt::format("{} Mbit/s", rate / 1000000)
                             : fmt::format("{} kbit/s", rate / 1000.0);
}

std::string counted(std::uint32_t count, const char* one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

std::string plan_text(const BusPlan& plan, const Options& options) {
  const bool fd = plan.bit_rate.data != 0;
  return fmt::format("{}, {} at {} Hz, {} form, {} at {}{}", counted(plan.boards, "board"),
                     options.fields, plan.states_hz, plan.packed ? "packed" : "plain",
                     fd ? "CAN FD" : "classic CAN", bit_rate_text(plan.bit_rate.nominal),
                     fd ? " and " + bit_rate_text(plan.bit_rate.data) : "");
}

void print_row(const BusTraffic& row) {
  print_text("{:<16}{:>10.0f}{:>8.1f}{:>10.0f}{:>11.0f}{:>9.1f} %{:>8.1f} %\n", row.name,
             row.datagrams, row.bytes, row.frames, row.bits, 100 * row.load, 100 * row.worst_load);
}

void print_table(const BusPlan& plan, const Options& options, const BusLoad& load) {
  print_text("{}\n\n", plan_text(plan, options));
  print_text("{:<16}{:>10}{:>8}{:>10}{:>11}{:>11}{:>10}\n", "", "datagrams", "bytes", "frames",
             "bits", "load", "worst");
  print_text("{:<16}{:>10}{:>8}{:>10}{:>11}\n", "", "/s", "each", "/s", "/s");
  for (const BusTraffic& row : load.traffic) print_row(row);
  print_row(load.total);
  const std::uint32_t boards = most_boards(plan, nearly_full_bus);
  const std::uint32_t rate = highest_rate(plan, nearly_full_bus);
  print_text("\nWith 20 % to spare this bus carries {} at {} Hz{}.\n",
             boards == 0 ? "no board" : counted(boards, "board"), plan.states_hz,
             rate == 0 ? "" : fmt::format(", or {} at {} Hz", counted(plan.boards, "board"), rate));
}

Json row_json(const BusTraffic& row) {
  return {{"type", "traffic"},          {"name", row.name},
          {"datagrams", row.datagrams}, {"bytes", row.bytes},
          {"frames", row.frames},       {"bits", row.bits},
          {"load", row.load},           {"worst_load", row.worst_load}};
}

void print_json(const BusPlan& plan, const BusLoad& load) {
  for (const BusTraffic& row : load.traffic) print_line(row_json(row));
  Json bus = row_json(load.total);
  bus["type"] = "bus";
  bus["boards"] = plan.boards;
  bus["packed"] = plan.packed;
  bus["bitrate"] = plan.bit_rate.nominal;
  bus["dbitrate"] = plan.bit_rate.data;
  bus["most_boards"] = most_boards(plan, nearly_full_bus);
  bus["highest_rate"] = highest_rate(plan, nearly_full_bus);
  bus["fits"] = load.total.load <= full;
  print_line(bus);
}

std::string remedy(const BusPlan& plan) {
  if (!plan.packed) return "remove --plain, or use fewer boards, fields or states";
  if (plan.bit_rate.data == 0) return "use fewer boards, fields or states, or CAN FD (--fd)";
  return "use fewer boards, fields or states, or a second bus";
}

int live(const Options& options) {
  LiveBusOptions bus;
  bus.url = *options.url;
  bus.json = options.json;
  bus.duration = options.duration;
  if (options.bit_rate) bus.bit_rate = static_cast<std::uint32_t>(*options.bit_rate);
  if (options.data_bit_rate) bus.data_bit_rate = static_cast<std::uint32_t>(*options.data_bit_rate);
  show_live_bus(bus, nearly_full_bus);
  return 0;
}

int bus(const Options& options) {
  if (options.url) return live(options);
  if (options.duration) {
    throw Error(ErrorKind::usage, "--duration", "needs the URL of a real bus",
                "name the bus, as in can://can0");
  }
  const BusPlan plan = plan_of(options);
  const BusLoad load = load_of(plan);
  if (options.json) {
    print_json(plan, load);
  } else {
    print_table(plan, options, load);
  }
  const std::string taken = fmt::format("{:.1f} % of its time", 100 * load.total.load);
  if (load.total.load > full) {
    throw Error(ErrorKind::data, "the bus", "would need " + taken, remedy(plan));
  }
  if (load.total.load > nearly_full_bus) {
    print_trouble("r4: warning: the bus: nearly full, {} is used; {}", taken, remedy(plan));
  }
  return 0;
}

constexpr const char* footer = R"(Examples:
  r4 bus                        eight boards on a classic bus of 1 Mbit/s, in the packed form
  r4 bus --boards 2 --plain     two boards in plain text (pack=0)
  r4 bus --plain --fd           eight boards in plain text on CAN FD
  r4 bus --boards 3 --bitrate 500000 --rate 50 --fields DEFAULT,ENC1,ENC2

  r4 bus can://can0             a real bus: the traffic of each id; r4 only listens

A plan also counts heartbeats: 2 a second from each board and 10 a second to each board. If a datagram to a
board needs more than one frame, the board answers with a frame of flow control, which is counted too.

load is the part of the bus's time that the frames of driving boards use, counted to the bit. worst is the
load if all values are longest and all frames have the most stuff bits. Above 80 % of load, r4 gives a
warning, because damaged frames are repeated, and frames with a high id wait longer.

For a real bus, r4 shows the last second on a terminal, until Ctrl-C. Otherwise, or with --duration, r4
prints one table. The bit rates are those of the controller. If the controller does not report them (slcan),
or the bus is virtual, r4 uses --bitrate (default 1 Mbit/s), and --dbitrate for CAN FD frames that switch
the bit rate. If a needed option is missing, r4 gives a warning.

Exit codes: 0 the traffic fits; 1 the load is more than 100 %; 2 an option is wrong; 4, 5, 6 the interface
cannot be opened.)";

}  // namespace

void add_bus(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(
      root, chosen, "bus", "Show the load of a CAN bus, planned or real", footer, options, bus);
  add_text(
      *command, "URL", [options](const std::string& url) { options->url = url; },
      "a real bus, such as can://can0 (default: a planned bus)", url_type, Need::optional);
  add_number(*command, "--boards", options->boards, 1, can_nodes, "boards on the bus (default 8)");
  add_number(*command, "--rate", options->rate, 1, 1000,
             "states a second of each board (default 100)");
  add_fields(*command, options->fields,
             "state fields (default DEFAULT,SAFE,CMD, as r4 asks; arming adds RELAYS)");
  add_number(*command, "--commands", options->commands, 0, 1000,
             "commands a second to each board (default 20)");
  add_number(*command, "--bitrate", options->bit_rate, 10000, 1000000,
             "bit rate in bit/s, with --fd of the nominal phase (default 1000000)");
  add_flag(*command, "--fd", options->fd, "CAN FD with frames of up to 64 bytes");
  add_number(*command, "--dbitrate", options->data_bit_rate, 10000, 8000000,
             "bit rate of the data phase in bit/s, with --fd (default 5000000)");
  add_flag(*command, "--plain", options->plain, "plain text (pack=0) instead of the packed form");
  exclude(*command, "URL", {"--boards", "--rate", "--fields", "--commands", "--fd", "--plain"});
  add_duration(*command, options->duration, "how long to listen to a real bus");
  add_json(*command, options->json, "print JSON, one object a line");
}

}  // namespace r4::tool
