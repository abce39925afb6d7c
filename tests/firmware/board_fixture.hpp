// SPDX-License-Identifier: GPL-3.0-or-later
// The board's application on hardware and ports in memory, in virtual time, with hosts that control
// it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "firmware/application/application.hpp"
#include "protocol/datagram/numbers.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::test {

class MemoryHal final : public firmware::Hal {
 public:
  MemoryHal() { inputs.handle = Handle::held; }

  void apply(const firmware::Outputs& wanted) override {
    outputs = wanted;
    ++applied;
  }
  void make_safe() override {
    outputs = firmware::Outputs();
    ++made_safe;
  }
  void sample(firmware::Inputs& sampled) override { sampled = inputs; }
  void zero(int channel) override { zeroed.push_back(channel); }
  bool clear_fault() override {
    if (!broken) inputs.fault = ChipFault();
    return !inputs.fault.any();
  }

  firmware::Outputs outputs;
  firmware::Inputs inputs;  // the next inputs of the board
  int applied = 0;
  int made_safe = 0;
  bool broken = false;  // true: a fault cannot be cleared
  std::vector<int> zeroed;
};

class MemoryPort final : public firmware::Port {
 public:
  struct Sent {
    std::string bytes;
    Priority priority;
    std::uint32_t peer;
    std::uint32_t at_ms;
  };

  void send(Text datagram, Priority priority, std::uint32_t peer) override {
    sent.push_back({str(datagram), priority, peer, *now_ms});
  }
  std::size_t max_size() const override { return limit; }
  void use_packed_form(bool wanted) override { packed = wanted; }
  void hold(std::uint32_t peer) override {
    held = peer;
    also_held.clear();
  }
  void also_hold(std::uint32_t peer) override { also_held.push_back(peer); }
  bool may_configure() const override { return cable; }
  bool is_bus() const override { return bus; }

  bool packed = false;
  bool cable = false;
  bool bus = false;
  std::uint32_t held = 0;                // the peer of one path of the session
  std::vector<std::uint32_t> also_held;  // the peers of the session's other paths
  const std::uint32_t* now_ms = nullptr;
  std::size_t limit = max_datagram;
  std::vector<Sent> sent;
};

// The events of the board as text: "ACTIVE none", "executed 5", "refused 5 RANGE".
class EventLog final : public firmware::Observer {
 public:
  void on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason) override {
    states.push_back(std::string(firmware::to_text(state)) + " " + to_text(reason));
    state_ms = t_ms;
  }
  void on_outputs(std::uint32_t, const firmware::Outputs&) override { ++outputs; }
  void on_executed(std::uint32_t, std::uint32_t pnum, const Command&) override {
    executed.push_back(pnum);
  }
  void on_refused(std::uint32_t, std::uint32_t pnum, Refusal code) override {
    refused.push_back(std::to_string(pnum) + " " + str(name_of(code)));
  }

  void on_rejected(std::uint32_t, Verdict verdict) override {
    rejected.emplace_back(to_text(verdict));
  }
  void on_path(std::uint32_t, Source path, bool joined) override {
    paths.push_back((joined ? "joined " : "left ") + std::to_string(path.port) + "/" +
                    std::to_string(path.peer));
  }

  std::vector<std::string> states;
  std::uint32_t state_ms = 0;
  int outputs = 0;  // number of changes
  std::vector<std::uint32_t> executed;
  std::vector<std::string> refused;
  std::vector<std::string> rejected;
  std::vector<std::string> paths;  // "joined 1/4": port and peer
};

// A datagram of the board, decoded.
struct Heard {
  std::string bytes;
  MessageKind kind = MessageKind::state;
  std::uint32_t pnum = 0;
  std::uint32_t t_ms = 0;
  std::uint32_t peer = 0;
  std::uint32_t at_ms = 0;
};

class TestBoard {
 public:
  explicit TestBoard(Settings settings = {}, int port_count = 1, std::uint32_t start_ms = 500'000,
                     firmware::UserI2c* i2c = nullptr,
                     firmware::UserUart (*uarts)[uart_channels] = nullptr)
      : now_ms(start_ms) {
    firmware::Application::Config config;
    config.identity.firmware = "1.2.3";
    config.identity.board_id = "R4-7";
    config.identity.capabilities = "udp+serial";
    config.settings = settings;
    const std::uint8_t chance[Authentication::chance_size] = {1, 2, 3};
    config.chance = chance;
    config.i2c = i2c;
    for (int i = 0; i < uart_channels && uarts != nullptr; ++i) config.uarts[i] = &(*uarts)[i];
    application = std::make_unique<firmware::Application>(hal, config, &log);
    for (int i = 0; i < port_count; ++i) {
      ports[i].now_ms = &now_ms;
      application->add_port(ports[i]);
    }
    application->start(now_ms);
  }

  // Advances the time, and calls poll() exactly when it is due.
  void run(std::uint32_t ms) {
    for (std::uint32_t left = ms;;) {
      const std::uint32_t due = application->poll(now_ms);
      if (left == 0) return;
      const std::uint32_t step = std::clamp(due, 1U, left);
      now_ms += step;
      left -= step;
    }
  }

  // Receives fields from a source. Adds the right checksum.
  void receive(const std::string& fields, Source from = {}) { receive_raw(with_crc(fields), from); }
  void receive_raw(const std::string& bytes, Source from = {}) {
    application->receive(from.port, from.peer, bytes, now_ms);
  }

  // All datagrams that a port sent since the last take().
  std::vector<Heard> take(int port = 0) {
    newest_t(port);
    std::vector<Heard> heard;
    for (const MemoryPort::Sent& sent : ports[port].sent) {
      Datagram datagram;
      Heard one;
      one.bytes = sent.bytes;
      if (!read_datagram(sent.bytes, datagram)) throw std::runtime_error("bad: " + sent.bytes);
      one.kind = kind_of(datagram);
      one.pnum = datagram.pnum();
      one.t_ms = static_cast<std::uint32_t>(datagram.time_ms());
      one.peer = sent.peer;
      one.at_ms = sent.at_ms;
      heard.push_back(one);
    }
    ports[port].sent.clear();
    return heard;
  }
  std::vector<Heard> take(MessageKind kind, int port = 0) {
    std::vector<Heard> heard = take(port);
    heard.erase(std::remove_if(heard.begin(), heard.end(),
                               [&](const Heard& one) { return one.kind != kind; }),
                heard.end());
    return heard;
  }

  // The T that a host on that port echoes: the T of the newest heartbeat. Before the first
  // heartbeat, or if the newest heartbeat reports CONNECTING: 0.
  std::uint32_t newest_t(int port = 0) {
    for (const MemoryPort::Sent& sent : ports[port].sent) {
      Datagram datagram;
      if (read_datagram(sent.bytes, datagram) &&
          kind_of(datagram) == MessageKind::board_heartbeat) {
        const bool echoes = !is_connecting_heartbeat(datagram);
        newest_t_[port] = echoes ? static_cast<std::uint32_t>(datagram.time_ms()) : 0;
        newest_cause_ = heartbeat_report(datagram).cause;
      }
    }
    return newest_t_[port];
  }

  // The cause that the newest heartbeat reports. 0: no cause.
  std::int32_t newest_cause() {
    for (int i = 0; i < firmware::Application::max_ports; ++i) newest_t(i);
    return newest_cause_;
  }

  const firmware::Outputs& outputs() const { return hal.outputs; }
  bool safe() const { return hal.outputs == firmware::Outputs(); }
  firmware::BoardState state() const { return application->state(); }
  SafeReason reason() const { return application->reason(); }

  std::uint32_t now_ms;
  MemoryHal hal;
  EventLog log;
  MemoryPort ports[firmware::Application::max_ports];
  std::unique_ptr<firmware::Application> application;

 private:
  std::uint32_t newest_t_[firmware::Application::max_ports] = {};
  std::int32_t newest_cause_ = 0;
};

inline State state_of(const Heard& heard) {
  Datagram datagram;
  State state;
  if (!read_datagram(heard.bytes, datagram) || !read_state(datagram, state)) {
    throw std::runtime_error("no state: " + heard.bytes);
  }
  return state;
}

constexpr SessionId our_session = 0x0123456789abcdef;
constexpr SessionId another_session = 0xfedcba9876543210;
constexpr SessionId third_session = 0xaaaabbbbccccdddd;

// "SID:…;PNum:…;T:…;", without SID for no_session.
inline std::string stamp_of(SessionId sid, std::uint32_t pnum, std::uint64_t t) {
  char digits[session_id_size];
  write_session_id(digits, sid);
  const std::string id = sid == no_session ? "" : "SID:" + std::string(digits, sizeof digits) + ";";
  return id + "PNum:" + std::to_string(pnum) + ";T:" + std::to_string(t) + ";";
}

// A host with one path, which numbers its packets. A paper host has no_session.
class TestHost {
 public:
  TestHost(TestBoard& to, SessionId session, Source place = {})
      : board(to), at(place), sid(session) {}

  std::uint32_t heartbeat(std::uint64_t t) {
    board.receive("H:ROS2-R4;" + stamp_of(sid, pnum, t), at);
    return pnum++;
  }
  // Sends a heartbeat that echoes the board's newest heartbeat.
  std::uint32_t echo() {
    heard_ = board.newest_t(at.port);
    return heartbeat(heard_);
  }
  // Sends a command field and returns its number.
  std::uint32_t command(const std::string& field) {
    resend(field, pnum);
    return pnum++;
  }
  // Sends E:CLEAR with the cause that the board has reported.
  std::uint32_t clear() { return command(clear_field()); }
  std::string clear_field() { return "E:CLEAR," + std::to_string(board.newest_cause()); }
  void resend(const std::string& field, std::uint32_t number) {
    board.receive(field + ";" + stamp_of(sid, number, 1699276044383), at);
  }
  // Takes control: T:0, then an echo of the board's answer.
  void connect() {
    heartbeat(0);
    echo();
  }
  // Advances the time, with an echo every 100 ms.
  void stay(std::uint32_t ms) {
    for (std::uint32_t done = 0; done < ms; done += 100) {
      echo();
      board.run(std::min(100U, ms - done));
    }
  }

  TestBoard& board;
  Source at;
  SessionId sid;
  std::uint32_t pnum = 12345;

 private:
  std::uint32_t heard_ = 0;
};

struct BoardInControl : testing::Test {
  BoardInControl() {
    host.connect();
    host.stay(300);
    forget();
  }
  void forget() {
    board.take();
    board.log.executed.clear();
    board.log.refused.clear();
  }
  // The codes of the answers since forget().
  std::vector<std::string> answers(int port = 0) {
    std::vector<std::string> codes;
    for (const Heard& heard : board.take(MessageKind::nack, port)) {
      Datagram datagram;
      Nack nack;
      EXPECT_TRUE(read_datagram(heard.bytes, datagram) && read_nack(datagram, nack));
      codes.push_back(str(name_of(nack.code)));
    }
    return codes;
  }

  TestBoard board;
  TestHost host{board, our_session, Source{0, 4}};
};

}  // namespace r4::test
