// SPDX-License-Identifier: GPL-3.0-or-later
// The R4 board's application: datagrams in, outputs and datagrams out (paper sections 2-4). The
// application owns no thread, clock or socket. The port calls receive() for each datagram, poll()
// as time passes, port_down() when a transport fails, and guard().tick() in a timer interrupt.
// Setpoints reach the hardware only in update_outputs(). Safety holds all causes of the safe state.
//     CONNECTING   no host yet: outputs safe, `H:R4-ROS2;PNum:0;T:0;` each heartbeat interval
//     ACTIVE       a host is in control and there is no cause: outputs follow the setpoints
//     SAFE         there is a cause (safety.hpp): outputs safe; with cause `link` heartbeats only
//
// A session has one to four paths (session_paths.hpp). Each path gets states and heartbeats. Packet
// numbers count per port. Answers to other hosts have separate numbers. Times are ms, and wrap.
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
    // Authentication::chance_size random bytes, different at each boot. Without chance, a board
    // with a key obeys only a host on the board's own cable.
    const std::uint8_t* chance = nullptr;
    // Must outlive the application. nullptr: commands are refused as unknown. All UARTs or none.
    UserI2c* i2c = nullptr;
    UserUart* uarts[uart_channels] = {};
  };
  static constexpr int max_ports = 4;
  static constexpr std::uint8_t no_port = max_ports;

  Application(Hal& hal, const Config& config, Observer* observer = nullptr);

  // Call before start(). Returns the port's number. Beyond max_ports: no_port, not served.
  std::uint8_t add_port(Port& port);
  // Makes the outputs safe and sends the first heartbeat.
  void start(std::uint32_t now_ms);

  // Ignores a port that was not added. After a pause longer than standstill_ms, datagrams may have
  // waited. So until drained(), or for catch_up_ms, heartbeats count from the last loop turn.
  void receive(std::uint8_t port, std::uint32_t peer, Text bytes, std::uint32_t now_ms);
  // All datagrams that arrived on `port` were handed over, so its next heartbeat has not waited.
  void drained(std::uint8_t port);
  void port_down(std::uint8_t port, std::uint32_t now_ms);
  // The board itself has failed: `cause` is fault or watchdog.
  void fail(SafeReason cause, std::uint32_t now_ms);
  // Does everything that is due. Returns the milliseconds until the next call, at most 10.
  std::uint32_t poll(std::uint32_t now_ms);

  // Part of poll(). Call at least once per millisecond: each call can begin one transfer.
  void poll_devices(std::uint32_t now_ms);

  // Call tick() in the timer interrupt. poll() checks in the first duty, loop_duty.
  Guard& guard() { return guard_; }
  static constexpr Guard::Duty loop_duty = 0;

  BoardState state() const;
  SafeReason reason() const { return safety_.reason(); }
  SafeReport safe_report() const;                      // as in heartbeats
  const Outputs& outputs() const { return outputs_; }  // as last sent to the hardware
  const Settings& settings() const { return setpoints_.settings; }
  const BoardLink& link() const { return link_; }
  const SessionPaths& paths() const { return paths_; }
  const Authentication& authentication() const { return authentication_; }

  static constexpr std::uint32_t interlock_period_ms = 10;
  static constexpr std::uint32_t loop_limit_ms = 20;
  // A longer pause between two turns is a standstill. A heartbeat may count as newer by this time.
  static constexpr std::uint32_t standstill_ms = 15;
  // A port holds at most as many datagrams as the loop reads in this time.
  static constexpr std::uint32_t catch_up_ms = 50;
  // The cause proximity ends when the obstacle is this far beyond the threshold for this long. The
  // time is two turns of each sensor (drivers/ultrasonic.hpp), because one turn may miss an echo.
  static constexpr int proximity_hysteresis_cm = 5;
  static constexpr std::uint32_t proximity_clear_ms = 500;
  // For this time, states show the answer to a single transfer on the user's bus, selected or not.
  static constexpr std::uint32_t answer_shown_ms = 1000;

 private:
  struct PortSlot {
    Port* port = nullptr;
    std::uint32_t next_pnum = 0;   // numbers states, heartbeats, answers to the controlling host
    std::uint32_t aside_pnum = 0;  // numbers answers to other hosts
    bool behind = false;           // datagrams may have waited, since `waiting_ms`
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

  Refusal carry_out_device(std::uint32_t pnum, const Command& command, std::uint32_t now_ms);
  void forget_uarts();
  void begin_devices(std::uint32_t now_ms);
  Refusal write_uart(const Command& command);
  void follow_device_setting(Text key, std::uint32_t now_ms);
  void drop_device_writes();
  void add_device_answer(FieldSet& fields, std::uint32_t t_ms) const;
  void fill_devices(State& state) const;

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

  static std::uint32_t heartbeat_time(std::uint32_t now_ms);
  void send_heartbeats(std::uint32_t now_ms);
  void answer_heartbeat(Source to, std::uint32_t now_ms);
  void send_heartbeat(Source to, std::uint32_t now_ms);
  void write_heartbeat(Source to, std::uint32_t& pnum, std::uint32_t t_ms, const SafeReport& safe);
  void send_states(std::uint32_t now_ms);
  void send_state(Source to, std::uint32_t& pnum, FieldSet fields, const State& state,
                  std::uint32_t t_ms);
  void send_part(Source to, std::uint32_t& pnum, DatagramWriter& writer, const State& state,
                 std::uint32_t t_ms);
  void fill(State& state) const;
  void transmit(Source to, const std::uint32_t& number, Text datagram, Priority priority);
  void answer(Source to, DatagramWriter& writer, std::uint32_t now_ms);
  BoardWiring kept_wiring() const;
  void identify(Source to, const Datagram& question, bool with_wiring, std::uint32_t now_ms);
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
  AnswerBudget questions_;  // limits answers to hosts that are not in control
  Guard guard_;
  Safety safety_;
  StateSchedule schedule_;
  Setpoints setpoints_;
  Outputs outputs_;
  bool rezeroed_ = false;  // a Z has moved a stepper's zero: an equal setpoint is another position
  Inputs inputs_;
  PortSlot ports_[max_ports];
  std::uint8_t port_count_ = 0;
  bool any_behind_ = false;  // may be true when no port is behind
  BoardState reported_state_ = BoardState::connecting;
  SafeReason reported_reason_ = SafeReason::link;
  std::uint32_t turned_ms_ = 0;
  std::uint32_t went_on_ms_ = 0;   // the first turn after a standstill
  std::uint32_t obstacle_ms_ = 0;  // when an obstacle was last seen
  std::uint32_t caused_ms_ = 0;    // when a cause other than link last began
  // The host of the datagram being read, and whether another path delivered the datagram before.
  HostId speaker_;
  bool known_ = false;
  bool outputs_live_ = false;  // outputs_ follow the setpoints
  // The newest stop while it lasts: its sender, and its number if it has one.
  bool has_stop_number_ = false;
  bool stop_of_a_key_ = false;
  std::uint32_t stop_number_ = 0;
  HostId stop_from_;
  // Stops that the guard received, their unread datagrams, and the time of the newest.
  std::uint32_t stops_heard_ = 0;
  std::uint32_t unread_stops_ = 0;
  std::uint32_t unread_ms_ = 0;
  std::uint32_t answered_ms_ = 0;
  bool has_answer_ = false;      // states show an answer
  std::uint32_t wiring_in_use_;  // checksum of the wiring
  UserI2c* i2c_;
  UserUart* uarts_[uart_channels];
  std::uint32_t rx_ok_ = 0;
  std::uint32_t rx_bad_ = 0;
  std::uint32_t rx_refused_ = 0;
};

}  // namespace firmware
}  // namespace r4
