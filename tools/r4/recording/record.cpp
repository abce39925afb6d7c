// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../boards/board_set.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "limits.hpp"
#include "r4link/async_board.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"
#include "r4link/recording.hpp"

namespace r4::tool {
namespace {

struct RecordOptions {
  std::vector<std::string> urls;
  std::string file;
  std::vector<std::string> rotate;
  std::string keep;
  std::optional<Milliseconds> duration;
  std::string fields;
  std::string key;
  std::vector<std::string> devices;
};

RecordingOptions limits_of(const RecordOptions& options) {
  RecordingOptions limits;
  for (const std::string& each : options.rotate) take_rotation(each, limits);
  if (!options.keep.empty()) limits.keep_bytes = read_size("--keep", options.keep);
  return limits;
}

class BusListener {
 public:
  BusListener(asio::io_context& io, const std::string& interface,
              std::function<void(std::uint8_t node)> on_board)
      : url_("can://" + interface), listener_(io, interface, any_rate) {
    listener_.survey().on_datagram(
        [this, on_board = std::move(on_board)](std::uint8_t node, const Datagram&) {
          if (!std::exchange(heard_[node % can_nodes], true)) on_board(node);
        });
  }

  void require_boards() const {
    if (std::find(heard_.begin(), heard_.end(), true) != heard_.end()) return;
    throw Error(
        ErrorKind::refused, url_, "no board was found on the bus",
        "check that boards are connected and have the bit rate of this bus, which r4 list shows");
  }

 private:
  // Any rate is valid, because the bus load is not used here.
  static constexpr CanBitRate any_rate{1000000, 0};

  const std::string url_;
  CanListener listener_;
  std::array<bool, can_nodes> heard_{};
};

class Recorders {
 public:
  explicit Recorders(const RecordOptions& options)
      : devices_(Device::from(options.devices)),
        board_options_(watching(options.key, options.fields, devices_)) {
    std::vector<std::string> buses;
    for (const PatternUrl& each : expand_urls(options.urls)) {
      const std::string bus = whole_bus(each.url);
      bus.empty() ? add(each.url) : buses.push_back(bus);
    }
    recording_.emplace(options.file, limits_of(options));
    for (const std::string& bus : buses) {
      buses_.push_back(
          std::make_unique<BusListener>(boards_.io(), bus, [this, bus](std::uint8_t node) {
            add(fmt::format("can://{}?node={}", bus, node));
            open(boards_[boards_.size() - 1].board);
          }));
    }
  }

  int run(const RecordOptions& options) {
    for (SetBoard& each : boards_) open(each.board);
    boards_.end_by_signal(options.duration);
    const auto began = std::chrono::steady_clock::now();
    boards_.run();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
    boards_.leave();
    recording_->close();
    if (has_ended()) throw Error(*recording_->problem());
    tell_loss();
    print_text("{}: {} datagrams and events in {:.1f} s\n", options.file, recording_->records(),
               took.count());
    if (recording_->dropped() != 0) {
      print_trouble("r4: {} more datagrams and events were left out: the disk is too slow",
                    recording_->dropped());
    }
    for (const auto& bus : buses_) bus->require_boards();
    boards_.require_heard();
    return lost_ ? static_cast<int>(ErrorKind::data) : 0;
  }

 private:
  // A removed or truncated recording continues in a new file. Any other problem ends the recording.
  bool has_ended() const {
    const std::optional<Problem> problem = recording_->problem();
    return problem && problem->kind != ErrorKind::data;
  }
  void tell_loss() {
    const std::optional<Problem> problem = recording_->problem();
    if (!problem || std::exchange(lost_, true)) return;
    print_trouble("r4: " + problem->text());
  }
  void add(const std::string& url) { boards_.add(url, board_options_); }
  void open(AsyncBoard& board) {
    board.on_event([this](const CarrierEvent&) {
      if (has_ended()) return boards_.stop();
      tell_loss();
    });
    for (const Device& device : devices_) board.describe(device);
    board.record(*recording_);
    board.open();
  }

  const std::vector<Device> devices_;
  const BoardOptions board_options_;
  std::optional<Recording> recording_;
  BoardSet boards_;
  std::vector<std::unique_ptr<BusListener>> buses_;
  bool lost_ = false;  // a loss of recorded data has been reported
};

int record(const RecordOptions& options) { return Recorders(options).run(options); }

constexpr const char* record_footer =
    R"(Records every datagram of every board, in both directions, with the host's time and the path; also
damaged datagrams and the events of the links. r4 record only watches, as r4 monitor does: it does
not take control, and does not disturb a program that drives a board. It continues when a transport
disconnects and reconnects. If another program moves, removes or truncates the file, r4 record
starts a new file and reports this. If another program controls the board, --fields may have no effect
(docs/how-to/sharing.md).

The file is text, one line for each datagram (docs/how-to/recordings.md); if its name ends in .zst,
it is compressed. An existing recording is continued at its end. A crash costs at most the last
second. With --rotate or --keep the files are drive-00001.r4log, drive-00002.r4log …, each complete
in itself.

Examples:
  r4 record udp://192.168.0.125 -o drive.r4log
  r4 record serial:auto 'can://can0?node=3' -o drive.r4log.zst --duration 60
  r4 record serial:auto+udp://192.168.0.125 -o drive.r4log    one board, by both paths
  r4 record serial:auto -o drive.r4log --device bno055@0x28:1    which another program has set up
  r4 record can://can0 -o bus.r4log     every board on the bus
  r4 record 'udp://10.0.0.{1-30}?listen=0' -o lab.r4log.zst     thirty boards
  r4 record udp:auto -o /var/log/robot.r4log.zst --rotate 1h --rotate 100M --keep 2G
  grep ' 1> ' drive.r4log               the datagrams to the first board
  r4 info drive.r4log                   a summary of the recording

Exit codes: 0 ended by --duration or Ctrl-C; 1 the file was removed or truncated during recording; 3
no datagram came from a board; 2 usage; 4 the file or the transport cannot be opened, or the disk is
full; 5 permission denied.)";

}  // namespace

void add_record(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<RecordOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "record", "Record the datagrams of boards, in both directions",
                     record_footer, options, record);
  add_boards(*command, options->urls);
  add_text(*command, "-o,--output", options->file, "the recording", file_type, Need::required);
  add_duration(*command, options->duration);
  add_repeated(*command, "--rotate", options->rotate,
               "start a new file after a size (100M) or a time (10min); twice for both", "LIMIT");
  add_text(*command, "--keep", options->keep,
           "remove the oldest files when all files exceed this size (2G)", "SIZE");
  add_fields(*command, options->fields);
  add_repeated(*command, "--device", options->devices,
               "also record the bytes of a described device and its description (r4 devices)",
               "NAME@ADDRESS");
  add_key(*command, options->key);
}

}  // namespace r4::tool
