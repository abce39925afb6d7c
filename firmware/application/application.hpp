// SPDX-License-Identifier: GPL-3.0-or-later
// The R4 board's application: datagrams in, outputs and datagrams out (paper sections 2-4).
//
// It owns no thread, clock or socket. The port feeds it: receive() for each datagram, poll() when
// time has passed, port_down() when a transport is gone, guard().tick() in a timer interrupt; it
// answers through Hal and Port. Every path to the outputs goes through update_outputs(), every way
// into the safe state through Safety.
//
//     CONNECTING   no host yet: outputs safe, `H:R4-ROS2;PNum:0;T:0;` each heartbeat interval
//     ACTIVE       a host is alive and nothing is wrong: outputs follow the setpoints
//     SAFE         a cause of safety.hpp is there: outputs safe; with cause `link` heartbeats only
//
// A session has one to four paths (session_paths.hpp): state and heartbeats go to each of them. Packet
// numbers count per port; answers to hosts that do not control the board count apart. All times are ms of
// the board's clock, which wraps.
#pragma once

#include <cstddef>
#include <cstdint>

#include "../../protocol/keys/authentication.hpp"
#include "../../protocol/link/answer_budget.hpp"
#include "../../protocol/link/board_link.hpp"
#include "../../protocol/link/session_paths.hpp"
#include "../../protocol/link/watchers.hpp"
#include "../../protocol/messages/message.hpp"
#include "../devices/user_i2c.hpp"
#include "../devices/user_uart.hpp"
#include "../executor.hpp"
#include "../guard.hpp"
#include "../hal.hpp"
#include "../port.hpp"
#include "../safety.hpp"
#include "observer.hpp"
#include "state_schedule.hpp"

namespace r4 {
namespace firmware {

class Application {
 public:
  struct Config {
    Identity identity;  // the texts must outlive the application
    Settings settings;
    // Authentication::chance_size random bytes, others at each boot. Without them a board with a
    // key obeys nobody but who is at a cable of its own.
    const std::uint8_t* chance = nullptr;
    // The user's bus, which must outlive the application; none: its commands are unknown.
    UserI2c* i2c = nullptr;
    // The user's UARTs, all or none; the same.
    UserUart* uarts[uart_channels] = {};
  };
  static constexpr int max_ports = 4;
  static constexpr std::uint8_t no_port = max_ports;

  Application(Hal& hal, const Config& config, Observer* observer = nullptr);

  // Ports are added before start(); returns the port's number, or no_port: there are max_ports
  // already, it is not served. A board whose ports are known when it is compiled asserts it then.
  std::uint8_t add_port(Port& port);
  // Makes the outputs safe and sends the first heartbeat.
  void start(std::uint32_t now_ms);

  // A datagram from `peer` on `port`. Anything may be in it. One of a port that was not added is
  // passed over.
  //
  // The loop turns as often as this or poll() is called. If it stood still for longer than
  // standstill_ms, what comes then may have waited all that time: a heartbeat counts from when the
  // loop last turned, until the port is drained or the loop has turned for catch_up_ms.
  void receive(std::uint8_t port, std::uint32_t peer, Text bytes, std::uint32_t now_ms);
  // All that had arrived on `port` has been handed over. A port that can tell saves the next
  // heartbeat from being taken for one that waited.
  void drained(std::uint8_t port);
  // The transport under `port` is gone.
  void port_down(std::uint8_t port, std::uint32_t now_ms);
  // Something is wrong with the board itself: cause is fault or watchdog.
  void fail(SafeReason cause, std::uint32_t now_ms);
  // Does everything that is due; returns the milliseconds until the next call is needed (at most
  // 10).
  std::uint32_t poll(std::uint32_t now_ms);

  // A turn of the user's devices alone; poll() has it, too. At least once a millisecond, so that a transfer
  // can be begun in each.
  void poll_devices(std::uint32_t now_ms);

  // For the timer interrupt. Its first duty is the loop: poll() checks in.
  Guard& guard() { return guard_; }
  static constexpr Guard::Duty loop_duty = 0;

  BoardState state() const;
  SafeReason reason() const { return safety_.reason(); }
  SafeReport safe_report() const;                      // what heartbeats tell
  const Outputs& outputs() const { return outputs_; }  // as the hardware has them
  const Settings& settings() const { return setpoints_.settings; }
  const BoardLink& link() const { return link_; }
  const SessionPaths& paths() const { return paths_; }
  const Authentication& authentication() const { return authentication_; }

  // poll() is wanted at least this often, for the interlocks.
  static constexpr std::uint32_t interlock_period_ms = 10;
  // The guard counts a turn of the loop as missed after this.
  static constexpr std::uint32_t loop_limit_ms = 20;
  // A loop that turns as it should does not stand still. By so much may a heartbeat be taken for
  // younger than it is.
  static constexpr std::uint32_t standstill_ms = 15;
  // No port holds more than is read in this time.
  static constexpr std::uint32_t catch_up_ms = 50;
  // A proximity cause leaves when the obstacle is this much beyond the threshold.
  static constexpr int proximity_hysteresis_cm = 5;
  // … for this long: two turns of each sensor (drivers/ultrasonic.hpp), for one may miss an echo.
  static constexpr std::uint32_t proximity_clear_ms = 500;
  // The answer to a single transfer on the user's bus is in the states of so long, chosen or not.
  static constexpr std::uint32_t answer_shown_ms = 1000;

 private:
  struct PortSlot {
    Port* port = nullptr;
    std::uint32_t next_pnum = 0;   // of the stream and of the controlling host's answers
    std::uint32_t aside_pnum = 0;  // of answers to others
    bool behind = false;           // what comes may have waited, since `waiting_ms`
    std::uint32_t waiting_ms = 0;
  };

  static BoardLink::Timing timing_of(const Settings& settings);
  void turn(std::uint32_t now_ms);
  std::uint32_t waited_ms(std::uint8_t port, std::uint32_t now_ms) const;
  Verdict judge(std::uint8_t port, MessageKind kind, const Datagram& datagram,
                std::uint32_t now_ms);
  void on_host_heartbeat(Source from, const Datagram& datagram, std::uint32_t now_ms);
  void on_host_found(Source at, std::uint32_t now_ms);
  void on_path_heard(Source from, std::uint32_t now_ms);
  void on_path_left(Source path, std::uint32_t now_ms);
  void hold_paths();
  bool rejected(Verdict verdict, std::uint32_t now_ms);
  void tell_ports();

  // application_commands.cpp
  void on_command(Source from, const Datagram& datagram, Verdict verdict, std::uint32_t now_ms);
  void on_group(Source from, const Datagram& datagram, Verdict verdict, std::uint32_t now_ms);
  bool admit(Source from, const Datagram& datagram, Verdict verdict, Refusal refusal,
             std::uint8_t at, std::uint32_t now_ms);
  void on_watch(Source from, const Datagram& datagram, const Command& command,
                std::uint32_t now_ms);
  bool may_set(std::uint8_t port, const Command& command) const;
  void execute(std::uint32_t pnum, const Command& command, std::uint32_t now_ms);
  void take_effect(std::uint32_t pnum, const Command& command, std::uint32_t now_ms);
  void bring_about(std::uint32_t now_ms);
  void emergency_stop(Source from, const Datagram& datagram, Verdict verdict, std::uint32_t now_ms);

  // application_devices.cpp
  Refusal carry_out_device(std::uint32_t pnum, const Command& command, std::uint32_t now_ms);
  void forget_uarts();
  void begin_devices(std::uint32_t now_ms);
  Refusal write_uart(const Command& command);
  void follow_device_setting(Text key, std::uint32_t now_ms);
  void drop_device_writes();
  void add_device_answer(FieldSet& fields, std::uint32_t t_ms) const;
  void fill_devices(State& state) const;

  // application_safety.cpp
  void look_at_time(std::uint32_t now_ms);
  void look_at_stops(std::uint32_t now_ms);
  void stop_without_number(std::uint32_t now_ms);
  void enter(SafeReason cause, std::uint32_t now_ms);
  void check_interlocks(std::uint32_t now_ms);
  void clear();
  bool any_threshold() const;
  bool obstacle() const;
  Refusal judge_clear(const Command& command, std::uint32_t waited_ms, std::uint32_t now_ms) const;
  void expect_host();
  void update_outputs(std::uint32_t now_ms);
  void report_state(std::uint32_t now_ms);

  // application_sending.cpp
  static std::uint32_t heartbeat_time(std::uint32_t now_ms);
  void send_heartbeats(std::uint32_t now_ms);
  void answer_heartbeat(Source to, std::uint32_t now_ms);
  void send_heartbeat(Source to, std::uint32_t now_ms);
  void write_heartbeat(Source to, std::uint32_t& pnum, std::uint32_t t_ms, const SafeReport& safe);
  SafeReport shown_to_watchers() const;
  void send_states(std::uint32_t now_ms);
  void send_state(Source to, std::uint32_t& pnum, FieldSet fields, const State& state,
                  std::uint32_t t_ms);
  void send_part(Source to, std::uint32_t& pnum, DatagramWriter& writer, const State& state,
                 std::uint32_t t_ms);
  void fill(State& state) const;
  void transmit(Source to, const std::uint32_t& number, Text datagram, Priority priority);
  void answer(Source to, DatagramWriter& writer, std::uint32_t now_ms);
  void identify(Source to, const Datagram& question, std::uint32_t now_ms);
  void refuse(Source to, const Datagram& datagram, Refusal code, std::uint32_t now_ms,
              std::uint8_t at = 0, std::uint32_t lease = 0);
  bool is_of_owner() const;
  std::uint32_t& number_for(Source to);
  bool reaches(Source watcher) const;
  bool hears_all(Source watcher) const;
  std::uint32_t audience(std::uint8_t port) const;

  Hal& hal_;
  Observer* observer_;
  Identity identity_;
  BoardLink link_;
  SessionPaths paths_;
  Watchers watchers_;
  Authentication authentication_;
  AnswerBudget questions_;  // of hosts that do not control the board
  Guard guard_;
  Safety safety_;
  StateSchedule schedule_;
  Setpoints setpoints_;
  Outputs outputs_;  // what the hardware was told last
  Inputs inputs_;
  PortSlot ports_[max_ports];
  std::uint8_t port_count_ = 0;
  bool any_behind_ = false;  // one of them, perhaps
  BoardState reported_state_ = BoardState::connecting;
  SafeReason reported_reason_ = SafeReason::none;
  std::uint32_t turned_ms_ = 0;    // when the loop last turned
  std::uint32_t went_on_ms_ = 0;   // … and when it went on after it had stood still
  std::uint32_t obstacle_ms_ = 0;  // when there was one last
  std::uint32_t caused_ms_ = 0;    // when a cause other than link came last
  // Of the datagram that is being read: its host, and whether another path has brought it before.
  HostId speaker_;
  bool known_ = false;
  bool outputs_live_ = false;  // outputs_ follow the setpoints
  // The newest stop, as long as it lasts: who asked for it, and its number if it had one.
  bool has_stop_number_ = false;
  bool stop_of_a_key_ = false;
  std::uint32_t stop_number_ = 0;
  HostId stop_from_;
  // Stops that the guard has heard, and those of them whose datagrams are still to be read; when it
  // heard the newest.
  std::uint32_t stops_heard_ = 0;
  std::uint32_t unread_stops_ = 0;
  std::uint32_t unread_ms_ = 0;
  std::uint32_t answered_ms_ = 0;
  bool has_answer_ = false;  // of the user's bus, which is told for a while
  UserI2c* i2c_;
  UserUart* uarts_[uart_channels];
  std::uint32_t rx_ok_ = 0;
  std::uint32_t rx_bad_ = 0;
  std::uint32_t rx_refused_ = 0;
};

}  // namespace firmware
}  // namespace r4
