// SPDX-License-Identifier: GPL-3.0-or-later
#include "list_serial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include "held_transport.hpp"
#include "host/standard_registry.hpp"
#include "transports/registry.hpp"
#include "transports/serial/serial_carrier.hpp"
#include "transports/url.hpp"

namespace r4::tool {
namespace {

using std::chrono::milliseconds;

// Who has the port open asks each second.
constexpr milliseconds patience{1300};

// One port, while it is asked.
class PortQuestion final : private Carrier::Handler {
 public:
  PortQuestion(asio::io_context& io, ListedPort& port, std::function<void()> on_done)
      : io_(io),
        port_(port),
        on_done_(std::move(on_done)),
        held_(io, port.board, [this] { look(); }),
        timer_(io) {}
  ~PortQuestion() {
    if (carrier_) carrier_->close();
  }

  // `open`: also where no program has it.
  void begin(bool open) {
    try {
      const std::string url = url_of(port_.port);
      port_.asked = open;
      if (held_.join(serial_share_name(Url::parse(url)))) {
        port_.asked = true;
        return;
      }
      if (!open) return end();
      carrier_ = standard_registry().make_shared(io_, url, BoardRole::watch);
      carrier_->open(*this);
      ask();
    } catch (const Error& error) {
      if (open) port_.trouble = error.problem();
      end();
    }
  }
  bool done() const { return done_; }

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
    if (std::optional<IdentityAnswer> identity =
            read_identity_answer(Text(bytes.data(), bytes.size()))) {
      port_.board.identity = std::move(identity);
      look();
    }
  }
  void on_carrier_event(const CarrierEvent& event) override {
    port_.trouble.reset();
    if (event.kind != CarrierEvent::Kind::up) port_.trouble = event.problem;
  }

  void look() {
    if (port_.board.is_known()) end();
  }
  void end() {
    if (std::exchange(done_, true)) return;
    timer_.cancel();
    on_done_();
  }

  asio::io_context& io_;
  ListedPort& port_;
  std::function<void()> on_done_;
  HeldTransport held_;
  std::unique_ptr<Carrier> carrier_;
  asio::steady_timer timer_;
  int asked_ = 0;
  bool done_ = false;
};

std::string usb_id(const SerialPort& port) {
  return port.vid == 0 ? "" : fmt::format("{:04x}:{:04x}", port.vid, port.pid);
}

}  // namespace

std::vector<ListedPort> list_ports(const std::vector<std::string>& besides) {
  std::vector<ListedPort> ports;
  for (SerialPort& port : list_serial_ports()) ports.push_back({std::move(port), false, {}, {}});
  for (const std::string& path : besides) {
    const bool known = std::any_of(ports.begin(), ports.end(),
                                   [&](const ListedPort& each) { return each.port.path == path; });
    if (!known) ports.emplace_back().port.path = path;
  }
  asio::io_context io(1);
  std::vector<std::unique_ptr<PortQuestion>> questions;
  const auto stop_if_all_done = [&] {
    const bool all = std::all_of(questions.begin(), questions.end(),
                                 [](const auto& each) { return each->done(); });
    if (all) io.stop();
  };
  for (ListedPort& port : ports) {
    questions.push_back(std::make_unique<PortQuestion>(io, port, stop_if_all_done));
  }
  for (std::size_t i = 0; i < ports.size(); ++i) {
    const bool named =
        std::find(besides.begin(), besides.end(), ports[i].port.path) != besides.end();
    questions[i]->begin(ports[i].port.is_r4 || named);
  }
  io.run_for(patience);
  return ports;
}

void print_text(const std::vector<ListedPort>& ports) {
  fmt::print("Serial ports:\n");
  if (ports.empty()) fmt::print("  none\n");
  for (const auto& [port, asked, board, trouble] : ports) {
    fmt::print("  {:<14} {:<10} {:<24} {}\n", printable(port.path), usb_id(port),
               printable(port.serial_number), printable(port.description));
    if (!asked) continue;
    // What has not the board's USB id is one if it says so, or if a program of ours has it.
    if (port.is_r4 || board.identity || board.pid != 0) {
      fmt::print("    R4 board: {}  {}\n", printable(url_of(port)), text_of(board));
    } else {
      fmt::print("    no R4 board has answered: {}\n", printable(url_of(port)));
    }
    if (trouble) {
      fmt::print("    {}; {}\n", printable(trouble->reason), printable(trouble->fix));
    }
  }
}

void print_json(const std::vector<ListedPort>& ports) {
  for (const auto& [port, asked, board, trouble] : ports) {
    Json object{{"type", "port"},
                {"path", port.path},
                {"usb", usb_id(port)},
                {"serial_number", port.serial_number},
                {"description", port.description},
                {"r4", port.is_r4},
                {"url", url_of(port)}};
    if (asked) describe(board, object);
    if (trouble) object.update({{"reason", trouble->reason}, {"fix", trouble->fix}});
    print_line(object);
  }
}

}  // namespace r4::tool
