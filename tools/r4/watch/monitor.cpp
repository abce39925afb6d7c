// SPDX-License-Identifier: GPL-3.0-or-later
// r4 monitor: shows what a board says, and keeps its link alive meanwhile.
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../devices/device_setup.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/paths.hpp"
#include "../shell/run_end.hpp"
#include "../shell/subcommands.hpp"
#include "monitor_boards.hpp"
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
// With --count alone: how long a board may stay silent from the start.
constexpr Milliseconds patience{5000};
// With --device: for how long another host must control the board until it is left to that one, and
// how long the board has to confirm that.
constexpr Milliseconds busy_patience{1500}, release_time{200};

struct MonitorOptions {
  std::vector<std::string> urls;
  bool json = false;
  bool control = false;
  std::uint64_t count = 0;  // 0: no end
  std::optional<Milliseconds> duration;
  std::string fields;
  std::vector<std::string> devices;
  std::string key;
};

BoardOptions board_options(const MonitorOptions& options, const std::vector<Device>& devices = {}) {
  BoardOptions board_options = with_key(options.key);
  const bool controls = options.control && devices.empty();
  board_options.role = controls ? BoardRole::control : BoardRole::watch;
  board_options.session.arming = Arming::off;  // it drives nothing
  if (!options.fields.empty()) board_options.session.fields = options.fields;
  for (const Device& device : devices) board_options.session.fields += "," + device.fields();
  return board_options;
}

class Monitor {
 public:
  Monitor(const MonitorOptions& options, std::string url)
      : options_(options),
        url_(std::move(url)),
        devices_(Device::from(options.devices)),
        board_(io_, url_, board_options(options, devices_)),
        view_(options.json                   ? make_json_view(board_)
              : ::isatty(STDOUT_FILENO) != 0 ? make_live_view(board_)
                                             : make_plain_view()),
        run_end_(io_),
        tick_(io_),
        end_(io_) {}

  int run() {
    connect();
    board_.open();
    if (!devices_.empty()) set_devices_up();
    run_end_.watch();
    end_after(options_.duration ? *options_.duration : patience);
    next_tick();
    io_.run();
    view_->on_end();
    view_->on_tick();
    const std::uint64_t skipped = view_->skipped();
    if (skipped != 0) {
      fmt::print(stderr, "r4: {} lines were left out: whoever reads the output is too slow\n",
                 skipped);
    }
    const Statistics statistics = board_.statistics();
    require_one_board(board_);
    say_farewell(io_, board_);
    view_.reset();
    if (statistics.received == 0) throw silence(statistics);
    return 0;
  }

 private:
  void connect() {
    board_.on_state([this](const ReceivedState& state, const Datagram& datagram) {
      view_->on_state(state, datagram);
      tell_readings(state);
      if (++states_ == options_.count) io_.stop();
    });
    board_.on_board_heartbeat([this](const Datagram& d) { view_->on_heartbeat(d); });
    board_.on_nack([this](const Nack& nack, const Datagram& d) {
      // A path that is about to join is answered so, while another one carries.
      const LinkStatus link = board_.link();
      const bool busy = link.causes.has(LinkCause::busy);
      if (nack.code == Refusal::busy && link.carrying != 0 && !busy) return;
      view_->on_nack(nack, d);
    });
    board_.on_bad_datagram([this](const ReadResult& result, std::string_view bytes) {
      view_->on_bad_datagram(result, bytes);
    });
    board_.on_link([this](const LinkStatus& status) {
      view_->on_link(status);
      if (status.causes.has(LinkCause::two_boards)) io_.stop();
    });
    board_.on_event([this](const CarrierEvent& event) { view_->on_event(event); });
    on_paths(board_, [this](const PathStatus& path) { view_->on_path(path); });
  }

  // The program that controls the board sets devices up: this one, where no other does. Else what
  // that program has set up is shown.
  void set_devices_up() {
    setup_.emplace(io_, board_, devices_,
                   [this](const Problem& problem) { view_->on_device_trouble(problem); });
    try {
      board_.take_control();
    } catch (const Error& error) {
      if (!error.holder()) throw;
    }
  }

  // A host that was killed keeps its board until the board's timeout.
  void look_who_controls() {
    const bool busy = board_.link().causes.has(LinkCause::busy);
    busy_ticks_ = setup_ && busy ? busy_ticks_ + 1 : 0;
    if (busy_ticks_ * tick != busy_patience) return;
    board_.async_release_control(release_time, [](const CommandResult&) {});
  }

  // Each reading once, and again when the board has begun anew.
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
        view_->on_reading(news);
      }
    }
  }

  void end_after(Milliseconds time) {
    end_.expires_after(time);
    end_.async_wait([this](const std::error_code& error) {
      if (error) return;
      const bool waited_in_vain = options_.count != 0 && board_.statistics().received == 0;
      if (options_.duration || waited_in_vain) io_.stop();
    });
  }

  void next_tick() {
    tick_.expires_after(tick);
    tick_.async_wait([this](const std::error_code& error) {
      if (error) return;
      view_->on_tick();
      look_who_controls();
      next_tick();
    });
  }

  Error silence(const Statistics& statistics) const {
    if (statistics.damaged != 0) {
      return {ErrorKind::refused, url_,
              fmt::format("{} datagrams came, none of them valid", statistics.damaged),
              "see that it is an R4 board, and that both ends have the same speed"};
    }
    return Error(explain(url_, board_.link()));
  }

  const MonitorOptions& options_;
  const std::string url_;
  const std::vector<Device> devices_;
  asio::io_context io_{1};
  AsyncBoard board_;
  std::unique_ptr<MonitorView> view_;
  RunEnd run_end_;
  asio::steady_timer tick_;
  asio::steady_timer end_;
  std::uint64_t states_ = 0;
  std::optional<DeviceSetup> setup_;
  std::array<std::optional<std::uint32_t>, i2c_slots> told_ms_;
  int busy_ticks_ = 0;
};

// can://can0 and nothing else: all boards.
bool is_whole_bus(const std::string& text) {
  if (split_paths(text).size() > 1) return false;
  const Url url = Url::parse(text);
  return url.scheme() == "can" && text.find('?') == std::string::npos;
}

int monitor(const MonitorOptions& options) {
  std::vector<std::string> urls;
  for (PatternUrl& each : expand_urls(options.urls)) urls.push_back(std::move(each.url));
  if (urls.size() == 1 && is_whole_bus(urls.front())) {
    const Url url = Url::parse(urls.front());
    const std::string& interface = can_interface_of(url);
    if (!options.fields.empty() || !options.devices.empty()) {
      throw Error(ErrorKind::usage, options.fields.empty() ? "--device" : "--fields",
                  "only one board can be asked for its fields",
                  "name the board: " + url.text() + "?node=1");
    }
    monitor_bus({interface, options.json, options.count, options.duration});
    return 0;
  }
  if (urls.size() > 1) {
    if (!options.devices.empty()) {
      throw Error(ErrorKind::usage, "--device", "is for one board", "name one");
    }
    monitor_boards({urls, board_options(options), options.json, options.count, options.duration});
    return 0;
  }
  return Monitor(options, urls.front()).run();
}

constexpr const char* monitor_footer =
    R"(On a terminal: a status, redrawn in place. Into a pipe: one line a state. With --json: one object a
line, with type (state, heartbeat, link, nack, error), transport, pnum, t and fields (numbers as
numbers, several values as an array); of one board on a CAN bus, at the end, one of type transfers.
The causes of a link say what is wrong with it, the gravest first: transport down, two boards,
watchdog, callback, foreign frames, busy (another host controls the board), board has no key,
key needed, key not taken, watchers full, not watchable, late frames, other board.

The monitor watches: it sends no heartbeats and takes no control, and a board that no host controls
streams to it all the same. With --control it takes part in the link, as a host that commands nothing:
the board is ACTIVE. It goes on when the transport is lost and comes back. On a CAN bus a board that
no host controls streams five times a second; without a node it only listens, and shows every board that it
hears. Of several boards, by URLs or a pattern, it is a table, or the JSON of each.

Where + joins several paths to a board, it has a line for each of them, and one when a path begins to carry or
ceases to; in JSON of type path, also at the end.

With --device it shows what a sensor on the user's I2C bus measures, with units; in JSON a line of type
reading, whose t is when the board read it. r4 devices lists what is described; NAME may be the path of a
file of your own, and :SLOT behind the address is the first slot that it takes. Where no host controls the
board, it takes control and sets the device up, which may write to it; where one does, it shows the slots
as that host has set them up.

Examples:
  r4 monitor udp://192.168.0.125
  r4 monitor serial:auto --fields DEFAULT,ENC1,US1
  r4 monitor serial:auto+udp://192.168.0.125    one board by two paths
  r4 monitor 'udp:?id=left-arm'         the board of that name, wherever it is; r4 list shows them
  r4 monitor serial:auto --device bno055@0x28 --device ina219@0x40
  r4 monitor can://can0                 every board on the bus; can://can0?node=3 is one
  r4 monitor 'udp://10.0.0.{1-30}?listen=0'   thirty boards
  r4 monitor udp://127.0.0.1 --json --count 100 | jq .fields.AIN24

Exit codes: 0 ended by --count, --duration or Ctrl-C; 3 nothing was heard; 2 usage; 4 the transport
cannot be opened; 5 permission denied.)";

}  // namespace

void add_monitor(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<MonitorOptions>();
  CLI::App* const command = add_subcommand(root, chosen, "monitor", "Show what a board says, live",
                                           monitor_footer, options, monitor);
  add_boards(*command, options->urls);
  add_json(*command, options->json, "print JSON, one object a line");
  add_number(*command, "--count", options->count, 1, ~std::uint64_t{0},
             "end after that many states (or 5 s in which nothing at all is heard)");
  add_duration(*command, options->duration);
  add_fields(*command, options->fields);
  add_repeated(*command, "--device", options->devices,
               "a described one on the user's I2C bus, such as bno055@0x28: shows what it measures",
               "NAME@ADDRESS");
  add_flag(*command, "--control", options->control,
           "take control: send heartbeats, so that the board is ACTIVE");
  add_key(*command, options->key);
}

}  // namespace r4::tool
