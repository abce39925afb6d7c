// SPDX-License-Identifier: GPL-3.0-or-later
// Days of a fleet of a hundred boards in virtual time: the application of each board and the
// session of its host. The network between boards and hosts loses a tenth of the datagrams. Faults
// affect one link or all links. The memory does not grow. A board trips only after a fault, is safe
// in time, and becomes active again. R4_FLEET_HOURS sets the length (168 are seven days), and
// R4_SEED selects another run.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "environment.hpp"
#include "firmware/application/application.hpp"
#include "random.hpp"
#include "tests/support/driven_session.hpp"

namespace r4::simulation {
namespace {

using firmware::BoardState;

constexpr std::size_t fleet_size = 100;
constexpr std::uint64_t one_second_us = 1'000'000;
constexpr std::uint64_t silence_limit_us = 1'020'000;               // the timeout and 20 ms
constexpr std::uint64_t comes_back_within_us = 15 * one_second_us;  // although datagrams are lost
// A board that has restarted is active when a host echoes its second heartbeat, after half a
// second. If the heartbeat is lost, the first connection ends after a second, and the next
// connection starts at once.
constexpr std::uint64_t connecting_us = 2 * one_second_us;
constexpr double lost = 0.1, twice = 0.01, damaged = 0.001;

struct Packet {
  // The arrival at the receiver, which reads the packet at `at_us`. Waiting packets stay in order.
  std::uint64_t came_us = 0;
  std::uint64_t at_us = 0;
  bool to_board = false;
  bool intact = true;
  std::size_t size = 0;
  std::array<char, 512> bytes;
};

// The datagrams under way, and the datagrams that wait for a host that hangs for half a minute.
class Path {
  auto later() const {
    return [this](std::uint8_t a, std::uint8_t b) {
      return std::tie(packets_[a].at_us, packets_[a].came_us) >
             std::tie(packets_[b].at_us, packets_[b].came_us);
    };
  }

 public:
  Path() { std::iota(order_.begin(), order_.end(), std::uint8_t{0}); }

  std::uint64_t next_us() const { return count_ == 0 ? UINT64_MAX : packets_[order_[0]].at_us; }
  Packet take() {
    std::pop_heap(order_.begin(), order_.begin() + count_, later());
    return packets_[order_[static_cast<std::size_t>(--count_)]];
  }
  // False if the path is full.
  bool put(const Packet& packet) {
    if (count_ == static_cast<std::ptrdiff_t>(packets_.size())) return false;
    packets_[order_[static_cast<std::size_t>(count_++)]] = packet;
    std::push_heap(order_.begin(), order_.begin() + count_, later());
    return true;
  }

 private:
  std::array<Packet, 128> packets_;
  std::array<std::uint8_t, 128> order_;  // a heap of the packets in use, then the free packets
  std::ptrdiff_t count_ = 0;
};

class FleetLink final : firmware::Hal, firmware::Port, test::DrivenSession::Handler {
 public:
  explicit FleetLink(std::uint64_t seed) : random_(seed) {
    SessionOptions options;
    options.arming = Arming::off;
    session_.emplace(static_cast<test::DrivenSession::Handler&>(*this), options, BoardRole::control,
                     1U, [this] { return random_.next(); });
    session_->on_transport(0, true, time());
    boot();
  }

  void run_until(std::uint64_t end_us) {
    for (;;) {
      const std::uint64_t packet_us = path_.next_us();
      const std::uint64_t host_us = std::max(host_due_us_, held_until_us_);
      const std::uint64_t next_us = std::min({packet_us, board_due_us_, host_us});
      if (next_us > end_us) break;
      now_us_ = std::max(now_us_, next_us);
      if (packet_us == next_us) {
        deliver(path_.take());
      } else if (board_due_us_ == next_us) {
        poll_board();
      } else {
        poll_host();
      }
    }
    now_us_ = end_us;
    if (now_us_ == fault_ends_us() + comes_back_within_us && !back()) ++stayed_away;
  }

  // --- faults

  void cut(std::uint64_t length_us) { cut_until_us_ = now_us_ + length_us; }
  // The thread of all hosts hangs. Arriving datagrams wait.
  void hold_up(std::uint64_t length_us) { held_until_us_ = now_us_ + length_us; }
  void restart_board() {
    restarted_us_ = now_us_;
    boot();
  }
  bool well() const { return now_us_ > fault_ends_us() + comes_back_within_us; }
  void command() {
    ++asked;
    session_->send(
        Command::stepper(1, Steps(static_cast<std::int32_t>(asked)), StepsPerSecond(1000)),
        std::chrono::seconds(10), time());
    host_due_us_ = now_us_;
  }
  bool back() const {
    return application_->state() == BoardState::active && session_->in_control(time());
  }
  Random& random() { return random_; }

  std::uint64_t asked = 0, confirmed = 0;
  std::uint64_t trips = 0, while_connecting = 0, false_trips = 0, late_ms = 0, stayed_away = 0,
                overflows = 0;

 private:
  std::uint64_t fault_ends_us() const {
    return std::max({cut_until_us_, held_until_us_, restarted_us_});
  }
  Time time() const { return Time{static_cast<std::int64_t>(now_us_ + one_second_us)}; }
  std::uint32_t board_ms() const {
    return boot_ms_ + static_cast<std::uint32_t>((now_us_ - boot_us_) / 1000);
  }

  void boot() {
    firmware::Application::Config config;
    config.identity = Identity{Text("simulated"), Text("0"), Text("sim")};
    config.settings.state_rate_hz = 1;
    boot_us_ = now_us_;
    boot_ms_ = static_cast<std::uint32_t>(random_.next());
    was_active_ = false;
    firmware::Hal& hal = *this;
    application_.emplace(hal, config);
    application_->add_port(*this);
    application_->start(board_ms());
    poll_board();
  }
  void poll_board() {
    board_due_us_ = now_us_ + 1000 * std::max<std::uint64_t>(application_->poll(board_ms()), 1);
    look();
  }
  void poll_host() {
    const Time due = session_->poll(time());
    host_due_us_ = std::max(now_us_ + 1, static_cast<std::uint64_t>(due.count()) - one_second_us);
  }
  // Checks how the board handles the silence.
  void look() {
    const bool active = application_->state() == BoardState::active;
    if (active && now_us_ > heartbeat_us_ + silence_limit_us) ++late_ms;
    if (was_active_ && !active) {
      ++trips;
      if (now_us_ < boot_us_ + connecting_us) {
        ++while_connecting;
      } else if (now_us_ > std::max(cut_until_us_, held_until_us_)) {
        ++false_trips;
      }
    }
    was_active_ = active;
  }

  void transfer(bool to_board, std::string_view bytes) {
    if (now_us_ < cut_until_us_) return;
    for (int copies = random_.chance(twice) ? 2 : 1; copies > 0; --copies) {
      if (random_.chance(lost)) continue;
      // The delay is at most 20 ms, so some datagrams overtake others.
      Packet packet{};
      packet.at_us = packet.came_us = now_us_ + 500 + random_.below(20'000);
      packet.to_board = to_board;
      packet.size = std::min(bytes.size(), packet.bytes.size());
      std::copy_n(bytes.begin(), packet.size, packet.bytes.begin());
      packet.intact = !random_.chance(damaged);
      if (!packet.intact) packet.bytes[random_.below(packet.size)] ^= 1;
      if (packet.size < bytes.size() || !path_.put(packet)) ++overflows;
    }
  }
  void deliver(Packet packet) {
    if (!packet.to_board && now_us_ < held_until_us_) {
      packet.at_us = held_until_us_;
      if (!path_.put(packet)) ++overflows;
      return;
    }
    const std::string_view bytes(packet.bytes.data(), packet.size);
    if (packet.to_board) {
      if (packet.intact && bytes.starts_with("H:")) heartbeat_us_ = now_us_;
      application_->receive(0, 1, Text(bytes.data(), bytes.size()), board_ms());
      poll_board();
    } else {
      session_->receive(0, bytes, time());
      poll_host();
    }
  }

  void apply(const firmware::Outputs&) override {}
  void make_safe() override {}
  void sample(firmware::Inputs& inputs) override { inputs.handle = Handle::held; }
  void zero(int) override {}
  bool clear_fault() override { return true; }
  void send(Text bytes, Priority, std::uint32_t) override {
    transfer(false, {bytes.data(), bytes.size()});
  }
  std::size_t max_size() const override { return max_datagram; }
  SendResult transmit(std::size_t, std::string_view bytes, Priority) override {
    transfer(true, bytes);
    return SendResult::sent;
  }
  void on_result(Ticket, const CommandResult& result) override {
    confirmed += result.outcome == Outcome::confirmed ? 1 : 0;
  }

  Random random_;
  std::uint64_t now_us_ = 0;
  std::uint64_t boot_us_ = 0, board_due_us_ = 0, host_due_us_ = 0, heartbeat_us_ = 0;
  std::uint64_t cut_until_us_ = 0, held_until_us_ = 0, restarted_us_ = 0;
  std::uint32_t boot_ms_ = 0;
  bool was_active_ = false;
  Path path_;
  std::optional<firmware::Application> application_;
  std::optional<test::DrivenSession> session_;
};

double fleet_hours() {
  const char* const value = std::getenv("R4_FLEET_HOURS");
  return value == nullptr ? 0.05 : std::strtod(value, nullptr);
}

TEST(FleetDays, MemoryDoesNotGrowAndFalseTripsAreRare) {
  Random random(from_environment("R4_SEED", 1));
  const auto seconds = static_cast<std::uint64_t>(fleet_hours() * 3600);
  std::vector<std::unique_ptr<FleetLink>> fleet;
  for (std::size_t i = 0; i < fleet_size; ++i) {
    fleet.push_back(std::make_unique<FleetLink>(random.next()));
  }
  // In each hour there is one fault of all links and one fault of each link. In a short run the
  // faults occur sooner.
  const std::uint64_t interval = std::min<std::uint64_t>(3600, seconds / 3);
  std::uint64_t faults = 0, restarts = 0;
  std::size_t heap = 0;
  for (std::uint64_t now = 1; now <= seconds; ++now) {
    for (const auto& link : fleet) link->run_until(now * one_second_us);
    if (now == seconds / 2) heap = ::mallinfo2().uordblks;
    if (now % interval == interval / 2) {
      ++faults;
      const bool held_up = random.chance(0.5);
      const std::uint64_t length_us = random.between(2, 30) * one_second_us;
      for (const auto& link : fleet) held_up ? link->hold_up(length_us) : link->cut(length_us);
    }
    for (const auto& link : fleet) {
      if (!link->well()) continue;
      if (link->random().chance(0.1)) link->command();
      if (!link->random().chance(1.0 / static_cast<double>(interval))) continue;
      ++faults;
      if (link->random().chance(0.5)) {
        link->cut(link->random().between(2, 30) * one_second_us);
      } else {
        ++restarts;
        link->restart_board();
      }
    }
  }
  const std::size_t heap_after = ::mallinfo2().uordblks;

  std::uint64_t asked = 0, confirmed = 0, trips = 0, connecting = 0, false_trips = 0, late = 0,
                away = 0, over = 0;
  for (const auto& link : fleet) {
    asked += link->asked;
    confirmed += link->confirmed;
    trips += link->trips;
    connecting += link->while_connecting;
    false_trips += link->false_trips;
    late += link->late_ms;
    away += link->stayed_away;
    over += link->overflows;
  }
  const double board_days = static_cast<double>(seconds * fleet_size) / 86400;
  fmt::print(
      "{:.2f} days of boards, {} faults ({} restarts): {} trips, {} of them in the first "
      "second of a board, {} for no reason; {} of {} commands confirmed; the heap grew by {} bytes "
      "in the second half\n",
      board_days, faults, restarts, trips, connecting, false_trips, confirmed, asked,
      static_cast<std::int64_t>(heap_after - heap));
  EXPECT_EQ(late, 0U) << "a board's outputs were not safe in time";
  EXPECT_EQ(away, 0U) << "a link did not come back";
  EXPECT_EQ(over, 0U);
  EXPECT_LT(static_cast<double>(false_trips), std::max(1.0, board_days / 10));
  EXPECT_LT(connecting * 5, fleet_size + restarts);
  EXPECT_GT(restarts, 10U);
  EXPECT_GT(trips, 2 * fleet_size);
  EXPECT_GT(confirmed * 100, asked * 90);
  // The session allocates some memory at its first use. A leak of one byte per datagram would
  // exceed the limit.
  EXPECT_LT(static_cast<std::int64_t>(heap_after - heap), 1024 * std::int64_t{fleet_size});
}

}  // namespace
}  // namespace r4::simulation
