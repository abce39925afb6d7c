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
// A board with a key obeys only hosts that have it: BoardOptions::session.key. If this object is
// destroyed or its process hangs, the heartbeats stop and the board goes safe.
//
// Errors are thrown as r4::Error with the thing, the reason and the fix. open and permission: the
// transport cannot be opened. usage: a wrong URL or a value outside its range. refused: the board
// refuses a command or does not confirm it in time, or the Board was closed.
//
// A timeout counts from the call. A command that was not sent by then is never sent. If it may have
// been sent, the error says that it may have been executed. Only a stop is sent in any case.
//
// Callbacks run on a thread of their own, one at a time, beside the thread of the link. They may
// call any function here, and waiting in them delays no heartbeat. But if a callback does not
// return within BoardOptions::callback_limit, the heartbeats stop, the board goes safe, and
// on_event() reports it. Of the states that come while a callback runs, only the newest is passed
// on; states() has all of them. An exception from a callback ends the program, as from any thread.
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

// Callbacks that are added before the transport is opened, so that they miss nothing.
struct BoardCallbacks {
  std::function<void(const ReceivedState&)> on_state;
  std::function<void(const LinkStatus&)> on_link;
  std::function<void(const CarrierEvent&)> on_event;
  std::function<void(const PathStatus&)> on_path;
  std::function<void()> on_restart;
  std::function<void(DisarmCause)> on_arming;
  std::function<void(const RefusedPost&)> on_refused;
};

// How a queue treats states that come faster than they are taken.
struct StatesOptions {
  // True: no state is dropped silently. When the queue overflows, take() returns the queued states
  // and then throws once. False: the oldest queued state is dropped.
  bool lossless = false;
  // Queue size in states, 900 bytes each. 0: 1, or if lossless 65536 (11 minutes at 100 Hz).
  std::size_t most = 0;
};

// From Board::states(): the states of a board, one after the other, for a loop of your own.
//
//     r4::States states = board.states({.lossless = true});
//     while (const auto state = states.take(1s)) …
//
// Movable; may outlive its board. Only one thread may call take().
class R4LINK_API States {
 public:
  using Duration = std::chrono::milliseconds;

  // Waits for the next state. Empty if none came in time, or if the board was closed and the queue
  // is empty. If lossless, throws Error{data} once for each gap, then continues after the gap.
  std::optional<ReceivedState> take(Duration timeout);
  // True if the queue is empty and no more states will come.
  bool ended() const;
  // How many states were dropped from the queue, or found no room.
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

  // Opens the transport and starts the link; returns without waiting for the board. Throws Error.
  explicit Board(std::string_view url, BoardOptions options = {}, BoardCallbacks callbacks = {});
  // Over one to four paths to the same board: {"serial:auto", "udp://192.168.0.125"}
  // (docs/how-to/redundancy.md). In one text, '+' joins them. Throws Error{usage} also for a
  // duplicate, and for sim: and replay:, which are boards of their own. If a path cannot be opened,
  // on_event reports why, and it is tried again every second. Throws if no path can be opened.
  explicit Board(const std::vector<std::string>& urls, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  Board(std::initializer_list<std::string_view> urls, BoardOptions options = {},
        BoardCallbacks callbacks = {})
      : Board(std::vector<std::string>(urls.begin(), urls.end()), std::move(options),
              std::move(callbacks)) {}
  // On transports of your own. Throws Error.
  explicit Board(const CarrierMaker& make, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  explicit Board(const std::vector<CarrierMaker>& makers, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  // Opens the only board that discover() finds (discovery/discover.hpp). Blocks for at most 1.3 s.
  // Throws Error{open} for no board, and Error{usage} with their URLs for several.
  static Board first(BoardOptions options = {}, const DiscoveryOptions& where = {});
  ~Board();
  Board(const Board&) = delete;
  Board& operator=(const Board&) = delete;

  // Stops the heartbeats, says farewell and closes the transport. The board goes safe at once and
  // is free for another host. If it does not answer, or does not know farewells, it goes safe by
  // its timeout. Blocks for at most 100 ms; with a transport of your own, up to 1 s more for each.
  // Also waits for a running callback, and for the disk if record() has opened a file. Calls that
  // wait in other threads throw Error{refused}. After the return no callback runs, except the one
  // that called close(). Idempotent. The destructor calls it, and may run while other threads wait.
  void close();

  // The role of this program: BoardOptions::role at first.
  BoardRole role() const;
  // Controls the board, disarmed: wait_active() waits until the board takes commands of this
  // program. Callbacks, recordings and what is known of the board stay. Throws Error{refused} if
  // another program here, its holder(), controls the board: then this one stays a watcher.
  void take_control();
  // Disarms and says farewell until the board has answered, so that it is safe and free. The
  // program is always a watcher afterwards. Calls that wait in other threads throw Error{refused},
  // and send nothing more. Throws Error{refused} if the board does not answer in time. Then, and
  // also without a link or if the board knows no farewells, the board goes safe by its timeout.
  void release_control(Duration timeout = default_timeout);

  // Waits until the board is ACTIVE under our control; for a watcher, until the board is heard.
  // Otherwise throws Error{refused} with the state of the link.
  void wait_active(Duration timeout = Duration{3000});

  // --- commands: each returns when the board's state confirms it, or throws Error{refused}

  // Command::clear() clears the stop, watchdog or fault that the board reports; moves nothing.
  void send(const Command& command, Duration timeout = default_timeout);
  // Output commands that the board executes together, in one pass over its chips, or not at all,
  // such as all wheels of a robot. If one fails, the Error names it: Error::at(), from 1. If the
  // board knows no groups (no `group` in BoardIdentity::capabilities), they are sent one after the
  // other: those before the failed one were executed, and the Error says so. The board is asked for
  // this when the link comes up; until it answers, post() of a group returns no_link.
  void send(const Setpoints& setpoints, Duration timeout = default_timeout);
  // The same from text: "O:358,1,1"; "O:358,1,1;O:358,1,2" is a group.
  void send(std::string_view text, Duration timeout = default_timeout);
  // Sends once, without confirmation, and returns why it was not sent: also if 256 commands wait.
  // For streams of setpoints. on_refused() reports commands that the board refuses. A stop is
  // repeated as by stop_async(). Allocates nothing.
  PostResult post(const Command& command);
  PostResult post(const Setpoints& setpoints);

  // Call it before the first output command (O D S R P B Z), and after every safe state except a
  // lost link. Until then output commands are refused here, so that a program drives only on
  // purpose. Clears a stop, a watchdog or a fault that came while this program controlled the
  // board, then closes relay 1, the motor supply. Throws Error{refused} if the handle is released,
  // a cause cannot be cleared or a stop comes meanwhile. Throws it also if the cause may be older
  // than this program, or is a fault with which the board began: clear it on purpose with
  // Command::clear(), so that a restarted program or board does not drive off. Not needed with
  // BoardOptions::session.arming = Arming::off.
  void arm(Duration timeout = default_timeout);
  // Why output commands are refused; none if armed.
  DisarmCause disarmed_by() const;

  // Makes every output safe at once, and repeats until the board confirms. Latched until
  // Command::clear(). If it is not confirmed, the error says to cut the power.
  void stop(Duration timeout = default_timeout);
  void stop_async();  // does not wait; repeated for default_timeout

  // For each channel: set() waits as send() does; post() sends once and does not wait.
  class DriveChannel {
   public:
    // `duty`: from -1 (full reverse) to 1 (full forward). Other values throw Error{usage}. A bool,
    // which would be full speed, does not compile.
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
    // Call it once before this servo is driven in degrees. The Board keeps the calibration until it
    // is destroyed, also while the link is lost; it is not sent to the R4 board.
    void calibrate(const ServoCalibration& calibration) const;
    // Throws Error{usage} if the servo was not calibrated.
    ServoCalibration calibration() const;
    // Throw Error{usage} also for an angle outside the calibration's range.
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

  // The devices on the user's I2C bus (docs/how-to/devices.md): 7-bit addresses, at most 32 bytes
  // each way. Calls return when the device has answered. Error{refused}: no answer.
  class I2c {
   public:
    using Bytes = std::vector<std::uint8_t>;
    // Reads a register, named by one or two bytes; {}: no register is named.
    Bytes read(int address, const Bytes& register_bytes, int count,
               Duration timeout = default_timeout) const;
    // Writes, then reads `count` bytes. Needs arm(), because it may move something.
    Bytes write(int address, const Bytes& bytes, int count = 0,
                Duration timeout = default_timeout) const;
    // The addresses that answer, at most 32.
    Bytes scan(Duration timeout = Duration{2000}) const;
    // Sends a Command::i2c_read(), i2c_write() or i2c_scan().
    Bytes transfer(const Command& command, Duration timeout = default_timeout) const;
    // The board repeats the reading every 5 to 60000 ms, until our session ends, into slot 1-8:
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
  // Sets up a described device (devices/device.hpp, docs/how-to/described-devices.md): checks its
  // identity, writes its registers, which needs arm(), and starts the board's readings, until our
  // session ends. Adds their fields to those of fields(). Call it again after on_restart() and a
  // lost link. `timeout` is for each step. Throws Error{refused} if the device does not answer or
  // is another device; finished steps stay. Throws Error{usage} if a device of another address or
  // name has one of its slots: i2c().poll_off() of that slot frees it.
  void attach(const Device& device, Duration timeout = default_timeout);

  // One of the user's UARTs, 1 or 2 (docs/how-to/devices.md): setting("uart1", "115200:8N1") turns
  // it on, fields("DEFAULT,UART1") requests its bytes. They are put together here from the states:
  // in order, each byte once. Missing bytes are counted.
  struct UartData {
    std::vector<std::uint8_t> bytes;
    std::uint64_t lost = 0;  // bytes that are missing before or among these
  };
  class Uart {
   public:
    // 1 to 48 bytes; confirmed when the board has taken all. Needs arm(): it may move something.
    void write(const std::vector<std::uint8_t>& bytes, Duration timeout = default_timeout) const;
    // The bytes since the last read(), at most 64 KB: older bytes count as lost. Waits until there
    // are some; empty if none come in time.
    UartData read(Duration timeout = Duration{0}) const;
    // Calls `callback` for each state with new bytes, on the thread of the callbacks.
    Subscription on_bytes(std::function<void(const UartData&)> callback) const;

   private:
    friend class Board;
    Uart(Board& board, int channel) : board_(board), channel_(channel) {}
    Board& board_;
    int channel_;
  };
  // Throws Error{usage} for a channel other than 1 and 2.
  Uart uart(int channel);
  // Sets an output voltage, channel 1 or 2, 0-3300 mV; 0 in the safe state.
  void dac(Channel channel, Millivolts voltage, Duration timeout = default_timeout);

  // Channels count from 1, as on the board. A channel that the board lacks throws when it is used.
  DriveChannel osmc(int channel) { return {*this, CommandKind::osmc, channel}; }
  DriveChannel dhb12(int channel) { return {*this, CommandKind::dhb12, channel}; }
  ServoChannel servo(int channel) { return {*this, channel}; }
  RelayChannel relay(int channel) { return {*this, channel}; }
  StepperChannel stepper(int channel) { return {*this, channel}; }
  BldcChannel bldc(int channel) { return {*this, channel}; }
  // The board goes safe if the sensor sees something nearer than `threshold`, 1-400 cm; 0: off.
  void proximity(Channel channel, Centimetres threshold, Duration timeout = default_timeout);
  void fields(std::string_view names, Duration timeout = default_timeout);  // "DEFAULT,ENC1"
  void setting(std::string_view key, std::string_view value, Duration timeout = default_timeout);
  // Sets the board's timeout and heartbeat interval together. One alone may be refused, because the
  // interval must stay below the timeout. Throws Error{usage} for values outside their ranges, and
  // for a timeout that our heartbeats (SessionOptions::timing) cannot keep.
  void link_timing(Duration board_timeout, Duration heartbeat, Duration timeout = default_timeout);

  BoardIdentity identify(Duration timeout = default_timeout);
  // The wiring that the board keeps (docs/reference/wiring.md). Only over the board's own cable.
  BoardWiring wiring(Duration timeout = default_timeout);
  // Checks `wiring`, and gives it to the board, which uses it from its next start on. Throws
  // Error{data} for a wiring with a fault. Only over the board's own cable.
  void give_wiring(const Wiring& wiring, Duration timeout = default_timeout);
  // The newest state, fields merged over all datagrams since the board started. state().age() is
  // its age, also while the link is lost.
  ReceivedState state() const;
  // Waits for a state newer than now. Throws Error{refused} if none comes in time.
  ReceivedState next_state(Duration timeout = default_timeout);
  // A queue of the states from now on: the newest state, or all.
  States states(StatesOptions options = {});
  LinkStatus link() const;
  Statistics statistics() const;
  // The counters of the transport, summed over all paths.
  CarrierCounters carrier_counters() const;
  // The transports' names for people. One may change when a USB board is plugged in again.
  std::string name() const;
  // The state of each path, in the order of the URLs; after close(), its last state.
  std::vector<PathStatus> paths() const;

  // Any number of callbacks of each kind, called in the order of adding. Each first gets what is
  // known: the newest state, the link, the transport's newest up or down and a later warning. The
  // handle ends it (subscription.hpp); otherwise it lasts as long as the board.
  Subscription on_state(std::function<void(const ReceivedState&)> callback);
  Subscription on_link(std::function<void(const LinkStatus&)> callback);
  Subscription on_event(std::function<void(const CarrierEvent&)> callback);
  // A path has started or stopped carrying.
  Subscription on_path(std::function<void(const PathStatus&)> callback);
  // The board restarted, or this computer slept for longer than the board's timeout. The readings
  // of i2c() and attach() end. The fields are requested again, unless SessionOptions::fields is
  // empty. After a restart, the thresholds of U are 0, and settings (C) may be lost. Comes before
  // the board's new state.
  Subscription on_restart(std::function<void()> callback);
  // Armed (none), or disarmed and why.
  Subscription on_arming(std::function<void(DisarmCause)> callback);
  // A posted command was refused by the board, or not sent.
  Subscription on_refused(std::function<void(const RefusedPost&)> callback);

  // Records every datagram in both directions to a file (recording.hpp, docs/how-to/recordings.md),
  // or to a recording that other boards share. It lasts until close(), until the recording is
  // closed or destroyed, or until another one is named. If it ends by itself because the disk is
  // full, on_event() reports it, and the link continues. Throws Error if the file cannot be
  // written.
  void record(const std::string& path, RecordingOptions options = {});
  void record(Recording& recording);

  // Without feed() for `period` our heartbeats stop and the board goes safe; 0 turns it off. Throws
  // Error{usage} for a period below 0 or above one hour. feed() costs no system call. A blocking
  // call does not feed, because its thread supervises nothing while it waits. If a call outlasts
  // the period, the heartbeats stop, only a stop is sent, and the call throws at its timeout. So
  // give the calls of the feeding thread timeouts below the period.
  void watchdog(Duration period);
  void feed();

  // For programs with an event loop (async_board.hpp, with r4link::asio only). Calls `action` on
  // the thread of the link with the AsyncBoard there, and returns at once. False if the Board is
  // closed: then `action` is never called. `action` and the handlers of the operations that it
  // starts must return at once, because heartbeats wait for them. They must not throw, call
  // functions that wait here, or open or close the AsyncBoard. close() waits for handlers.
  bool post_to_loop(std::function<void(AsyncBoard&)> action);

 private:
  struct R4LINK_PRIVATE Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace r4
