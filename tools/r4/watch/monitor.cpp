// SPDX-License-Identifier: GPL-3.0-or-later
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "../boards/paths.hpp"
#include "../devices/device_setup.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/output.hpp"
#include "../shell/subcommands.hpp"
#include "board_table.hpp"
#include "monitor_bus.hpp"
#include "monitor_view.hpp"
#include "r4link/async_board.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/error.hpp"
#include "r4link/link.hpp"

namespace r4::tool {
namespace {

constexpr Milliseconds tick{100};
constexpr Milliseconds table_interval{1000};
// With --count only: the longest silence of the boards after the start.
constexpr Milliseconds patience{5000};
// With --device. After another host has controlled the board for busy_patience, this program
// releases the board. The board has release_time to confirm the release.
constexpr Milliseconds busy_patience{1500}, release_time{200};
// Bytes that wait for a reader. For one board: about half a second of states.
constexpr std::size_t unread_of_board = 32768, most_unread = std::size_t{1} << 18;

struct MonitorOptions {
  std::vector<std::string> urls;
  bool json = false;
  bool control = false;
  std::uint64_t count = 0;  // 0: unlimited
  std::optional<Milliseconds> duration;
  std::string fields;
  std::vector<std::string> devices;
  std::string key;
};

BoardOptions board_options(const MonitorOptions& options, const std::vector<Device>& devices) {
  BoardOptions board = watching(options.key, options.fields, devices);
  if (options.control && devices.empty()) board.role = BoardRole::control;
  return board;
}

class Monitor {
 public:
  explicit Monitor(const MonitorOptions& options)
      : options_(options),
        devices_(Device::from(options.devices)),
        boards_(options.urls, board_options(options, devices_)),
        lines_(std::in_place, std::min(unread_of_board * boards_.size(), most_unread)),
        tick_(boards_.io()),
        table_tick_(boards_.io()),
        patience_(boards_.io()) {
    if (boards_.size() > 1 && !devices_.empty()) {
      throw Error(ErrorKind::usage, "--device", "is possible only with one board",
                  "give the URL of one board");
    }
    const bool live = ::isatty(STDOUT_FILENO) != 0;
    if (boards_.size() > 1 && !options.json) table_.emplace(boards_, live, *lines_);
    for (const SetBoard& each : boards_) {
      views_.push_back(options.json ? make_json_view(each.board, *lines_)
                       : table_     ? table_->view(each.index)
                       : live       ? make_live_view(each.board)
                                    : make_plain_view(*lines_));
    }
  }

  int run() {
    for (SetBoard& each : boards_) listen(each.board, *views_[each.index]);
    boards_.open();
    if (!devices_.empty()) set_devices_up();
    boards_.end_by_signal(options_.duration);
    if (options_.count != 0 && !options_.duration) {
      patience_.after(patience, [this] {
        if (none_heard()) boards_.stop();
      });
    }
    tick_.every(tick, [this] {
      for (const auto& view : views_) view->on_tick();
      look_who_controls();
    });
    if (table_) table_tick_.every(table_interval, [this] { table_->show(); });
    boards_.run();
    tick_.cancel();
    table_tick_.cancel();
    for (const auto& view : views_) {
      view->on_end();
      view->on_tick();
    }
    if (table_) table_->show();
    const std::uint64_t lost = lines_->lost();
    boards_.leave();  // before printing, which a reader may block
    views_.clear();
    lines_.reset();
    if (lost != 0) {
      print_trouble("r4: {} lines were left out: the reader of the output is too slow", lost);
    }
    boards_.require_heard();
    return 0;
  }

 private:
  void listen(AsyncBoard& board, MonitorView& view) {
    board.on_state([this, &view](const ReceivedState& state, const Datagram& datagram) {
      if (boards_.stopped()) return;  // received together with the last state
      view.on_state(state, datagram);
      tell_readings(state);
      if (++states_ == options_.count) boards_.stop();
    });
    board.on_board_heartbeat([&view](const Datagram& datagram) { view.on_heartbeat(datagram); });
    board.on_nack([&board, &view](const Nack& nack, const Datagram& datagram) {
      // While one path carries, another path that is joining may be refused as busy.
      const LinkStatus link = board.link();
      const bool busy = link.causes.has(LinkCause::busy);
      if (nack.code == Refusal::busy && link.carrying != 0 && !busy) return;
      view.on_nack(nack, datagram);
    });
    board.on_bad_datagram([&view](const ReadResult& result, std::string_view bytes) {
      view.on_bad_datagram(result, bytes);
    });
    board.on_link([this, &view](const LinkStatus& status) {
      view.on_link(status);
      if (status.causes.has(LinkCause::two_boards)) boards_.stop();
    });
    board.on_event([&view](const CarrierEvent& event) { view.on_event(event); });
    on_paths(board, [&view](const PathStatus& path) { view.on_path(path); });
  }

  // The controlling host sets devices up, so this program takes control if no other host has it.
  void set_devices_up() {
    AsyncBoard& board = boards_[0].board;
    setup_.emplace(boards_.io(), board, devices_,
                   [this](const Problem& problem) { views_[0]->on_device_trouble(problem); });
    try {
      board.take_control();
    } catch (const Error& error) {
      if (!error.holder()) throw;
    }
  }

  // A killed host keeps control of its board until the board's timeout.
  void look_who_controls() {
    if (!setup_) return;
    AsyncBoard& board = boards_[0].board;
    busy_ticks_ = board.link().causes.has(LinkCause::busy) ? busy_ticks_ + 1 : 0;
    if (busy_ticks_ * tick != busy_patience) return;
    board.async_release_control(release_time, [](const CommandResult&) {});
  }

  void tell_readings(const ReceivedState& state) {
    for (const Device& device : devices_) {
      const std::vector<DeviceValue>& values = device.description().values;
      for (std::size_t poll = 0; poll < device.description().polls.size(); ++poll) {
        const std::size_t slot = static_cast<std::size_t>(device.first_slot() - 1) + poll;
        const I2cReading& read = state.raw.i2c[slot];
        if (read.data.size == 0 || told_ms_[slot] == read.t_ms) continue;
        told_ms_[slot] = read.t_ms;
        DeviceNews news{device, state.pnum, read.t_ms, {}};
        for (std::size_t i = 0; i < values.size(); ++i) {
          if (values[i].poll != poll) continue;
          news.values.push_back({&values[i], device.reading(state, i).number});
        }
        views_[0]->on_reading(news);
      }
    }
  }

  bool none_heard() const {
    return std::all_of(boards_.begin(), boards_.end(),
                       [](const SetBoard& each) { return each.board.statistics().received == 0; });
  }

  const MonitorOptions& options_;
  const std::vector<Device> devices_;
  BoardSet boards_;
  std::optional<LineWriter> lines_;
  std::optional<BoardTable> table_;
  std::vector<std::unique_ptr<MonitorView>> views_;
  Timer tick_;
  Timer table_tick_;
  Timer patience_;
  std::uint64_t states_ = 0;
  std::optional<DeviceSetup> setup_;
  std::array<std::optional<std::uint32_t>, i2c_slots> told_ms_;
  int busy_ticks_ = 0;
};

int monitor(const MonitorOptions& options) {
  const std::vector<PatternUrl> urls = expand_urls(options.urls);
  const std::string bus = urls.size() == 1 ? whole_bus(urls.front().url) : "";
  if (bus.empty()) return Monitor(options).run();
  if (!options.fields.empty() || !options.devices.empty()) {
    throw Error(ErrorKind::usage, options.fields.empty() ? "--device" : "--fields",
                "is possible only with one board, not a whole bus",
                "give the board's URL: can://" + bus + "?node=1");
  }
  monitor_bus({bus, options.json, options.count, options.duration});
  return 0;
}

constexpr const char* monitor_footer =
    R"(On a terminal: a status, redrawn in place. Into a pipe: one line for each state. With --json: one
object a line, with type (state, heartbeat, link, nack, error), transport, pnum, t and fields
(numbers as numbers, several values as an array). For a board on a CAN bus, the last object has type
transfers. The causes of a link report its faults, the gravest first: transport down, two boards,
watchdog, callback, foreign frames, busy (another host controls the board), board has no key, key
needed, key not taken, watchers full, not watchable, late frames, other board.

The monitor only watches: it does not send heartbeats or take control. A board that no host controls
still streams its state to the monitor. With --control the monitor takes control and does not
command outputs, so the board is ACTIVE. The monitor continues when the transport disconnects and
reconnects. On a CAN bus, a board that no host controls streams five times a second. A CAN URL
without a node only listens, and shows every board on the bus. For several boards, by URLs or a
pattern, the monitor shows a table, or the JSON of each board. If another program controls the board,
--fields may have no effect (docs/how-to/sharing.md).

For a board with several paths, joined by +, the monitor shows a line for each path, and reports
when a path begins or ceases to carry datagrams. In JSON these objects have type path, also at the
end.

With --device the monitor shows the measured values of a sensor on the user's I2C bus, with units.
In JSON these objects have type reading, and t is the time of the reading. r4 devices lists the
described devices. NAME may be the path of your own file, and :SLOT after the address is the first
slot to use. If no host controls the board, the monitor takes control and sets the device up, which
may write to the device. If a host controls the board, the monitor shows the slots as that host has
set them up.

Examples:
  r4 monitor udp://192.168.0.125
  r4 monitor serial:auto --fields DEFAULT,ENC1,US1
  r4 monitor serial:auto+udp://192.168.0.125    one board by two paths
  r4 monitor 'udp:?id=left-arm'         the board with this name; r4 list shows the names
  r4 monitor serial:auto --device bno055@0x28 --device ina219@0x40
  r4 monitor can://can0                 every board on the bus; can://can0?node=3 is one board
  r4 monitor 'udp://10.0.0.{1-30}?listen=0'   thirty boards
  r4 monitor udp://127.0.0.1 --json --count 100 | jq .fields.AIN24

Exit codes: 0 ended by --count, --duration or Ctrl-C; 3 nothing was received; 2 usage; 4 the
transport cannot be opened; 5 permission denied.)";

}  // namespace

void add_monitor(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<MonitorOptions>();
  CLI::App* const command = add_subcommand(
      root, chosen, "monitor", "Show the states of boards, live", monitor_footer, options, monitor);
  add_boards(*command, options->urls);
  add_json(*command, options->json, "print JSON, one object a line");
  add_number(*command, "--count", options->count, 1, ~std::uint64_t{0},
             "end after this number of states (or after 5 s without any datagram)");
  add_duration(*command, options->duration);
  add_fields(*command, options->fields);
  add_repeated(*command, "--device", options->devices,
               "show the values of a described device on the I2C bus, such as bno055@0x28",
               "NAME@ADDRESS");
  add_flag(*command, "--control", options->control,
           "take control: send heartbeats, so that the board is ACTIVE");
  add_key(*command, options->key);
}

}  // namespace r4::tool
