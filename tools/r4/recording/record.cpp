// SPDX-License-Identifier: GPL-3.0-or-later
// r4 record: watches boards, and writes down what is said.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/paths.hpp"
#include "../shell/run_end.hpp"
#include "../shell/subcommands.hpp"
#include "host/standard_registry.hpp"
#include "limits.hpp"
#include "r4link/async_board.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/discovery/url_pattern.hpp"
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

BoardOptions board_options(const RecordOptions& options, const std::vector<Device>& devices) {
  BoardOptions board_options = with_key(options.key);
  board_options.role = BoardRole::watch;
  board_options.session.arming = Arming::off;  // it drives nothing
  if (!options.fields.empty()) board_options.session.fields = options.fields;
  for (const Device& device : devices) board_options.session.fields += "," + device.fields();
  return board_options;
}

// can://can0, without a node: all boards that are heard on it.
bool is_whole_bus(const std::string& text) {
  return split_paths(text).size() == 1 && Url::parse(text).scheme() == "can" &&
         text.find('?') == std::string::npos;
}

// Tells the nodes of the boards on a bus, when they are heard first.
class BusListener {
 public:
  BusListener(asio::io_context& io, const std::string& url,
              std::function<void(std::uint8_t node)> on_board)
      : url_(url), listener_(io, can_interface_of(Url::parse(url)), any_rate) {
    listener_.survey().on_datagram(
        [this, on_board = std::move(on_board)](std::uint8_t node, const Datagram&) {
          if (!std::exchange(heard_[node % can_nodes], true)) on_board(node);
        });
  }

  void require_boards() const {
    if (std::find(heard_.begin(), heard_.end(), true) != heard_.end()) return;
    throw Error(ErrorKind::refused, url_, "no board was heard",
                "see that boards are connected and have this bus's bit rate; r4 list shows it");
  }

 private:
  // The load of the bus is not asked here.
  static constexpr CanBitRate any_rate{1000000, 0};

  const std::string url_;
  CanListener listener_;
  std::array<bool, can_nodes> heard_{};
};

class Recorders {
 public:
  explicit Recorders(const RecordOptions& options)
      : devices_(Device::from(options.devices)),
        board_options_(board_options(options, devices_)),
        run_end_(io_) {
    std::vector<std::string> buses;
    for (const PatternUrl& each : expand_urls(options.urls)) {
      is_whole_bus(each.url) ? buses.push_back(each.url) : add(each.url);
    }
    recording_.emplace(options.file, limits_of(options));
    for (const std::string& bus : buses) {
      buses_.push_back(std::make_unique<BusListener>(io_, bus, [this, bus](std::uint8_t node) {
        add(fmt::format("{}?node={}", bus, node));
        open(*boards_.back());
      }));
    }
  }

  int run(const RecordOptions& options) {
    for (const auto& board : boards_) open(*board);
    run_end_.watch(options.duration);
    const auto began = std::chrono::steady_clock::now();
    io_.run();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
    for (const auto& board : boards_) board->close();
    recording_->close();
    if (has_ended()) throw Error(*recording_->problem());
    tell_loss();
    print_text(fmt::format("{}: {} datagrams and events in {:.1f} s\n", printable(options.file),
                           recording_->records(), took.count()));
    if (recording_->dropped() != 0) {
      fmt::print(stderr, "r4: {} more were left out: the disk is too slow\n",
                 recording_->dropped());
    }
    for (const auto& bus : buses_) bus->require_boards();
    for (const auto& board : boards_) {
      require_one_board(*board);
      if (board->statistics().received == 0) throw Error(explain(board->name(), board->link()));
    }
    return lost_ ? static_cast<int>(ErrorKind::data) : 0;
  }

 private:
  // A recording that was removed or truncated goes on; one that cannot be written has ended.
  bool has_ended() const {
    const std::optional<Problem> problem = recording_->problem();
    return problem && problem->kind != ErrorKind::data;
  }
  void tell_loss() {
    const std::optional<Problem> problem = recording_->problem();
    if (!problem || std::exchange(lost_, true)) return;
    print_trouble("r4: " + problem->text());
  }
  void add(const std::string& url) {
    boards_.push_back(std::make_unique<AsyncBoard>(io_, url, board_options_));
  }
  void open(AsyncBoard& board) {
    board.on_event([this](const CarrierEvent&) {
      if (has_ended()) return io_.stop();
      tell_loss();
    });
    for (const Device& device : devices_) board.describe(device);
    board.record(*recording_);
    board.open();
  }

  const std::vector<Device> devices_;
  const BoardOptions board_options_;
  asio::io_context io_{1};
  std::optional<Recording> recording_;
  std::vector<std::unique_ptr<AsyncBoard>> boards_;
  std::vector<std::unique_ptr<BusListener>> buses_;
  RunEnd run_end_;
  bool lost_ = false;  // what was recorded is, and that is told
};

int record(const RecordOptions& options) { return Recorders(options).run(options); }

constexpr const char* record_footer =
    R"(Every datagram of every board, in both directions, with the host's time and the path that it came
by; damaged ones, too; and what happened to the links. It watches, as r4 monitor does: it takes no
control, and a program that drives a board is not disturbed. It goes on when a transport is lost and
comes back. If another program moves, removes or truncates the file, it is begun anew, and told of.

The file is text, one line a datagram (docs/recordings.md); one whose name ends in .zst is compressed.
A recording that is there goes on at its end. A crash costs at most the last second. With --rotate or
--keep the files are drive-00001.r4log, drive-00002.r4log …, each whole in itself.

Examples:
  r4 record udp://192.168.0.125 -o drive.r4log
  r4 record serial:auto 'can://can0?node=3' -o drive.r4log.zst --duration 60
  r4 record serial:auto+udp://192.168.0.125 -o drive.r4log    one board, by both paths
  r4 record serial:auto -o drive.r4log --device bno055@0x28:1    which another program has set up
  r4 record can://can0 -o bus.r4log     every board that is heard on the bus
  r4 record 'udp://10.0.0.{1-30}?listen=0' -o lab.r4log.zst     thirty boards
  r4 record udp:auto -o /var/log/robot.r4log.zst --rotate 1h --rotate 100M --keep 2G
  grep ' 1> ' drive.r4log               what was sent to the first board
  r4 info drive.r4log                   what is in it

Exit codes: 0 ended by --duration or Ctrl-C; 1 the file was removed or truncated meanwhile; 3 a board was
not heard; 2 usage; 4 the file or the transport cannot be opened, or the disk is full; 5 permission denied.)";

}  // namespace

void add_record(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<RecordOptions>();
  CLI::App* const command =
      add_subcommand(root, chosen, "record", "Write down what is said, in both directions",
                     record_footer, options, record);
  add_boards(*command, options->urls);
  add_text(*command, "-o,--output", options->file, "the recording", file_type, Need::required);
  add_duration(*command, options->duration);
  add_repeated(*command, "--rotate", options->rotate,
               "begin a new file after a size (100M) or a time (10min); give it twice for both",
               "LIMIT");
  add_text(*command, "--keep", options->keep, "remove the oldest files beyond that size (2G)",
           "SIZE");
  add_fields(*command, options->fields);
  add_repeated(*command, "--device", options->devices,
               "also the bytes of a described device, and what they mean (r4 devices)",
               "NAME@ADDRESS");
  add_key(*command, options->key);
}

}  // namespace r4::tool
