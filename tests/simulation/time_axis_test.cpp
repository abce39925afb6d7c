// SPDX-License-Identifier: GPL-3.0-or-later
// Eight boards on one bus, in virtual time: clocks that drift apart, the shipped application, and a
// session for each board. The sampling times that the sessions report form one time axis.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <memory>
#include <string>

#include "firmware/application/application.hpp"
#include "random.hpp"
#include "tests/support/driven_session.hpp"

namespace r4::simulation {
namespace {

constexpr std::size_t axis_boards = 8;
constexpr std::uint64_t axis_settled_us = 10'000'000;  // docs/design/architecture.md promises this

class SharedBus {
 public:
  struct Packet {
    std::uint64_t at_us;
    std::size_t board;
    bool to_board;
    std::string bytes;
  };

  // Frames follow each other, at 1 Mbit/s. A packed frame has 32 characters and takes 110 us.
  // Reading a frame takes up to half of this time. These times give the load of docs/how-to/can.md.
  void put(std::uint64_t now_us, std::size_t board, bool to_board, std::string_view bytes) {
    const std::uint64_t frames = bytes.size() / 32 + 1;
    free_us_ = std::max(free_us_, now_us) + 110 * frames;
    busy_us += 110 * frames;
    packets.push_back({free_us_ + random_.below(55), board, to_board, std::string(bytes)});
  }

  std::deque<Packet> packets;
  std::uint64_t busy_us = 0;

 private:
  Random random_{1};
  std::uint64_t free_us_ = 0;
};

struct AxisClock {
  std::int64_t drift_ppm;
  std::uint64_t boot_us;
  std::uint32_t first_ms;

  std::uint64_t rate() const { return static_cast<std::uint64_t>(1'000'000 + drift_ppm); }
  std::uint32_t shown(std::uint64_t now_us) const {
    return first_ms + static_cast<std::uint32_t>((now_us - boot_us) * rate() / 1'000'000'000);
  }
  std::uint64_t when_shown(std::uint32_t t_ms) const {
    return boot_us + (std::uint64_t{t_ms - first_ms} * 1'000'000'000 + rate() - 1) / rate();
  }
};

class AxisLink final : public firmware::Hal,
                       public firmware::Port,
                       public test::DrivenSession::Handler {
 public:
  AxisLink(SharedBus& bus, std::size_t number, Random& random)
      : clock{-90 + 25 * static_cast<std::int64_t>(number), random.below(1000),
              static_cast<std::uint32_t>(random.next())},
        bus_(bus),
        number_(number),
        random_(random),
        now_us_(clock.boot_us) {
    firmware::Application::Config config;
    config.identity = Identity{Text("simulated"), Text("0"), Text("sim")};
    config.chance = chance_;
    application_ = std::make_unique<firmware::Application>(*this, config);
    application_->add_port(*this);
    application_->start(clock.first_ms);
    session_ = std::make_unique<test::DrivenSession>(*this, SessionOptions{}, BoardRole::control, 1,
                                                     [this] { return random_.next(); });
    session_->on_transport(0, true, time());
    board_due_us = session_due_us = 1000;
  }

  void turn_board(std::uint64_t now_us) {
    now_us_ = now_us;
    const std::uint32_t now_ms = clock.shown(now_us);
    const std::uint32_t wait_ms = application_->poll(now_ms);
    board_due_us = std::max(now_us + 1, clock.when_shown(now_ms + wait_ms)) + random_.below(200);
  }
  void turn_session(std::uint64_t now_us) {
    now_us_ = now_us;
    const Time due = session_->poll(time());
    session_due_us = std::max<std::uint64_t>(static_cast<std::uint64_t>(due.count()), now_us + 1);
  }
  void receive(std::uint64_t now_us, bool at_board, const std::string& bytes) {
    now_us_ = now_us;
    if (at_board) {
      application_->receive(0, 1, Text(bytes), clock.shown(now_us));
      turn_board(now_us);
    } else {
      session_->receive(0, bytes, time());
      turn_session(now_us);
    }
  }
  Statistics statistics() const { return session_->statistics(time()); }

  const AxisClock clock;
  std::uint64_t board_due_us, session_due_us;
  std::int64_t error_us = 0;  // error of the newest state's time
  std::int64_t bound_us = 0;
  int states = 0, dishonest = 0;

 private:
  Time time() const { return Time{static_cast<std::int64_t>(now_us_)}; }

  void apply(const firmware::Outputs&) override {}
  void make_safe() override {}
  void sample(firmware::Inputs& inputs) override { inputs.handle = Handle::held; }
  void zero(int) override {}
  bool clear_fault() override { return true; }
  void send(Text datagram, Priority, std::uint32_t) override {
    bus_.put(now_us_, number_, false, {datagram.data(), datagram.size()});
  }
  std::size_t max_size() const override { return max_datagram; }
  SendResult transmit(std::size_t, std::string_view bytes, Priority) override {
    bus_.put(now_us_, number_, true, bytes);
    return SendResult::sent;
  }
  void on_state(const ReceivedState& state, const Datagram&) override {
    if (state.sampled_error == ReceivedState::unknown) return;
    const auto truth = static_cast<std::int64_t>(clock.when_shown(state.t_ms));
    error_us = std::chrono::round<Time>(state.sampled.time_since_epoch()).count() - truth;
    bound_us = std::chrono::ceil<Time>(state.sampled_error).count();
    ++states;
    dishonest += std::abs(error_us) > bound_us;
  }

  SharedBus& bus_;
  const std::size_t number_;
  Random& random_;
  std::uint64_t now_us_;
  std::uint8_t chance_[Authentication::chance_size] = {7};
  std::unique_ptr<firmware::Application> application_;
  std::unique_ptr<test::DrivenSession> session_;
};

TEST(TimeAxis, AgreesWithinAMillisecondForEightBoardsOnABus) {
  Random random(1);
  SharedBus bus;
  std::array<std::unique_ptr<AxisLink>, axis_boards> links;
  for (std::size_t i = 0; i < axis_boards; ++i) {
    links[i] = std::make_unique<AxisLink>(bus, i, random);
  }
  std::int64_t widest_us = 0;
  std::uint64_t now_us = 0;
  while (now_us < 2 * axis_settled_us) {
    now_us = bus.packets.empty() ? ~std::uint64_t{0} : bus.packets.front().at_us;
    for (const auto& link : links) {
      now_us = std::min({now_us, link->board_due_us, link->session_due_us});
    }
    while (!bus.packets.empty() && bus.packets.front().at_us <= now_us) {
      const SharedBus::Packet packet = std::move(bus.packets.front());
      bus.packets.pop_front();
      links[packet.board]->receive(now_us, packet.to_board, packet.bytes);
    }
    for (const auto& link : links) {
      if (link->board_due_us <= now_us) link->turn_board(now_us);
      if (link->session_due_us <= now_us) link->turn_session(now_us);
    }
    if (now_us < axis_settled_us) continue;
    const auto earlier = [](const auto& a, const auto& b) { return a->error_us < b->error_us; };
    const auto [first, last] = std::minmax_element(links.begin(), links.end(), earlier);
    widest_us = std::max(widest_us, (*last)->error_us - (*first)->error_us);
  }
  for (const auto& link : links) {
    const Statistics statistics = link->statistics();
    fmt::print("{:>4} ppm: {} states, off by {} us, at most {} us told, {:.0f} ppm told\n",
               -link->clock.drift_ppm, link->states, link->error_us, link->bound_us,
               statistics.clock_drift_ppm);
    EXPECT_GT(link->states, 1900);
    EXPECT_EQ(link->dishonest, 0);
    EXPECT_NEAR(statistics.clock_drift_ppm, static_cast<double>(-link->clock.drift_ppm),
                statistics.clock_drift_error_ppm);
  }
  fmt::print("bus {} % busy; the boards' axes at most {} us apart\n", bus.busy_us * 100 / now_us,
             widest_us);
  EXPECT_LE(widest_us, 1000);
}

}  // namespace
}  // namespace r4::simulation
