// SPDX-License-Identifier: GPL-3.0-or-later
#include "list_can.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "held_transport.hpp"
#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"
#include "transports/can/can_carrier.hpp"
#include "transports/can/can_listener.hpp"
#include "transports/url.hpp"

namespace r4::tool {
namespace {

using std::chrono::milliseconds;

// Boards without a host say so twice a second, those with one stream.
constexpr milliseconds listening{700};
// Hosts ask each second who their board is.
constexpr milliseconds longest{1300};
constexpr milliseconds look_again{20};

std::string url_of(const ListedBus& bus, std::uint8_t node) {
  return fmt::format("can://{}?node={}", bus.interface.name, node);
}

// One board that was heard: asked who it is, unless a host is there.
class NodeQuestion final : private Carrier::Handler {
 public:
  NodeQuestion(asio::io_context& io, const std::string& url, ListedBoard& board)
      : board_(board), held_(io, board, [] {}), timer_(io) {
    const Url parsed = Url::parse(url);
    held_.join(can_share_name(parsed));
    try {
      carrier_ = make_can_carrier(io, parsed, Role::host);
      carrier_->open(*this);
      ask();
    } catch (const Error&) {
      carrier_.reset();  // the interface has gone: its listener tells
    }
  }
  ~NodeQuestion() {
    if (carrier_) carrier_->close();
  }
  // What the board says to anyone.
  void hear(Text bytes) {
    if (std::optional<IdentityAnswer> identity = read_identity_answer(bytes)) {
      board_.identity = std::move(identity);
    }
  }
  bool answered() const { return board_.is_known(); }

 private:
  // As soon as nobody else was heard for as long as a host listens that comes. Whether that is a
  // host is seen by what its frames make.
  void ask() {
    if (board_.identity) return;
    const SendResult result = carrier_->send(identity_question(), Priority::normal);
    board_.foreign_frames = carrier_->trouble() == TransportTrouble::foreign_frames;
    board_.other_host = result == SendResult::busy && !board_.foreign_frames;
    if (result == SendResult::sent) ++asked_;
    if (board_.identity || asked_ == most_questions) return;
    timer_.expires_after(result == SendResult::sent ? between_questions : look_again);
    timer_.async_wait([this](const std::error_code& error) {
      if (!error) ask();
    });
  }
  void on_datagram(std::string_view, Peer) override {}  // the bus's listener hears it, too
  void on_carrier_event(const CarrierEvent&) override {}

  ListedBoard& board_;
  HeldTransport held_;
  std::unique_ptr<Carrier> carrier_;
  asio::steady_timer timer_;
  int asked_ = 0;
};

// One interface, while it is listened to.
class BusQuestion {
 public:
  BusQuestion(asio::io_context& io, ListedBus& bus) : io_(io), bus_(bus) {
    try {
      listener_ = std::make_unique<CanListener>(io, bus.interface.name, CanBitRate{1000000, 0});
    } catch (const Error& error) {
      bus.trouble = error.problem().reason;
      bus.fix = error.problem().fix;
      return;
    }
    listener_->on_event([this](const CarrierEvent& event) {
      if (event.kind == CarrierEvent::Kind::up) return;
      bus_.trouble = event.problem.reason;
      bus_.fix = event.problem.fix;
    });
    listener_->survey().on_datagram(
        [this](std::uint8_t node, const Datagram& datagram) { hear(node, datagram.bytes()); });
  }
  // Those that were heard, but damaged, are boards, too.
  void end() {
    for (std::uint8_t node = 0; listener_ && node < can_nodes; ++node) {
      if (listener_->survey().board(node).heard()) bus_.boards[node];
    }
  }
  bool all_answered() const {
    for (std::uint8_t node = 0; listener_ && node < can_nodes; ++node) {
      const auto question = nodes_.find(node);
      const bool answered = question != nodes_.end() && question->second->answered();
      if (listener_->survey().board(node).heard() && !answered) return false;
    }
    return true;
  }

 private:
  void hear(std::uint8_t node, Text bytes) {
    std::unique_ptr<NodeQuestion>& question = nodes_[node];
    if (!question) {
      question = std::make_unique<NodeQuestion>(io_, url_of(bus_, node), bus_.boards[node]);
    }
    question->hear(bytes);
  }

  asio::io_context& io_;
  ListedBus& bus_;
  std::unique_ptr<CanListener> listener_;
  std::map<std::uint8_t, std::unique_ptr<NodeQuestion>> nodes_;
};

}  // namespace

std::vector<ListedBus> list_buses() {
  std::vector<ListedBus> buses;
  for (CanInterface& interface : list_can_interfaces()) {
    buses.emplace_back().interface = std::move(interface);
  }
  if (buses.empty()) return buses;
  asio::io_context io(1);
  std::vector<std::unique_ptr<BusQuestion>> questions;
  questions.reserve(buses.size());
  for (ListedBus& bus : buses) questions.push_back(std::make_unique<BusQuestion>(io, bus));
  const auto begun = std::chrono::steady_clock::now();
  io.run_until(begun + listening);
  const auto all_answered = [&] {
    return std::all_of(questions.begin(), questions.end(),
                       [](const auto& each) { return each->all_answered(); });
  };
  while (!all_answered() && !io.stopped() && std::chrono::steady_clock::now() < begun + longest) {
    io.run_for(look_again);
  }
  for (const auto& each : questions) each->end();
  return buses;
}

void print_text(const std::vector<ListedBus>& buses) {
  fmt::print("\nCAN interfaces:\n");
  if (buses.empty()) fmt::print("  none\n");
  for (const ListedBus& bus : buses) {
    const CanInterface& interface = bus.interface;
    const std::string rate = interface.bit_rate == 0
                                 ? (interface.has_controller ? "no bit rate" : "virtual")
                                 : fmt::format("{} kbit/s", interface.bit_rate / 1000.0);
    fmt::print("  {:<14} {:<5}{:<14} {:<14}{}{}\n", printable(interface.name),
               interface.up ? "up" : "down", interface.state, rate, interface.fd ? "CAN FD  " : "",
               bus.boards.empty() && bus.trouble.empty() ? "no board heard" : "");
    for (const auto& [node, board] : bus.boards) {
      fmt::print("    R4 board: {}  {}\n", printable(url_of(bus, node)), text_of(board));
    }
    if (!bus.trouble.empty()) {
      fmt::print("    {}{}{}\n", printable(bus.trouble), bus.fix.empty() ? "" : "; ",
                 printable(bus.fix));
    }
  }
}

void print_json(const std::vector<ListedBus>& buses) {
  for (const ListedBus& bus : buses) {
    Json boards = Json::array();
    for (const auto& [node, board] : bus.boards) {
      Json object{{"node", node}, {"url", url_of(bus, node)}};
      describe(board, object);
      boards.push_back(std::move(object));
    }
    print_line({{"type", "can"},
                {"interface", bus.interface.name},
                {"up", bus.interface.up},
                {"state", bus.interface.state},
                {"bitrate", bus.interface.bit_rate},
                {"fd", bus.interface.fd},
                {"boards", std::move(boards)},
                {"reason", bus.trouble},
                {"fix", bus.fix}});
  }
}

}  // namespace r4::tool
