// SPDX-License-Identifier: GPL-3.0-or-later
// The link simulator: the shipped application of the board and the shipped session of the host,
// joined by a faulty channel in virtual time. One seed gives one run, to the last byte.
//
// During a run, the simulator checks the promises of docs/design/safety-argument.md. The simulator
// stops at the first broken promise:
//    silence    outputs are live only while intact heartbeats of the host in control arrive. The
//               last heartbeat arrived at most timeout + 20 ms ago, even if it waited before the
//               board read it. The last heartbeat was sent at most 2 timeouts + 20 ms ago.
//               Exception: a board whose loop does not run, until its first turn.
//    once       no command is executed twice, even if the board restarts.
//    whole      a group of commands is executed as a whole or not at all, and reaches the hardware
//               at once.
//    order      no command is executed that is older than the newest executed command or than an
//               executed stop.
//    intact     an executed command is as a host sent it, and this host controls the board.
//    fresh      an executed command was sent at most 2 timeouts + 250 ms before.
//    late       a command is not executed more than 250 ms after a heartbeat that fed overtook it.
//    truth      a confirmed command was executed. A refused command was not executed, and is not
//               executed later.
//    stop       if a stop is confirmed, the board has obeyed the same stop. No E:CLEAR clears a
//               stop that is newer than the request for the E:CLEAR.
//    farewell   the board obeys only the farewell of the process in control, at once. If a farewell
//               is confirmed, the board has obeyed it.
//    restore    restored outputs belong to a host that was alive a timeout ago.
//    forged     on a board with a key, no datagram of an attacker is executed, feeds or takes
//               control, except a stop.
//    stranger   a stranger (stranger.hpp) takes, keeps and resumes only its own session. In the
//               session of a host, no datagram of the stranger is executed, makes a path or uses up
//               a number. While no host is in control, the stranger may begin a session as any host
//               may. The session belongs to the process whose heartbeat began it. Each SID of the
//               stranger, and each address without a SID, is treated as a separate process. A new
//               session has executed no command, and its SESSION is the number of the heartbeat
//               that began it. A session with another SESSION was resumed.
//    kept       a host keeps the board while its heartbeats arrive in time with new numbers and
//               fresh echoes. With keys (a signature may be late) a host keeps the board while its
//               heartbeats feed. With standstills there is no check, because a heartbeat may have
//               waited.
//    owned      the process in control commanded the outputs that are live.
//    watch      the host in control and at most four other peers get each state once. Each of these
//               peers has echoed, at most a lease ago, a token that the board sent to it. Without a
//               host, states report that the board is safe. A watcher sends no heartbeat and no
//               command: a watcher that feeds or drives breaks silence or intact.
//    joined     a peer becomes a path of a session only by a datagram of the session's host. No
//               datagram recorded an hour ago feeds.
//    paths      a path meets the limits while it loses, damages and delays no datagram, and takes
//               at most 100 ms each way. The path is not disturbed, and both its ends run. A path
//               that both ends have used for a second and that meets the limits stays in use. While
//               there is such a path, there is no false trip, and no command times out that had
//               enough time on this path alone. The newest state is never older than the newest
//               state of this path, nor older than two periods and the path's delay. Another path
//               that meets the limits for 2.5 s is also used. While the host has used such a path
//               for 0.4 s without a BUSY on it, the host does not report BUSY.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <queue>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "attacker.hpp"
#include "firmware/application/application.hpp"
#include "host/session/session.hpp"
#include "schedule.hpp"
#include "stranger.hpp"

namespace r4::simulation {

struct Report {
  std::uint64_t seed = 0;
  std::string violation;           // empty: no promise was broken
  std::uint64_t trace_hash = 0;    // over every datagram and event with its time
  std::vector<std::string> trace;  // only if a trace was requested
  // Counts of events, to check that the schedules reach the events under test.
  std::uint32_t executed = 0;
  std::uint32_t executed_groups = 0;
  std::uint32_t groups_apart = 0;  // groups that were sent command by command
  std::uint32_t confirmed = 0;
  std::uint32_t refused = 0;
  std::uint32_t timed_out = 0;
  std::uint32_t link_losses = 0;  // SAFE with cause link
  std::uint32_t restores = 0;     // outputs restored because of recovery=last
  std::uint32_t stops = 0;
  std::uint32_t stops_confirmed = 0;
  std::uint32_t clears = 0;
  std::uint32_t clears_refused = 0;  // refused by the board because of a newer stop
  std::uint32_t farewells = 0;       // farewells that the board obeyed
  std::uint32_t farewells_confirmed = 0;
  std::uint32_t busy = 0;
  std::uint32_t stale = 0;
  std::uint32_t duplicate = 0;
  std::uint32_t attacks = 0;   // datagrams of an attacker
  std::uint32_t rejected = 0;  // rejected by the board because of their signatures
  std::uint32_t executed_signed = 0;
  std::uint32_t strangers = 0;           // datagrams of a stranger
  std::uint32_t strangers_sessions = 0;  // the stranger's own sessions that began
  std::uint32_t strangers_executed = 0;  // commands in these sessions
  std::uint32_t leases = 0;              // leases that began
  std::uint32_t watched = 0;             // states that watchers received
  std::uint32_t forged_leases = 0;
  std::uint32_t sampled = 0;          // states reported with a sampling time and its error
  std::uint32_t sampled_wrongly = 0;  // reported times whose error exceeded the reported error
  std::uint32_t standstills = 0;
  std::uint32_t waited = 0;            // datagrams that arrived during a standstill
  std::uint32_t waited_to_feed = 0;    // datagrams that waited and then fed
  std::uint64_t worst_silence_us = 0;  // from the last heartbeat to safe outputs
  std::uint32_t joins = 0;
  std::uint32_t path_losses = 0;  // lost paths of sessions that continued
  std::uint32_t failovers = 0;    // a path in use was disturbed, and another path stayed in use
  // Commands that ended while a path met the limits all the time.
  std::uint32_t timed_on_good = 0;
  std::uint64_t copies = 0;     // duplicates that reached hosts
  std::uint32_t replayed = 0;   // datagrams recorded an hour ago
  std::uint64_t served_us = 0;  // total time with a path that met the limits
};

class World : public firmware::Hal, public firmware::Observer {
 public:
  // Additions to a schedule: standstills of the board's loop, or several paths.
  enum class Beside : std::uint8_t { nothing, standstills, paths };

  World(std::uint64_t seed, bool keep_trace, Beside beside = Beside::nothing);
  // Runs a given scenario.
  World(std::uint64_t seed, Schedule schedule, bool keep_trace);
  // Runs a given scenario. The script decides instead of chance (script.hpp).
  class Script;
  World(Schedule schedule, Script& script, bool keep_trace);
  ~World();

  Report run();

 private:
  friend class Play;  // search/play.hpp
  struct Host;
  struct Event {
    std::uint64_t at_us;
    std::uint64_t order;
    enum class Kind : std::uint8_t {
      packet,
      board,
      host,
      command,
      happening,
      over,
      attack,
      forge,
      standstill,
      go_on,
      stranger,
      replay,
      script,
    } kind;
    int index;
    std::uint32_t generation;
    bool operator>(const Event& other) const {
      return at_us != other.at_us ? at_us > other.at_us : order > other.order;
    }
  };
  struct Packet {
    bool to_board = false;
    int host = 0;
    int place = 0;                  // the index in the host's places
    std::uint8_t port = 0;          // the board's port
    std::uint32_t peer = 0;         // the host's address when the datagram was sent
    std::uint32_t incarnation = 0;  // the host's incarnation when the datagram was sent
    bool intact = true;
    bool heartbeat = false;
    bool recorded = false;  // replayed from an hour ago
    bool stop = false;
    std::uint32_t pnum = 0;
    std::uint64_t t = 0;
    SessionId sid = no_session;
    int command = -1;  // index in commands_
    int command_count = 0;
    std::uint64_t sent_us = 0;
    std::uint64_t arrived_us = 0;
    std::string bytes;
  };
  // One run of a host process. The packet numbers of different runs cannot be compared.
  struct Process {
    int host = -1;
    std::uint32_t incarnation = 0;
    auto operator<=>(const Process&) const = default;
  };
  static constexpr int stranger_host = -2;
  // A heartbeat that fed the board.
  struct Fed {
    Process from;
    std::uint32_t pnum;
    std::uint64_t at_us;
    HostId id;
  };
  // One command of a host. The stepper target identifies the command: the target of channel 1, or
  // of all channels for a group.
  struct Sent {
    int host = 0;
    std::uint32_t incarnation = 0;
    std::uint64_t asked_us = 0;
    std::uint64_t transmitted_us = 0;  // when it was last sent
    int executed = 0;
    bool group = false;
    bool apart = false;         // its host assumes a board without groups, because the link is bad
    std::uint8_t channels = 0;  // bit n-1: executed on channel n
    bool dead = false;          // a refusal was reported
  };

  void apply(const firmware::Outputs& outputs) override;
  void make_safe() override;
  void sample(firmware::Inputs& inputs) override;
  void zero(int) override {}
  bool clear_fault() override { return true; }
  void on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason) override;
  void on_outputs(std::uint32_t t_ms, const firmware::Outputs& outputs) override;
  void on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command) override;
  void on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code) override;
  void on_rejected(std::uint32_t t_ms, Verdict verdict) override;
  void on_path(std::uint32_t t_ms, Source path, bool joined) override;

  void run_until(std::uint64_t end_us);
  void handle(const Event& event);
  void at(std::uint64_t time_us, Event::Kind kind, int index, std::uint32_t generation = 0);
  std::uint32_t board_ms() const;
  // The simulation's time, in us, at which the clock of the running board reaches `t_ms`.
  std::uint64_t when_board_shows(std::uint32_t t_ms) const;
  void mix(const void* data, std::size_t size);
  void note(const std::string& line);
  void show(const std::string& line);
  void violate(const std::string& what);
  // world_board.cpp, with the overridden functions above
  void boot_board();
  void poll_board();
  void send(std::uint8_t port, Text datagram, Priority priority, std::uint32_t peer);
  void lose_port(std::uint8_t port);
  void stand_still(const Standstill& standstill);
  void go_on();
  void check_silence();
  void on_stop(std::uint32_t pnum);
  bool controls(const Process& process) const;
  void check_whole(int id);
  void check_steppers();
  // world_hosts.cpp
  void start_host(int index);
  void poll_host(int index);
  void issue_command(int index);
  // world_happenings.cpp
  void stop(Host& host);
  void leave(Host& host);
  void clear_stop(Host& host);
  void call_stopper(Host& stopper, bool over);
  void happen(const Happening& happening, bool over);
  void attack();
  // world_watchers.cpp
  Host& watcher(int number);
  void add_watchers();
  void watch(Host& watcher, bool over);
  void forge_lease();
  static bool asks_to_watch(std::string_view bytes);
  void on_told(std::uint32_t peer, const Datagram& datagram);
  void on_lease(std::uint32_t peer, std::string_view bytes);
  void check_stream(std::uint8_t port, std::uint32_t peer, const Datagram& datagram);
  // world_channel.cpp
  void transfer(bool to_board, int host, int place, std::string_view bytes);
  int take_slot();
  void describe(Packet& packet);
  bool has_to_feed(const Packet& packet) const;
  void deliver(int slot);
  void hand_over(int slot);
  void release(int slot);
  // world_paths.cpp
  void place(Host& host);
  std::uint8_t port_of(int path) const {
    return static_cast<std::uint8_t>(schedule_.one_port ? 0 : path);
  }
  // When both ends have used a path for this time, the path must stay in use.
  static constexpr std::uint64_t settled_us = 1'000'000;
  bool has_keys() const { return schedule_.keys || schedule_.attack_interval_us != 0; }
  bool several() const { return schedule_.paths() > 1; }
  bool meets_limits(int path) const;
  bool serves_since(std::uint64_t at_us) const;
  bool should_be_confirmed(const Sent& sent) const;
  void check_paths();
  void check_age(int path);
  void on_told_state(int path, std::string_view bytes);
  void disturb(int path, Happening::Kind kind, std::uint64_t until_us);
  void unplug(const Happening& happening, bool over);
  void record();
  std::uint32_t first_time();
  void replay(int index);
  // world_strangers.cpp
  void on_board_heartbeat(std::string_view bytes);
  void tell_stranger(std::uint32_t peer, Priority priority, std::string_view bytes);
  void stranger();
  void on_strangers(const Command& command);
  void check_owner_of_outputs();
  bool is_in_time() const;
  void check_lost();

  Random random_;
  Random loop_random_;  // only for standstills, so that they do not change the other events
  Schedule schedule_;
  Report report_;
  bool keep_trace_;
  Script* script_ = nullptr;
  std::uint64_t handled_ = 0;  // number of events so far
  bool over_ = false;
  std::uint64_t now_us_ = 0;
  std::uint64_t order_ = 0;
  std::priority_queue<Event, std::vector<Event>, std::greater<>> events_;
  std::vector<Packet> packets_;
  std::vector<int> free_packets_;

  std::unique_ptr<firmware::Application> board_;
  std::uint32_t boot_offset_ms_ = 0;
  std::vector<std::uint32_t> first_times_;  // first time of each boot
  std::uint64_t boot_us_ = 0;
  std::uint32_t board_generation_ = 0;
  bool handle_held_ = true;
  std::uint16_t distance_cm_ = 200;
  firmware::Outputs outputs_;
  bool live_ = false;
  bool was_lost_ = false;
  bool standing_ = false;  // the board's loop does not run
  std::set<std::uint8_t> ports_lost_meanwhile_;
  std::vector<int> waiting_;  // packets that arrived during the standstill
  std::map<std::uint32_t, std::uint64_t>
      heard_us_;                         // when the newest intact heartbeat of a peer arrived
  std::uint64_t heartbeat_in_us_ = 0;    // time of the newest intact heartbeat that arrived
  std::uint64_t heartbeat_sent_us_ = 0;  // when the same heartbeat was sent
  std::vector<Fed> fed_;                 // during this boot of the board
  Process delivering_;                   // the sender of the packet that the board is handling
  Source delivering_at_;
  Process stop_from_;  // sender of the last executed stop
  std::uint32_t stop_pnum_ = 0;
  int newest_executed_ = -1;
  bool stopped_ = false;
  std::uint64_t new_stop_us_ = 0;  // time of the newest stop that does not repeat an earlier stop
  std::map<Process, std::uint64_t> clear_asked_us_;
  std::uint32_t next_peer_ = 1;

  // The tokens that this boot of the board sent to a peer, and the peer's lease. Each token has the
  // time when it was sent or last echoed. The board may forget a lease at any time. Then another
  // token renews the lease.
  struct Lease {
    std::map<std::uint32_t, std::uint64_t> tokens_us;
    std::uint32_t token = 0;  // the newest echoed token; 0: none yet
    std::uint64_t renewed_us = 0;
  };
  std::map<std::uint32_t, Lease> leases_;
  std::uint32_t newest_token_ = 0;
  std::set<std::uint32_t>
      streamed_;  // the receivers of states at streamed_us_, except the host in control
  std::uint64_t streamed_us_ = 0;
  std::uint64_t went_on_us_ = 0;  // end of the board's last standstill
  // When a path of the session was last sent a state, and how many heartbeats had fed by that time.
  using Streamed = std::pair<std::uint64_t, std::size_t>;
  std::map<std::pair<std::uint8_t, std::uint32_t>, Streamed> owner_streamed_;  // by port and peer

  std::vector<std::unique_ptr<Host>> hosts_;
  std::vector<Sent> commands_;
  Attacker attacker_;
  bool attacking_ = false;
  std::set<std::uint32_t> attacker_stops_;  // the numbers of the attacker's stops
  Stranger stranger_;
  Random stranger_random_;
  std::uint64_t good_us_ = 0;         // when a heartbeat that must feed last arrived
  std::vector<std::uint32_t> shown_;  // the T of the board's newest heartbeats
  bool had_owner_ = false;            // after the previous event
  bool may_be_lost_ = false;          // in this event, by a farewell or a lost port of the board

  struct BoardPort final : firmware::Port {
    BoardPort(World& w, std::uint8_t n) : world(w), number(n) {}
    void send(Text datagram, Priority priority, std::uint32_t peer) override {
      world.send(number, datagram, priority, peer);
    }
    std::size_t max_size() const override { return max_datagram; }
    World& world;
    std::uint8_t number;
  };
  static constexpr int most_paths = 3;
  BoardPort ports_[most_paths] = {{*this, 0}, {*this, 1}, {*this, 2}};
  struct Path {
    std::uint64_t cut_to_board_until_us = 0;
    std::uint64_t cut_to_host_until_us = 0;
    std::uint64_t stalled_until_us = 0;
    std::uint64_t unplugged_until_us = 0;
    std::uint64_t disturbed_until_us = 0;  // disturbances of the first host's path
    bool fine = false;                     // the path meets the limits
    std::uint64_t fine_since_us = 0;
    bool serves = false;  // the path meets the limits and both ends use it
    std::uint64_t serves_since_us = 0;
    std::uint64_t told_busy_us = 0;  // when the board last answered BUSY on this path
    bool brought_state = false;
    std::uint32_t newest_t = 0;  // newest T of the states on this path
  };
  Path paths_[most_paths];
  Random paths_random_;
  std::uint64_t start_us_ = 0;  // an hour after the recording
  std::uint64_t looked_us_ = 0;
  struct Recorded {
    std::uint64_t at_us;
    bool to_board;
    std::string bytes;
  };
  bool recording_ = false;
  std::vector<Recorded> recorded_;
};

}  // namespace r4::simulation
