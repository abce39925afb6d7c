// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "../../transports/registry.hpp"
#include "../../transports/serial/port_list.hpp"
#include "../../transports/serial/serial_carrier.hpp"
#include "../standard_registry.hpp"
#include "held_transport.hpp"
#include "r4link/discovery/url.hpp"
#include "searches.hpp"

namespace r4 {
namespace {

// A program that holds the port requests the board's identity each second.
constexpr std::chrono::milliseconds patience{1300};

class PortQuestion final : private Carrier::Handler {
 public:
  PortQuestion(asio::io_context& io, const SerialPort& port, std::function<void()> on_done)
      : io_(io), on_done_(std::move(on_done)), held_(io, board_, [this] { look(); }), timer_(io) {
    port_.path = port.path;
    port_.url = url_of(port);
    if (port.vid != 0) port_.usb_id = fmt::format("{:04x}:{:04x}", port.vid, port.pid);
    port_.serial_number = port.serial_number;
    port_.description = port.description;
    port_.is_r4 = port.is_r4;
    board_.url = port_.url;
    board_.place = port_.path;
  }
  ~PortQuestion() {
    if (carrier_) carrier_->close();
  }

  // `named`: opens the port with any USB id.
  void begin(bool named) {
    const bool open = port_.is_r4 || named;
    try {
      port_.asked = open;
      if (held_.join(serial_share_name(Url::parse(port_.url)))) {
        port_.asked = true;
        return;
      }
      if (!open) return end();
      carrier_ = standard_registry().make_shared(io_, port_.url, BoardRole::watch);
      carrier_->open(*this);
      ask();
    } catch (const Error& error) {
      if (open) port_.trouble = error.problem();
      end();
    }
  }
  bool done() const { return done_; }

  // A port without a board's USB id has a board if the board answers or a program holds the port.
  void put_into(Discovery& found) const {
    found.ports.push_back(port_);
    if (port_.is_r4 || board_.identity || board_.holder) found.boards.push_back(board_);
  }

 private:
  void ask() {
    if (done_) return;
    if (asked_ == most_questions) return end();
    if (carrier_->send(identity_question(), Priority::normal) == SendResult::sent) ++asked_;
    timer_.expires_after(between_questions);
    timer_.async_wait([this](const std::error_code& error) {
      if (!error) ask();
    });
  }

  void on_datagram(std::string_view bytes, Peer) override {
    if (auto answer = read_identity_answer(Text(bytes.data(), bytes.size()))) {
      take(board_, std::move(*answer));
      look();
    }
  }
  void on_carrier_event(const CarrierEvent& event) override {
    port_.trouble.reset();
    if (event.kind != CarrierEvent::Kind::up) port_.trouble = event.problem;
  }

  void look() {
    if (is_known(board_)) end();
  }
  void end() {
    if (std::exchange(done_, true)) return;
    timer_.cancel();
    on_done_();
  }

  asio::io_context& io_;
  SearchedPort port_;
  FoundBoard board_;
  std::function<void()> on_done_;
  HeldTransport held_;
  std::unique_ptr<Carrier> carrier_;
  asio::steady_timer timer_;
  int asked_ = 0;
  bool done_ = false;
};

}  // namespace

Discovery search_serial_ports(const std::vector<std::string>& besides) {
  std::vector<SerialPort> ports = list_serial_ports();
  for (const std::string& path : besides) {
    const bool known = std::any_of(ports.begin(), ports.end(),
                                   [&](const SerialPort& each) { return each.path == path; });
    if (!known) ports.emplace_back().path = path;
  }
  asio::io_context io(1);
  std::vector<std::unique_ptr<PortQuestion>> questions;
  const auto stop_if_all_done = [&] {
    const bool all = std::all_of(questions.begin(), questions.end(),
                                 [](const auto& each) { return each->done(); });
    if (all) io.stop();
  };
  for (const SerialPort& port : ports) {
    questions.push_back(std::make_unique<PortQuestion>(io, port, stop_if_all_done));
  }
  for (std::size_t i = 0; i < ports.size(); ++i) {
    questions[i]->begin(std::find(besides.begin(), besides.end(), ports[i].path) != besides.end());
  }
  io.run_for(patience);
  Discovery found;
  for (const auto& each : questions) each->put_into(found);
  return found;
}

}  // namespace r4
