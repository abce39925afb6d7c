// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../boards/run_end.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "firmware/ports/sim/simulated_board.hpp"
#include "host/commands/command_help.hpp"
#include "host/standard_registry.hpp"
#include "input_lines.hpp"
#include "protocol/messages/settings.hpp"
#include "r4link/config.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/vocabulary.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "sim_log.hpp"
#include "transports/impaired/impaired_carrier.hpp"
#include "transports/registry.hpp"

namespace r4::tool {
namespace {

struct SimOptions {
  std::vector<std::string> urls;
  bool json = false;
  bool quiet = false;
  std::optional<Milliseconds> duration;
  std::optional<Milliseconds> sensors;
  std::string script;
  bool input = false;
  std::optional<std::uint64_t> seed;
  std::string board_id;
  std::vector<std::string> settings;
  std::vector<std::string> devices;
  std::string wiring;
  std::string wired;
  bool as_new = false;
  std::optional<Impairment> link;
};

void check_id(const std::string& id) {
  if (is_board_id(Text(id))) return;
  throw Error(ErrorKind::usage, "--board-id " + id, "is not a valid board id",
              fmt::format("use 1 to {} letters, digits, _ and -", board_id_max));
}

sim::ScriptStep connection_of(const std::string& name) {
  try {
    return sim::Script::parse_now("device " + name + " on", "--device").value();
  } catch (const Error& error) {
    const Problem& problem = error.problem();
    throw Error(ErrorKind::usage, "--device " + name, problem.reason, problem.fix);
  }
}

Settings read_settings(const std::vector<std::string>& texts) {
  Settings settings;
  for (const std::string& text : texts) {
    const std::size_t comma = text.find(',');
    const std::string key = text.substr(0, comma);
    const std::string value = comma == std::string::npos ? "" : text.substr(comma + 1);
    const Refusal refusal = set(settings, Text(key), Text(value));
    if (refusal == Refusal::none) continue;
    Problem problem = bad_command("C:" + text, refusal);
    problem.thing.replace(0, 2, "--set ");
    throw Error(std::move(problem));
  }
  return settings;
}

struct Plan {
  std::vector<std::string> urls;
  std::string id;
  std::uint64_t number = 0;
};

std::vector<Plan> plans_of(const SimOptions& options) {
  const std::string id = options.board_id.empty() ? "sim" : options.board_id;
  for (const std::string& text : options.urls) {
    std::vector<PatternUrl> urls = expand_urls(text);
    if (urls.front().number.empty()) continue;
    if (options.urls.size() > 1) {
      throw Error(ErrorKind::usage, text, "several boards cannot share a second transport",
                  "start a separate r4 sim for each board");
    }
    std::vector<Plan> plans;
    plans.reserve(urls.size());
    for (PatternUrl& each : urls) {
      plans.push_back({split_paths(each.url), id + "-" + each.number, plans.size()});
    }
    return plans;
  }
  return {{split_paths(join_paths(options.urls)),
           options.board_id.empty() ? "sim-1" : options.board_id, 0}};
}

// Each board needs open files, and the default limit of a program may be 1024.
void allow_files_for(std::size_t boards) {
  constexpr std::size_t of_the_program = 64;
  constexpr std::size_t of_a_board = 4;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlim_t wanted = of_the_program + of_a_board * boards;
  if (limit.rlim_cur >= wanted) return;
  limit.rlim_cur = std::min<rlim_t>(wanted, limit.rlim_max);
  ::setrlimit(RLIMIT_NOFILE, &limit);  // if the limit is too low, opening a board reports it
}

class ServedBoard {
 public:
  ServedBoard(asio::io_context& io, SimOutput& output, const SimOptions& options, const Plan& plan,
              bool named)
      : log_(output, options.quiet, named ? plan.id : ""), board_(io, options_of(options, plan)) {
    for (const std::string& url : plan.urls) {
      auto carrier = standard_registry().make(io, url, Role::board);
      for (const Carrier* const other : carriers_) {
        if (other->name() != carrier->name() || !url.starts_with("can:")) continue;
        throw Error(ErrorKind::usage, url, "this board exists already", "name a node once");
      }
      if (options.link) carrier = impaired(io, std::move(carrier), *options.link);
      carriers_.push_back(carrier.get());
      board_.add_carrier(std::move(carrier));
    }
    log_.watch(board_);
  }

  void start(std::vector<std::string>& listening) {
    board_.start();
    for (const Carrier* const carrier : carriers_) listening.push_back(carrier->name());
  }

  void tell_sensors() { log_.tell_sensors(); }
  void happen(const sim::ScriptStep& step) { board_.happen(step); }

  void end() {
    for (const Carrier* const carrier : carriers_) log_.on_end(*carrier);
    for (const ImpairedCarrier* const link : links_) log_.on_impairment(*link);
  }

 private:
  std::unique_ptr<Carrier> impaired(asio::io_context& io, std::unique_ptr<Carrier> carrier,
                                    Impairment link) {
    link.seed += links_.size();  // a different seed for each transport
    auto made = make_impaired_carrier(io, std::move(carrier), link);
    links_.push_back(made.get());
    return made;
  }

  sim::SimulatedBoard::Options options_of(const SimOptions& options, const Plan& plan) {
    sim::SimulatedBoard::Options board_options;
    if (options.seed) board_options.seed = *options.seed + plan.number;
    if (!options.script.empty()) board_options.script = sim::Script::load(options.script);
    check_id(plan.id);
    board_options.board_id = plan.id;
    board_options.settings = read_settings(options.settings);
    SiteSettings& site = board_options.settings.site;
    if (!options.wiring.empty()) {
      site.wiring = load_wiring(options.wiring);
      site.wiring_source = WiringSource::given;
    }
    board_options.wired = options.wired.empty() ? site.wiring : load_wiring(options.wired);
    board_options.plan_confirmed = !options.as_new;
    board_options.firmware_version = R4LINK_VERSION;
    board_options.events = log_.events();
    return board_options;
  }

  SimLog log_;
  sim::SimulatedBoard board_;
  std::vector<const Carrier*> carriers_;
  std::vector<const ImpairedCarrier*> links_;
};

int simulate(const SimOptions& options) {
  if (options.sensors && (!options.json || options.quiet)) {
    throw Error(ErrorKind::usage, "--sensors", "needs JSON output",
                "add --json, and leave out --quiet");
  }
  asio::io_context io(1);

  std::vector<sim::ScriptStep> connections;
  for (const std::string& name : options.devices) connections.push_back(connection_of(name));
  const std::vector<Plan> plans = plans_of(options);
  allow_files_for(plans.size());
  {
    SimOutput output(options.json);
    std::vector<std::unique_ptr<ServedBoard>> boards;
    boards.reserve(plans.size());
    for (const Plan& plan : plans) {
      boards.push_back(std::make_unique<ServedBoard>(io, output, options, plan, plans.size() > 1));
    }
    std::vector<std::string> listening;
    for (const auto& board : boards) board->start(listening);
    RunEnd run_end(io);
    run_end.watch(options.duration);
    output.listening(listening);
    for (const auto& board : boards) {
      for (const sim::ScriptStep& step : connections) board->happen(step);
    }

    Timer sensors(io);
    if (options.sensors) {
      sensors.every(*options.sensors, [&boards] {
        for (const auto& board : boards) board->tell_sensors();
      });
    }
    std::optional<InputLines> input;
    if (options.input) {
      input.emplace(
          io,
          [&](const std::string& line) {
            try {
              const auto step = sim::Script::parse_now(line, "standard input");
              if (!step) return;
              for (const auto& board : boards) board->happen(*step);
            } catch (const Error& error) {
              output.problem(error.problem());
            }
          },
          [&output](const Problem* problem) {
            if (problem != nullptr) output.problem(*problem);
          });
    }
    io.run();
    for (const auto& board : boards) board->end();
  }
  return 0;
}

constexpr const char* sim_footer =
    R"(The simulated board streams its state and obeys commands like a real board. Its inputs have the
values of the paper's capture. r4 sim prints its URLs and its events; with --json, one JSON
object a line:
  {"type":"listening","url":…,"host_url":…}
  {"type":"event","t":…,"state":"CONNECTING|ACTIVE|SAFE","reason":…}   t: the board's clock, ms
An event may also have these keys:
  "board"       the board, if there are several boards
  "outputs"     the pins of the chips and the steppers, if they changed; with "supply", whether the
                motors have supply (relay 1 closed, handle held: docs/reference/safety.md)
  "fault"       a chip has a fault
  "executed", "refused"   a command
  "rejected"    a datagram that is not signed as the key requires: missing, unknown key, wrong tag,
                replayed, old
  "transport"   a transport went down or came up
  "silence"     the ms since the last heartbeat, if the board goes safe because of the silence
With --sensors, at that interval:
  {"type":"sensors","t":…,"supply":…,"handle":…,"enc":[…],"stepper":[…],"us":[…],"analog":{"AIN24":…,…}}
At the end:
  {"type":"counters","transport":…,"received":…,"sent":…,"dropped":…,…}   datagrams of a transport
with "transfers" on CAN.

--link adds faults to both directions of the link: loss, duplicate and corrupt are the percentage of
lost, duplicated and damaged datagrams; delay=20ms±10 is the delay and its variation; cut=10s+2s
blocks all datagrams for 2 s, 10 s after the start. The same seed gives the same faults. At the end
{"type":"impairment","transport":…,"received":{"passed":…,"lost":…,…},"sent":{…}} reports the
counts.

A scenario (--script) has lines such as: 0.5 handle released / 1 us 1 15 / 2 chip dac off / 3 reboot
With --stdin, a line without the time happens at once, such as: handle released. Each step is an
event with "happened"; {"type":"error",…} reports a line that is not valid.

Examples:
  r4 sim                                       at udp://127.0.0.1:2018
  r4 sim udp://127.0.0.1:0                     at any free port, which it prints
  r4 sim --link loss=5%,delay=20ms±10          over a bad WiFi
  r4 sim --stdin                               and type: us 1 15
  r4 sim --device bno055                       with a BNO055 on the user's I2C bus
  r4 sim --wiring robot.wiring                 a board with the wiring of this file
  r4 sim udp://0.0.0.0:2018 pty:/tmp/r4        two transports at once; open the second with
                                               r4 monitor serial:///tmp/r4
  r4 sim 'udp://127.0.0.1:2018?peer=127.0.0.1:2390'   streams to that port, as the paper's board
  r4 sim 'can://vcan0?node=0-7'                eight boards on one CAN bus
  r4 sim udp://127.0.0.1:20000-20099           a hundred boards, each with its own port

Exit codes: 0 ended by --duration or a signal; 1 the script is wrong; 2 usage; 4, 5 the port or
device cannot be opened.)";

}  // namespace

void add_sim(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<SimOptions>();
  options->urls = {"udp://127.0.0.1:2018"};
  CLI::App* const command =
      add_subcommand(root, chosen, "sim", "Run a simulated board", sim_footer, options, simulate);
  add_texts(*command, "URL", options->urls,
            "URLs where it listens, up to four (default udp://127.0.0.1:2018)", url_type);
  add_json(*command, options->json, "print events as JSON, one object a line");
  add_flag(*command, "--quiet", options->quiet, "print only its URLs");
  add_duration(*command, options->duration);
  add_seconds(*command, "--sensors", options->sensors,
              "with --json: print the sensor values at this interval");
  add_text(*command, "--script", options->script, "a scenario: events around the board", file_type);
  add_flag(*command, "--stdin", options->input, "read events around the board from standard input");
  add_number(*command, "--seed", options->seed, 0, ~std::uint64_t{0},
             "the same seed gives the same clock, inputs and nonces (with a key: for tests)");
  add_repeated(*command, "--set", options->settings,
               "a setting, as by C:KEY,VALUE, such as rate,50; may be repeated", "KEY,VALUE");
  add_repeated(*command, "--device", options->devices,
               "icm20948, bno055, vl53l0x or as5600 on the user's I2C bus; may be repeated",
               "NAME");
  add_text(*command, "--wiring", options->wiring,
           "wiring file of the firmware, as from r4 wiring template (default: the plan)",
           file_type);
  add_text(*command, "--wired", options->wired,
           "real wiring, if it differs from the wiring that the firmware uses (--wiring)",
           file_type);
  add_flag(*command, "--new", options->as_new, "a new board, whose wiring is not confirmed");
  add_text(
      *command, "--link",
      [options](const std::string& text) { options->link = Impairment::parse(text); },
      "link faults: loss=5%,delay=20ms±10,duplicate=1%,corrupt=0.1%,cut=10s+2s,seed=7", "HOW",
      Need::optional);
  add_text(*command, "--board-id", options->board_id,
           "the board id in the answer to Q:ID (default sim-1)", "ID");
}

}  // namespace r4::tool
