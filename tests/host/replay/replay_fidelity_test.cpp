// SPDX-License-Identifier: GPL-3.0-or-later
// During a replay a program receives the same data as during the recording.
#include <gtest/gtest.h>
#include <unistd.h>

#include <asio/io_context.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host/standard_registry.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/async_board.hpp"
#include "r4link/recording.hpp"
#include "tests/support/at_will.hpp"
#include "transports/impaired/impaired_carrier.hpp"
#include "transports/registry.hpp"

namespace r4::test {
namespace {

using namespace std::chrono_literals;

// Everything that a program receives from the board.
struct ToldOfABoard {
  ToldOfABoard(asio::io_context& io, AsyncBoard& board) : timer(io) {
    look();
    board.on_state([this](const ReceivedState& state, const Datagram&) {
      states[state.pnum] = text_of(state);
    });
    board.on_board_heartbeat(
        [this](const Datagram& datagram) { heartbeats.push_back(text_of(datagram)); });
    board.on_bad_datagram([this](const ReadResult& result, std::string_view bytes) {
      damaged.push_back(std::to_string(static_cast<int>(result.error)) + " at " +
                        std::to_string(result.position) + ": " + std::string(bytes));
    });
    board.on_event([this](const CarrierEvent& event) {
      if (event.kind == CarrierEvent::Kind::warning) return;  // a warning is about this program
      events.push_back(to_text(event.kind) + (" " + event.problem.reason));
    });
    board.on_link([this](const LinkStatus& link) {
      std::string text = to_text(link.state) + (" " + std::string(to_text(link.reason)));
      if (links.empty() || links.back() != text) links.push_back(std::move(text));
    });
    board.on_restart([this] { ++restarts; });
  }

  // After a standstill of 50 ms, a board treats waiting datagrams as a backlog.
  void look() {
    const auto now = std::chrono::steady_clock::now();
    stood_still = stood_still || now - looked > 30ms;
    looked = now;
    timer.expires_after(5ms);
    timer.async_wait([this](const asio::error_code& error) {
      if (!error) look();
    });
  }

  static std::string text_of(const Datagram& datagram) {
    return {datagram.bytes().data(), datagram.bytes().size()};
  }

  // Every field, including fields that this datagram does not have.
  static std::string text_of(const State& state) {
    char buffer[4 * max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    for (int i = 0; i < state_field_count; ++i) {
      write_field(writer, static_cast<StateField>(i), state);
    }
    const Text text = writer.finish(state.pnum, state.t_ms);
    std::string present;
    for (const StateField field : state.present)
      present += std::to_string(static_cast<int>(field)) + " ";
    return present + std::string(text.data(), text.size());
  }

  std::map<std::uint32_t, std::string> states;  // by packet number
  std::vector<std::string> heartbeats, damaged, events, links;
  int restarts = 0;
  asio::steady_timer timer;
  std::chrono::steady_clock::time_point looked = std::chrono::steady_clock::now();
  bool stood_still = false;  // this program did not run for 30 ms
};

TEST(ReplayFidelity, HasTheSameStatesEventsAndStatisticsAsLive) {
  const std::string path = testing::TempDir() + "r4-fidelity-" + std::to_string(::getpid());
  asio::io_context io;
  const Impairment bad = Impairment::parse("loss=4%,duplicate=4%,corrupt=6%,seed=7");
  AsyncBoard board(
      io, make_impaired_carrier(io, standard_registry().make(io, "sim:?seed=7", Role::host), bad),
      at_will());
  ToldOfABoard live(io, board);
  Recording recording(path);
  board.record(recording);
  board.open();
  const auto ignore = [](const CommandResult&) {};
  board.async_send(Command::fields("DEFAULT,ENC1,SAFE,RXOK"), 1s, ignore);
  board.async_send(Command::relay(1, true), 1s, ignore);
  board.async_send(Command::osmc(1, Pwm(358), Direction::forward), 1s, ignore);
  io.run_for(1s);
  for (int i = 0; i < 100 && live.states.size() <= 80; ++i) io.run_for(100ms);
  board.async_send(Command::stop(), 1s, ignore);
  io.run_for(300ms);
  board.close();
  recording.close();
  const Statistics then = board.statistics();

  BoardOptions watching;
  watching.role = BoardRole::watch;
  AsyncBoard again(io, "replay:" + path, watching);
  ToldOfABoard played(io, again);
  again.on_event([&](const CarrierEvent& event) {
    if (event.kind == CarrierEvent::Kind::down) io.stop();
  });
  again.open();
  io.restart();
  io.run_for(10s);
  const Statistics now = again.statistics();
  std::filesystem::remove(path);

  EXPECT_GT(live.states.size(), 80U);
  // After a standstill of this program, live or in the replay, only the newest state is reported.
  std::size_t in_both = 0;
  for (const auto& [number, state] : played.states) {
    const auto same = live.states.find(number);
    if (same == live.states.end()) continue;
    ++in_both;
    EXPECT_EQ(state, same->second);
  }
  EXPECT_GT(in_both, live.states.size() / 2);
  if (!live.stood_still && !played.stood_still) {
    EXPECT_EQ(played.states, live.states);
  }
  EXPECT_EQ(played.heartbeats, live.heartbeats);
  EXPECT_GT(live.damaged.size(), 3U);
  EXPECT_EQ(played.damaged, live.damaged);
  live.events.emplace_back("down the recording has ended");
  EXPECT_EQ(played.events, live.events);
  EXPECT_EQ(live.links, (std::vector<std::string>{"safe link", "active none", "safe stop"}));
  live.links.emplace_back("lost stop");
  EXPECT_EQ(played.links, live.links);
  EXPECT_EQ(played.restarts, live.restarts);

  EXPECT_EQ(now.received, then.received);
  EXPECT_EQ(now.states, then.states);
  EXPECT_EQ(now.damaged, then.damaged);
  EXPECT_EQ(now.packets.received, then.packets.received);
  EXPECT_EQ(now.packets.lost, then.packets.lost);
  EXPECT_EQ(now.packets.duplicate, then.packets.duplicate);
  EXPECT_EQ(now.packets.late, then.packets.late);
  EXPECT_EQ(now.packets.old, then.packets.old);
  EXPECT_EQ(now.packets.restarts, then.packets.restarts);
  EXPECT_GT(then.packets.lost, 0U);
  EXPECT_GT(then.packets.duplicate, 0U);
  EXPECT_NEAR(now.state_rate_hz, then.state_rate_hz, 20);
}

}  // namespace
}  // namespace r4::test
