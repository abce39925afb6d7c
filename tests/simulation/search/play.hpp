// SPDX-License-Identifier: GPL-3.0-or-later
// One run of a story with faults, in the world of the link simulator.
//
// A step is a datagram from a host to the board or back. Steps are numbered from 0 in the order in
// which they are sent. A fault happens to a datagram, or to a path, a host or the board after the
// datagram is sent and before it arrives.
//
// A run checks the promises of world.hpp, and by the board's behaviour alone these promises:
//    silence   outputs of a host are live only while intact heartbeats of the same process arrive.
//    joined    only the heartbeats of its own host keep a session.
//    resumed   only its own host resumes a session.
//    stranger  only commands of its own host are executed in a session.
//    pushed    strangers do not take the board from a host whose heartbeats arrive in time with a
//              fresh echo.
//    served    while a host is in control, strangers do not prevent confirmations of its commands.
//    returns   at the end of a run without strangers, a host that runs is in control.
//
// With a key, the first arrival of a signed datagram at the board belongs to its host, whatever its
// peer is (docs/design/safety-argument.md). Later arrivals belong to the stranger.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "story.hpp"
#include "tests/host/bridge/scripted_bridge.hpp"
#include "tests/simulation/script.hpp"
#include "tests/simulation/stranger.hpp"

namespace r4::simulation {

struct Step {
  std::uint64_t at_us = 0;
  bool to_board = false;
  int host = 0;
  int path = 0;
  bool passes = false;        // no cut loses this datagram
  bool first = false;         // the first datagram of its event in the world
  bool first_of_host = true;  // the first datagram of its event from or to this host
  bool first_of_path = true;  // the first datagram of its event from or to this host on this path
  bool alive = false;         // its host runs
  std::string text;           // only with a trace
};

class Play final : World::Script {
 public:
  // `confirmed`: the number of commands that are confirmed without faults, if it is known.
  // `always_pushed`: check `pushed` also without strangers.
  Play(const Story& story, std::vector<Fault> faults, bool keep_trace,
       std::optional<std::uint32_t> confirmed = {}, bool always_pushed = false);

  Report run() { return world_.run(); }
  const std::vector<Step>& steps() const { return steps_; }
  // True if the fault may happen at its step. False if another fault makes the same run.
  bool applies(Fault fault) const;

 private:
  using Process = World::Process;
  using Packet = World::Packet;
  using Host = World::Host;
  static constexpr int stranger_host = World::stranger_host;
  static constexpr std::uint64_t delay_us = 500;   // of every path
  static constexpr std::uint64_t bridge_us = 100;  // from a bridge to its board, and back
  static constexpr std::uint64_t disturbed_us = 100'000;

  static Schedule schedule_of(const Story& story);

  void begin() override;
  void end() override;
  void on_event(int index) override;
  void check() override;
  void set(SessionOptions& options) const override;
  bool has_place(int host, int path) const override;
  void on_sent(const Packet& sent) override;
  bool takes(const Packet& arrived) override;
  void before_board(const Packet& packet) override;
  void after_board(const Packet& packet) override;
  bool on_board_sent(std::uint8_t port, std::uint32_t peer, Priority priority,
                     std::string_view bytes) override;
  bool on_executed(const Command& command) override;
  void on_link_lost() override;

  void after(std::uint64_t us, std::function<void()> call);
  Host& host(int index);
  bool runs(int index);
  void disturb_all(std::uint64_t until_us);
  // play_acts.cpp
  void act(const Act& act);
  void begin_fault(Fault::Kind kind, int host, int path, const std::string& bytes);
  void command(int index, bool group);
  void kill(int index);
  void start_after(int index, std::uint64_t us);
  void sleep(int index);
  void pause(int index);
  void when_it_runs(int index, std::function<void()> call);
  // play_strangers.cpp
  void renew_lease();
  void say(const std::string& fields, std::uint8_t port, std::uint32_t peer);
  void say_bytes(std::string bytes, std::uint8_t port, std::uint32_t peer);
  bool is_taken(std::uint32_t peer);
  void say_once(Fault::Kind kind);
  void repeat(const std::string& bytes, Process signer);
  std::uint32_t next_number() const;
  void carry_on(Fault::Kind kind, std::uint8_t port, std::uint32_t peer);

  // play_bridge.cpp
  void begin_bridge();
  void set_clock_of_bridge();
  void tick_bridge();
  bool bridge_takes(const Packet& arrived);
  void carry_from_bridge(const Packet* packet);

  void deliver_in(std::uint64_t us, const Packet& packet);
  std::string name_of(Process process) const;
  void violate(const std::string& what) { world_.violate(what); }

  const Story& story_;
  const std::vector<Fault> faults_;
  std::size_t next_fault_ = 0;
  bool keep_trace_;
  const std::optional<std::uint32_t> confirmed_;
  bool any_stranger_ = false;
  bool only_strangers_ = true;
  bool looks_for_pushed_;

  std::vector<Step> steps_;
  std::uint64_t event_of_step_ = ~std::uint64_t{0};
  std::vector<std::pair<int, int>> hosts_of_event_;  // host and path of each step of the event
  std::vector<std::function<void()>> calls_;
  std::vector<Packet> overtaken_;  // each packet waits for the next datagram in its direction
  struct Suspended {
    bool keeps = false;  // true: arriving datagrams wait; false: they are lost
    std::vector<Packet> arrived;
    std::vector<std::function<void()>> calls;
  };
  std::map<int, Suspended> suspended_;

  // The process in control, judged by the board's behaviour.
  Process controller_{-1, 0};
  bool has_controller_ = false;
  bool executed_ = false;  // the board has executed a command of the process in control
  bool stranger_controlled_ = false;
  bool lost_now_ = false;     // in this event
  bool may_be_lost_ = false;  // in this event, by a farewell or a lost transport
  bool had_owner_ = false;
  std::uint32_t fed_before_ = 0;
  std::uint64_t good_us_ = 0;  // when the newest heartbeat that must feed arrived
  std::map<Process, std::uint64_t> heard_us_;
  std::map<Process, std::uint32_t> newest_;  // the number of the newest heartbeat
  struct Signed {
    Process signer;
    bool has_arrived = false;
  };
  std::map<std::string, Signed> copied_;  // datagrams that a stranger has duplicated

  Stranger stranger_;
  std::uint32_t stranger_pnum_ = 0;  // number of the stranger's own datagrams
  std::uint32_t first_peer_ = 0;     // the first address of the first host
  // Number of the stranger's datagrams that pass for the host's datagrams.
  std::uint32_t campaign_pnum_ = 0;
  static constexpr std::uint32_t bridge_peer = 0xFFFB;  // the bridge's peer number at the board
  std::unique_ptr<test::ScriptedBridge> bridge_;
  World world_;
};

}  // namespace r4::simulation
