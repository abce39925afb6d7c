// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "../../transports/can/can_carrier.hpp"
#include "held_transport.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"
#include "r4link/discovery/url.hpp"
#include "searches.hpp"

namespace r4 {
namespace {

using std::chrono::milliseconds;

// A board sends heartbeats twice a second without a host, states with a host.
constexpr milliseconds listening{700};
// A host requests its board's identity each second.
constexpr milliseconds longest{1300};
constexpr milliseconds look_again{20};

class NodeQuestion final : private Carrier::Handler {
 public:
  NodeQuestion(asio::io_context& io, FoundBoard& board)
      : board_(board), held_(io, board, [] {}), timer_(io) {
    const Url parsed = Url::parse(board.url);
    held_.join(can_share_name(parsed));
    try {
      carrier_ = make_can_carrier(io, parsed, Role::host);
      carrier_->open(*this);
      ask();
    } catch (const Error&) {
      carrier_.reset();  // the interface has disconnected, which its listener reports
    }
  }
  ~NodeQuestion() {
    if (carrier_) carrier_->close();
  }
  // Frames of another host override the board's answer.
  void end() {
    if (other_host_) board_.busy = true;
  }
  void hear(Text bytes) {
    if (auto answer = read_identity_answer(bytes)) take(board_, std::move(*answer));
  }
  bool answered() const { return is_known(board_); }

 private:
  // The carrier first listens for other hosts. `busy` without foreign frames means another host.
  void ask() {
    if (board_.identity) return;
    const SendResult result = carrier_->send(identity_question(), Priority::normal);
    board_.foreign_frames = carrier_->trouble() == TransportTrouble::foreign_frames;
    other_host_ = result == SendResult::busy && !board_.foreign_frames;
    if (result == SendResult::sent) ++asked_;
    if (board_.identity || asked_ == most_questions) return;
    timer_.expires_after(result == SendResult::sent ? between_questions : look_again);
    timer_.async_wait([this](const std::error_code& error) {
      if (!error) ask();
    });
  }
  void on_datagram(std::string_view, Peer) override {}  // the bus listener receives datagrams
  void on_carrier_event(const CarrierEvent&) override {}

  FoundBoard& board_;
  HeldTransport held_;
  std::unique_ptr<Carrier> carrier_;
  asio::steady_timer timer_;
  int asked_ = 0;
  bool other_host_ = false;  // other than the holder
};

class BusQuestion {
 public:
  BusQuestion(asio::io_context& io, const CanInterface& interface) : io_(io) {
    bus_.interface = interface.name;
    bus_.up = interface.up;
    bus_.fd = interface.fd;
    bus_.has_controller = interface.has_controller;
    bus_.state = interface.state;
    bus_.bit_rate = interface.bit_rate;
    try {
      listener_ = std::make_unique<CanListener>(io, interface.name, CanBitRate{1000000, 0});
    } catch (const Error& error) {
      bus_.trouble = error.problem();
      return;
    }
    listener_->on_event([this](const CarrierEvent& event) {
      if (event.kind != CarrierEvent::Kind::up) bus_.trouble = event.problem;
    });
    listener_->survey().on_datagram(
        [this](std::uint8_t node, const Datagram& datagram) { hear(node, datagram.bytes()); });
  }
  // Also adds nodes without a whole datagram.
  void put_into(Discovery& found) {
    for (const auto& [node, question] : questions_) question->end();
    for (std::uint8_t node = 0; listener_ && node < can_nodes; ++node) {
      const HeardNode& heard = listener_->survey().board(node);
      if (heard.heard() && !heard.sends_datagrams()) board_at(node).foreign_frames = true;
    }
    for (auto& [node, board] : boards_) found.boards.push_back(std::move(board));
    found.buses.push_back(std::move(bus_));
  }
  bool all_answered() const {
    for (std::uint8_t node = 0; listener_ && node < can_nodes; ++node) {
      const auto question = questions_.find(node);
      const bool answered = question != questions_.end() && question->second->answered();
      if (listener_->survey().board(node).heard() && !answered) return false;
    }
    return true;
  }

 private:
  FoundBoard& board_at(std::uint8_t node) {
    FoundBoard& board = boards_[node];
    board.url = fmt::format("can://{}?node={}", bus_.interface, node);
    board.place = bus_.interface;
    board.node = node;
    return board;
  }
  void hear(std::uint8_t node, Text bytes) {
    std::unique_ptr<NodeQuestion>& question = questions_[node];
    if (!question) question = std::make_unique<NodeQuestion>(io_, board_at(node));
    question->hear(bytes);
  }

  asio::io_context& io_;
  SearchedBus bus_;
  std::unique_ptr<CanListener> listener_;
  std::map<std::uint8_t, FoundBoard> boards_;
  std::map<std::uint8_t, std::unique_ptr<NodeQuestion>> questions_;
};

}  // namespace

Discovery search_can_interfaces() {
  Discovery found;
  const std::vector<CanInterface> interfaces = list_can_interfaces();
  if (interfaces.empty()) return found;
  asio::io_context io(1);
  std::vector<std::unique_ptr<BusQuestion>> questions;
  questions.reserve(interfaces.size());
  for (const CanInterface& each : interfaces) {
    questions.push_back(std::make_unique<BusQuestion>(io, each));
  }
  const auto begun = std::chrono::steady_clock::now();
  io.run_until(begun + listening);
  const auto all_answered = [&] {
    return std::all_of(questions.begin(), questions.end(),
                       [](const auto& each) { return each->all_answered(); });
  };
  while (!all_answered() && !io.stopped() && std::chrono::steady_clock::now() < begun + longest) {
    io.run_for(look_again);
  }
  for (const auto& each : questions) each->put_into(found);
  return found;
}

}  // namespace r4
