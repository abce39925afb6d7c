// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Board: a board, opened by URL. Thread-safe, blocking calls with deadlines, and callbacks.
//
//     r4::Board board("udp://192.168.0.125");
//     board.wait_active();
//     board.arm();                                     // closes relay 1, the motor supply
//     board.osmc(1).set(0.1);                          // the board's state has confirmed it
//     board.on_state([](const r4::State& s) { … });
//     board.stop();                                    // every output safe, at once
//
// A board with a key obeys only who has it: BoardOptions options; options.session.key = key;
//
// The board goes safe by itself when this object is gone or its process hangs: the heartbeats stop.
// Errors are thrown as r4::Error with the thing, the reason and the fix: open and permission when
// the transport cannot be opened, usage for a wrong URL or a value outside its range, refused when
// the board refuses a command or does not confirm it in time, or when the Board was closed.
//
// A timeout counts from the call. What has not been sent by then is never sent; where a command may
// have been sent, the error says that it may have been executed. Only a stop goes out in any case.
//
// Callbacks run on a thread of their own, one at a time, beside the thread of the link: they may call
// anything here, and what they wait for costs no heartbeat. But a callback that does not return within
// BoardOptions::callback_limit stops the heartbeats, so that the board goes safe, and on_event() tells of
// it. States that come while a callback runs are told as one, the newest; states() has each of them. An
// exception out of a callback ends the program, as it does out of any thread.
#pragma once

#include <chrono>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "carrier.hpp"
#include "commands/servo_calibration.hpp"
#include "config.hpp"
#include "devices/device.hpp"
#include "discovery/discover.hpp"
#include "link.hpp"
#include "options.hpp"
#include "recording.hpp"
#include "setpoints.hpp"
#include "subscription.hpp"

namespace r4 {

class AsyncBoard;

// Callbacks that are there before the transport is opened, so that they are told everything.
struct BoardCallbacks {
  std::function<void(const ReceivedState&)> on_state;
  std::function<void(const LinkStatus&)> on_link;
  std::function<void(const CarrierEvent&)> on_event;
  std::function<void(const PathStatus&)> on_path;
  std::function<void()> on_restart;
  std::function<void(DisarmCause)> on_arming;
  std::function<void(const RefusedPost&)> on_refused;
};

// What becomes of states that come faster than they are taken.
struct StatesOptions {
  // None is lost: where no more can wait, take() throws behind the last one that could. Otherwise the oldest gives way.
  bool lossless = false;
  // So many wait, of some 900 bytes each. 0: the newest alone or, of those of which none is lost, 65536: eleven minutes
  // at 100 Hz.
  std::size_t most = 0;
};

// From Board::states(): the states of a board, one after the other, for a loop of the program's own.
//
//     r4::States states = board.states({.lossless = true});
//     while (const auto state = states.take(1s)) …
//
// Callbacks are told of the newest state where several have come meanwhile. Here the link's thread leaves each, one
// for each datagram, whatever callbacks do. AsyncBoard::on_state() is called for each anyway. May be moved; may
// outlive its board. One thread takes.
class R4LINK_API States {
 public:
  using Duration = std::chrono::milliseconds;

  // The next one; waits for it. Nothing if none came in time, or the board was closed and what waited has been
  // taken. Throws Error{data} where states were lost of which none should be, once for each such gap, and goes on behind
  // it.
  std::optional<ReceivedState> take(Duration timeout);
  // None will come any more, and none waits.
  bool ended() const;
  // Those that were not taken, and gave way or found no room.
  std::uint64_t missed() const;

  class R4LINK_PRIVATE Queue;

 private:
  friend class Board;
  explicit States(std::shared_ptr<Queue> queue) : queue_(std::move(queue)) {}
  std::shared_ptr<Queue> queue_;
};

class R4LINK_API Board {
 public:
  using Duration = std::chrono::milliseconds;
  static constexpr Duration default_timeout{1000};

  // Opens the transport and begins the link; returns without waiting for the board. Throws Error.
  explicit Board(std::string_view url, BoardOptions options = {}, BoardCallbacks callbacks = {});
  // Over several paths at once, up to four, all to the same board: {"serial:auto", "udp://192.168.0.125"}
  // (docs/redundancy.md); in one text, wherever that is opened as a board, '+' joins them. Throws Error{usage} also
  // for one that is there twice, and for sim: and replay:, which are boards of their own. A path that cannot be
  // opened yet is tried again every second, and on_event tells why; it throws if none can be opened.
  explicit Board(const std::vector<std::string>& urls, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  Board(std::initializer_list<std::string_view> urls, BoardOptions options = {},
        BoardCallbacks callbacks = {})
      : Board(std::vector<std::string>(urls.begin(), urls.end()), std::move(options),
              std::move(callbacks)) {}
  // On transports of your own.
  explicit Board(const CarrierMaker& make, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  explicit Board(const std::vector<CarrierMaker>& makers, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  // Opens the only board that discover() finds (discovery/discover.hpp), which takes 1.3 s at most.
  // Throws Error as Discovery::only() does: open if there is no board, usage with the URLs of
  // several.
  static Board first(BoardOptions options = {}, const DiscoveryOptions& where = {});
  ~Board();
  Board(const Board&) = delete;
  Board& operator=(const Board&) = delete;

  // Ends heartbeats, says farewell and closes the transport: the board goes safe at once and is free for
  // another host; one that does not answer, or does not know of farewells, goes safe within its timeout.
  // Takes at most 100 ms for that. Calls that wait in other threads throw Error{refused}. When it has
  // returned, no callback runs or will run, except the one that called it. Idempotent. The destructor does it,
  // too, and may run while other threads wait.
  void close();

  // What this program is to its board: BoardOptions::role at first.
  BoardRole role() const;
  // Controls the board from now on, disarmed, as if it had been opened so: wait_active() waits
  // until the board takes commands of this program. Callbacks, recordings and what is known of the
  // board stay. Throws Error{refused} if another program of this computer, its holder(), controls
  // the board: then this one watches on.
  void take_control();
  // Disarms, says farewell until the board has answered, so that it is safe and free, and watches
  // from then on. Calls that wait in other threads throw Error{refused}; nothing of them is sent
  // any more. Throws Error{refused} if the board does not answer in time. Then, as without a link,
  // and where the board knows no farewells, it goes safe by its timeout; the program watches all
  // the same.
  void release_control(Duration timeout = default_timeout);

  // Waits until the board is ACTIVE under our control, or, where the program only watches, until it is heard;
  // throws Error{refused} saying what it is instead.
  void wait_active(Duration timeout = Duration{3000});

  // --- commands: each returns when the board's own state confirms it, throws Error{refused}
  // otherwise

  // Command::clear() takes away the stop, the watchdog or the fault that the board reports; it moves
  // nothing.
  void send(const Command& command, Duration timeout = default_timeout);
  // Several output commands that the board executes together, in one pass over its chips, or not at all:
  // all wheels of a robot, say. They are confirmed as one, and the Error names the command that was
  // in the way: Error::at(), from 1. A board that knows no groups (without `group` in BoardIdentity::capabilities)
  // is sent one after the other: then those before it were executed, and the Error says so. It is asked when
  // the link comes up; until it has answered, what is posted is not sent (no_link).
  void send(const Setpoints& setpoints, Duration timeout = default_timeout);
  // The same from the text of design: "O:358,1,1"; "O:358,1,1;O:358,1,2" is a group.
  void send(std::string_view text, Duration timeout = default_timeout);
  // Sends once, without waiting or confirmation, and says why it did not: also when 256 wait to be
  // sent. For streams of setpoints where the next one replaces this one; on_refused() tells of those
  // that the board refuses. A stop is repeated as by stop_async(). Allocates nothing.
  PostResult post(const Command& command);
  PostResult post(const Setpoints& setpoints);

  // Before the first output command (O D S R P B Z), and again after whatever made the outputs safe but
  // a lost link: until then they are refused here, so that a program that goes on commanding drives off
  // only when it means to. Clears what can be cleared (a stop, a watchdog or a fault that came
  // while this program controlled the board), then closes relay 1, the motor supply. Throws
  // Error{refused} if the handle is released or something is in the way, when a stop comes
  // meanwhile, and for a stop, a watchdog or a fault that may have come before this program began:
  // Command::clear() clears that, on purpose, so that a program which is restarted does not drive
  // off again.
  // BoardOptions: options.session.arming = Arming::off does without.
  void arm(Duration timeout = default_timeout);
  // Why output commands are refused; none when armed.
  DisarmCause disarmed_by() const;

  // Every output safe, at once, repeated until the board confirms it; latched until Command::clear().
  // Where it is not confirmed, the error says to cut the power.
  void stop(Duration timeout = default_timeout);
  void stop_async();  // does not wait; repeated for default_timeout

  // Each channel: set() is send(), confirmed; post() sends once and does not wait.
  class DriveChannel {
   public:
    // `duty`: from -1 (full reverse) to 1 (full forward); others throw Error{usage}. A bool, which
    // would be full speed, does not compile.
    void set(double duty, Duration timeout = default_timeout) const;
    PostResult post(double duty) const;
    template <std::same_as<bool> Bool>
    void set(Bool, Duration = default_timeout) const = delete;
    template <std::same_as<bool> Bool>
    PostResult post(Bool) const = delete;
    // The board's own value: `pwm` 0-4095.
    void set_pwm(int pwm, Direction direction, Duration timeout = default_timeout) const;
    PostResult post_pwm(int pwm, Direction direction) const;

   private:
    friend class Board;
    Command command(Pwm pwm, Direction direction) const;
    Command command(double duty) const;
    DriveChannel(Board& board, CommandKind kind, int channel)
        : board_(board), kind_(kind), channel_(channel) {}
    Board& board_;
    CommandKind kind_;
    int channel_;
  };
  class ServoChannel {
   public:
    void set(Microseconds pulse, Duration timeout = default_timeout) const;  // 0 (off) to 2500
    PostResult post(Microseconds pulse) const;
    // Once, before this servo is driven in degrees. The Board keeps it until it is destroyed, also
    // while the link is lost; the board on the other side does not know it.
    void calibrate(const ServoCalibration& calibration) const;
    // Throws Error{usage} if the servo was not calibrated.
    ServoCalibration calibration() const;
    // Throw Error{usage} also for an angle outside of the calibration's range.
    void set(Degrees angle, Duration timeout = default_timeout) const;
    PostResult post(Degrees angle) const;

   private:
    friend class Board;
    ServoChannel(Board& board, int channel) : board_(board), channel_(channel) {}
    Board& board_;
    int channel_;
  };
  class RelayChannel {
   public:
    void set(bool on, Duration timeout = default_timeout) const;
    PostResult post(bool on) const;

   private:
    friend class Board;
    RelayChannel(Board& board, int channel) : board_(board), channel_(channel) {}
    Board& board_;
    int channel_;
  };
  class StepperChannel {
   public:
    void move_to(Steps position, StepsPerSecond speed = default_speed,
                 Duration timeout = default_timeout) const;
    PostResult post(Steps position, StepsPerSecond speed = default_speed) const;
    void zero(Duration timeout = default_timeout) const;

   private:
    friend class Board;
    static constexpr StepsPerSecond default_speed{stepper_speed_default};
    StepperChannel(Board& board, int channel) : board_(board), channel_(channel) {}
    Board& board_;
    int channel_;
  };
  class BldcChannel {
   public:
    // `duty`: as for DriveChannel.
    void set(double duty, bool brake = false, Duration timeout = default_timeout) const;
    PostResult post(double duty, bool brake = false) const;
    template <std::same_as<bool> Bool>
    void set(Bool, bool = false, Duration = default_timeout) const = delete;
    template <std::same_as<bool> Bool>
    PostResult post(Bool, bool = false) const = delete;
    // The board's own value: `speed` 0-4095.
    void set_pwm(int speed, Direction direction, bool brake = false,
                 Duration timeout = default_timeout) const;
    PostResult post_pwm(int speed, Direction direction, bool brake = false) const;

   private:
    friend class Board;
    BldcChannel(Board& board, int channel) : board_(board), channel_(channel) {}
    Board& board_;
    int channel_;
  };

  // The devices on the user's I2C bus (docs/devices.md): of 7-bit addresses, at most 32 bytes each way. read(),
  // write() and scan() return when the device has answered, and throw Error{refused} where none does.
  class I2c {
   public:
    using Bytes = std::vector<std::uint8_t>;
    // Of a register, of one or two bytes; {}: none is named.
    Bytes read(int address, const Bytes& register_bytes, int count,
               Duration timeout = default_timeout) const;
    // May move something, so that it takes arm(). Then reads `count` bytes.
    Bytes write(int address, const Bytes& bytes, int count = 0,
                Duration timeout = default_timeout) const;
    // The addresses that answer, at most 32.
    Bytes scan(Duration timeout = Duration{2000}) const;
    // The same of Command::i2c_read(), i2c_write() or i2c_scan().
    Bytes transfer(const Command& command, Duration timeout = default_timeout) const;
    // From now on, and until our session ends, the board reads every 5 to 60000 ms by itself, into slot 1-8:
    // State::i2c and fields("DEFAULT,I2C1").
    void poll(int slot, int address, const Bytes& register_bytes, int count, Duration period,
              Duration timeout = default_timeout) const;
    void poll_off(int slot, Duration timeout = default_timeout) const;

   private:
    friend class Board;
    explicit I2c(Board& board) : board_(board) {}
    Board& board_;
  };
  I2c i2c() { return I2c(*this); }
  // Sets a described device up (devices/device.hpp, docs/described-devices.md): is it the one? Then what is to be
  // written, which takes arm(), and the board's readings, until our session ends; fields() is asked for their fields
  // beside those that were chosen. Throws Error{refused} if it does not answer, or is another device; what was
  // begun stays so. After on_restart() and a lost link it is to be set up again. `timeout`: for each step. Throws
  // Error{usage} if another device, of another address or name, has one of its slots: its readings would become this
  // one's. i2c().poll_off() of that slot gives the other up.
  void attach(const Device& device, Duration timeout = default_timeout);

  // A UART of the user's, 1 or 2 (docs/devices.md): setting("uart1", "115200:8N1") turns it on,
  // fields("DEFAULT,UART1") has the board tell what comes in. That is put together here from the states: in its
  // order, each byte once, and what is missing is counted.
  struct UartData {
    std::vector<std::uint8_t> bytes;
    std::uint64_t lost = 0;  // bytes that are missing in front of these or among them
  };
  class Uart {
   public:
    // 1 to 48 bytes; confirmed when the board has taken them all. May move something, so that it takes arm().
    void write(const std::vector<std::uint8_t>& bytes, Duration timeout = default_timeout) const;
    // What has come since the last read(), at most 64 KB: older bytes count as lost. Waits until there is
    // something; nothing where it does not come in time.
    UartData read(Duration timeout = Duration{0}) const;
    // The same for each state that brings some, on the thread of the callbacks; from now on.
    Subscription on_bytes(std::function<void(const UartData&)> callback) const;

   private:
    friend class Board;
    Uart(Board& board, int channel) : board_(board), channel_(channel) {}
    Board& board_;
    int channel_;
  };
  // Throws Error{usage} where there is none.
  Uart uart(int channel);
  // A voltage of the board's, channel 1 or 2, 0-3300 mV; 0 in the safe state.
  void dac(Channel channel, Millivolts voltage, Duration timeout = default_timeout);

  // Channels count from 1, as on the board. A channel that does not exist throws when it is used.
  DriveChannel osmc(int channel) { return {*this, CommandKind::osmc, channel}; }
  DriveChannel dhb12(int channel) { return {*this, CommandKind::dhb12, channel}; }
  ServoChannel servo(int channel) { return {*this, channel}; }
  RelayChannel relay(int channel) { return {*this, channel}; }
  StepperChannel stepper(int channel) { return {*this, channel}; }
  BldcChannel bldc(int channel) { return {*this, channel}; }
  // The board goes safe when the sensor sees something nearer; 0: off.
  void proximity(Channel channel, Centimetres threshold, Duration timeout = default_timeout);
  void fields(std::string_view names, Duration timeout = default_timeout);  // "DEFAULT,ENC1"
  void setting(std::string_view key, std::string_view value, Duration timeout = default_timeout);
  // The board's timeout and heartbeat interval together, whatever they are now: one of them alone may
  // be refused, for the interval must stay below the timeout. Throws Error{usage} for what cannot be,
  // and for a timeout that our own heartbeats (SessionOptions::timing) cannot keep.
  void link_timing(Duration board_timeout, Duration heartbeat, Duration timeout = default_timeout);

  // --- what the board says

  BoardIdentity identify(Duration timeout = default_timeout);
  // The newest state, fields merged over all datagrams since the board began: state().age() tells
  // how old it is, also while the link is lost.
  ReceivedState state() const;
  // Waits for a state newer than now; throws Error{refused} when none comes in time.
  ReceivedState next_state(Duration timeout = default_timeout);
  // The states from now on, for a loop: the newest at a time, or each of them.
  States states(StatesOptions options = {});
  LinkStatus link() const;
  Statistics statistics() const;
  // What the transport has carried; of several paths all together.
  CarrierCounters carrier_counters() const;
  // The transport, for people; of several paths all of them. A USB board that is plugged in again may have another.
  std::string name() const;
  // How each of its paths does, in the order of the URLs; after close() as it was then.
  std::vector<PathStatus> paths() const;

  // Any number of callbacks of each kind, called in the order in which they were added. Each is told
  // first what there is already: the newest state, the link, the newest up or down of the transport and
  // the warning since. The handle ends it (subscription.hpp); without one it lasts as long as the board.
  Subscription on_state(std::function<void(const ReceivedState&)> callback);
  Subscription on_link(std::function<void(const LinkStatus&)> callback);
  Subscription on_event(std::function<void(const CarrierEvent&)> callback);
  // A path has begun to carry, or ceased to.
  Subscription on_path(std::function<void(const PathStatus&)> callback);
  // The board has begun again, or this computer slept for longer than the board waits for its host:
  // what it was told is gone, thresholds of U too. Comes before its new state.
  Subscription on_restart(std::function<void()> callback);
  // Armed (none), or not any more, and why.
  Subscription on_arming(std::function<void(DisarmCause)> callback);
  // A command that post() took was refused: by the board, or on its way there.
  Subscription on_refused(std::function<void(const RefusedPost&)> callback);

  // Every datagram from now on, in both directions, goes into a file, too (recording.hpp, docs/recordings.md), or
  // into a recording that other boards have as well: until close(), until that is closed or gone, or until another is
  // named. Where it ends by itself, because the disk is full, on_event() tells, and the link goes on. Throws Error if
  // the file cannot be written.
  void record(const std::string& path, RecordingOptions options = {});
  void record(Recording& recording);

  // Without feed() for `period` our heartbeats stop and the board goes safe; 0 turns it off. Throws
  // Error{usage} for less than nothing and more than an hour. feed() costs no system call.
  //
  // A blocking call does not feed: nobody looks after the robot while its thread waits. If it outlasts
  // the period, nothing of it is sent any more but a stop, the heartbeats stop with it, and it throws at
  // its timeout. So give the calls of the thread that feeds timeouts below the period.
  void watchdog(Duration period);
  void feed();

  // For programs with an event loop of their own (async_board.hpp, with r4link::asio only). Calls
  // `action` on the thread of the link with the AsyncBoard there, and returns at once. False if the
  // Board is closed: then it is never called. `action`, and the handlers of what it starts there,
  // must return at once, for heartbeats wait for them, and must not throw, nor call what waits
  // here, nor open or close the AsyncBoard. Every handler has been called when close() returns.
  bool post_to_loop(std::function<void(AsyncBoard&)> action);

 private:
  struct R4LINK_PRIVATE Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace r4
