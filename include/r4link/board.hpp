// SPDX-License-Identifier: GPL-3.0-or-later
// r4::Board: a board, opened by URL. Thread-safe, blocking calls with deadlines, and callbacks.
//     r4::Board board("udp://192.168.0.125");
//     board.wait_active();
//     board.arm();                                     // closes relay 1, the motor supply
//     board.osmc(1).set(0.1);                          // returns when the board has confirmed it
//     board.on_state([](const r4::State& s) { … });
//     board.stop();                                    // makes every output safe at once
//
// A board with a key obeys only hosts with the same key (BoardOptions::session.key). If this object
// is destroyed or its whole process hangs, the heartbeats end and the board goes safe. If only a
// loop of the program hangs, they continue: use watchdog().
//
// Errors are thrown as r4::Error with the thing, the reason and the fix. open and permission: the
// transport cannot be opened. usage: a wrong URL or a value outside its range. refused: the board
// refuses a command or does not confirm it in time, or the Board was closed.
//
// A timeout counts from the call. A command that is not sent within its timeout is never sent,
// except a stop. If a command may have been executed, the error reports that.
//
// Callbacks run one at a time on a separate thread. A callback may call any function here and may
// wait: the heartbeats continue. If a callback does not return within BoardOptions::callback_limit,
// the heartbeats stop and the board goes safe. When the callback has returned, on_event() reports
// its run time. While a callback runs, a newer state replaces a waiting state; states() has every
// state. An exception from a callback ends the program.
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

// Callbacks that are added before the transport opens, so that they receive every event.
struct BoardCallbacks {
  std::function<void(const ReceivedState&)> on_state;
  std::function<void(const LinkStatus&)> on_link;
  std::function<void(const CarrierEvent&)> on_event;
  std::function<void(const PathStatus&)> on_path;
  std::function<void()> on_restart;
  std::function<void(DisarmCause)> on_arming;
  std::function<void(const RefusedPost&)> on_refused;
};

// How a queue handles states that arrive faster than take() removes them.
struct StatesOptions {
  // True: no state is dropped silently. When the queue overflows, take() returns the queued states
  // and then throws once. False: the oldest queued state is dropped.
  bool lossless = false;
  // Queue size in states, 900 bytes each. 0: 1 state, or 65536 if lossless (11 minutes at 100 Hz).
  std::size_t most = 0;
};

// The states of a board in order, for a loop of your own, from Board::states().
//     r4::States states = board.states({.lossless = true});
//     while (const auto state = states.take(1s)) …
//
// Movable; may outlive its board. Only one thread may call take().
class R4LINK_API States {
 public:
  using Duration = std::chrono::milliseconds;

  // Waits for the next state. Empty if no state arrives in time, or if the board was closed and the
  // queue is empty. If lossless, throws Error{data} once for each gap.
  std::optional<ReceivedState> take(Duration timeout);
  // True if the queue is empty and no more states will arrive.
  bool ended() const;
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
  // Opens a board over one to four paths: {"serial:auto", "udp://192.168.0.125"}
  // (docs/how-to/redundancy.md). '+' joins several URLs in one text. Throws Error{usage} also for a
  // duplicate URL, and for sim: and replay:, which are separate boards. If a path cannot be opened,
  // on_event() reports it, and the Board retries every second. Throws Error if no path opens.
  explicit Board(const std::vector<std::string>& urls, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  Board(std::initializer_list<std::string_view> urls, BoardOptions options = {},
        BoardCallbacks callbacks = {})
      : Board(std::vector<std::string>(urls.begin(), urls.end()), std::move(options),
              std::move(callbacks)) {}
  // Opens a board on transports of your own. Throws Error.
  explicit Board(const CarrierMaker& make, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  explicit Board(const std::vector<CarrierMaker>& makers, BoardOptions options = {},
                 BoardCallbacks callbacks = {});
  // Opens the only board that discover() finds (discovery/discover.hpp). Blocks for at most 1.3 s.
  // Throws Error{open} for no board, and Error{usage} with all URLs for several boards.
  static Board first(BoardOptions options = {}, const DiscoveryOptions& where = {});
  ~Board();
  Board(const Board&) = delete;
  Board& operator=(const Board&) = delete;

  // Stops the heartbeats, sends the farewell and closes the transport. The board goes safe at once
  // and is free for another host. A board that does not answer or does not support the farewell
  // goes safe after its timeout. Blocks for at most 100 ms, and for up to 1 s more for each
  // transport of your own. Also waits for a running callback, and for the disk if record() has
  // opened a file. Waiting calls in other threads throw Error{refused}. After the return no
  // callback runs, except a callback that called close(). Idempotent. The destructor calls close(),
  // and may run while other threads wait.
  void close();

  // The role of this program, initially BoardOptions::role.
  BoardRole role() const;
  // Changes the role to control, disarmed. wait_active() waits until the board accepts commands.
  // Callbacks, recordings and the known state are kept. If another program of this computer
  // controls the board, throws Error{refused} with its holder(), and this program stays a watcher.
  void take_control();
  // Disarms and repeats the farewell until the board answers: then the board is safe and free. The
  // program is always a watcher afterwards. Waiting calls in other threads throw Error{refused} and
  // send nothing more. Throws Error{refused} if the board does not answer in time. Without an
  // answer, a link or support for the farewell, the board goes safe after its timeout.
  void release_control(Duration timeout = default_timeout);

  // Waits until this program controls the board and no cause of the safe state lasts. A watcher
  // waits until the link is active or safe. Otherwise throws Error{refused} with the link's state.
  void wait_active(Duration timeout = Duration{3000});

  // --- commands: each returns when the board's state confirms it, or throws Error{refused}

  // Command::clear() clears the stop, watchdog or fault that the board reports, and moves nothing.
  void send(const Command& command, Duration timeout = default_timeout);
  // Output commands that the board executes in one pass over its chips, or not at all, such as all
  // wheels of a robot. If a command fails, Error::at() is its number, from 1. A board without
  // groups (no `group` in BoardIdentity::capabilities) gets one command after the other. Then the
  // commands before the failed command were executed, and the Error reports that. Until the board
  // has reported its capabilities, post() of a group returns no_link.
  void send(const Setpoints& setpoints, Duration timeout = default_timeout);
  // Sends a command from text: "O:358,1,1"; "O:358,1,1;O:358,1,2" is a group.
  void send(std::string_view text, Duration timeout = default_timeout);
  // Sends once, without confirmation, for streams of setpoints. If the command is not sent, returns
  // the reason. If 256 commands wait, the reason is queue_full. on_refused() reports commands that
  // the board refuses, or that were not sent within 100 ms. A command that switches an output off
  // may be sent later. A stop is repeated as by stop_async(). Allocates nothing.
  PostResult post(const Command& command);
  PostResult post(const Setpoints& setpoints);

  // Call arm() before the first output command (O D S R P B Z), and after every safe state except a
  // lost link. Before that, the Board refuses output commands, so that a program drives only on
  // purpose. Clears a stop, a watchdog or a fault that began while this program controlled the
  // board, then closes relay 1, the motor supply. Throws Error{refused} if the handle is released,
  // a cause cannot be cleared or a stop arrives meanwhile. Also throws Error{refused} for a cause
  // that may be older than this program, and for a fault since the board's start. Clear such a
  // cause on purpose with Command::clear(): a restarted program or board must not drive off. Not
  // needed with BoardOptions::session.arming = Arming::off.
  void arm(Duration timeout = default_timeout);
  // Why output commands are refused; none if armed.
  DisarmCause disarmed_by() const;

  // Makes every output safe at once, and repeats until the board confirms. The stop lasts until
  // Command::clear(), or arm() of the same program. Without a confirmation within the timeout, the
  // error advises to cut the power, and a new session begins, so that the outputs do not resume
  // when the link returns. The stop is repeated for SessionOptions::timing.timeout_ms more.
  void stop(Duration timeout = default_timeout);
  void stop_async();  // as stop() with default_timeout; does not wait

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
    // `pwm`: 0-4095, the board's unit.
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
    // Call calibrate() once before you drive this servo in degrees. The Board object keeps the
    // calibration, also while the link is lost. The calibration is not sent to the R4 board.
    void calibrate(const ServoCalibration& calibration) const;
    // Throws Error{usage} if the servo was not calibrated.
    ServoCalibration calibration() const;
    // set() and post() also throw Error{usage} for an angle outside the calibration's range.
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
    // `speed`: 0-4095, the board's unit.
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
  // each way. Calls return the device's answer. Without an answer, calls throw Error{refused}.
  class I2c {
   public:
    using Bytes = std::vector<std::uint8_t>;
    // Reads a register. `register_bytes`: the register's number, 1 or 2 bytes; {}: no register.
    Bytes read(int address, const Bytes& register_bytes, int count,
               Duration timeout = default_timeout) const;
    // Writes, then reads `count` bytes. Needs arm(), because the device may move something.
    Bytes write(int address, const Bytes& bytes, int count = 0,
                Duration timeout = default_timeout) const;
    // The addresses that answer, at most 32.
    Bytes scan(Duration timeout = Duration{2000}) const;
    // Sends a Command::i2c_read(), i2c_write() or i2c_scan().
    Bytes transfer(const Command& command, Duration timeout = default_timeout) const;
    // The board repeats the reading each `period`, 5-60000 ms, until the session ends. `slot`: 1-8.
    // The bytes are in State::raw.i2c; request them with fields("DEFAULT,I2C1").
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
  // identity, writes its registers and starts the board's readings. Writing needs arm(). The
  // readings last until the session ends. Adds the device's fields to fields(). Call attach() again
  // after on_restart() and after a lost link. `timeout` is for each step. Throws Error{refused} if
  // the device does not answer or is another device; finished steps are not undone. Throws
  // Error{usage} if another device has one of the slots: i2c().poll_off() frees it.
  void attach(const Device& device, Duration timeout = default_timeout);

  // One of the user's UARTs, 1 or 2 (docs/how-to/devices.md): setting("uart1", "115200:8N1") turns
  // the UART on, and fields("DEFAULT,UART1") requests its bytes. The Board joins the bytes of
  // successive states, in order and each byte once. Missing bytes are counted.
  struct UartData {
    std::vector<std::uint8_t> bytes;
    std::uint64_t lost = 0;  // number of bytes missing before or among `bytes`
  };
  class Uart {
   public:
    // 1-48 bytes. Confirmed when the board has accepted all bytes. Needs arm(): devices may move.
    void write(const std::vector<std::uint8_t>& bytes, Duration timeout = default_timeout) const;
    // The bytes since the last read(), at most 64 KB; older bytes count as lost. Waits for the
    // first byte. Empty if no byte arrives in time.
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

  // Channels are numbered from 1, as on the board. If the board lacks the channel, its use throws.
  DriveChannel osmc(int channel) { return {*this, CommandKind::osmc, channel}; }
  DriveChannel dhb12(int channel) { return {*this, CommandKind::dhb12, channel}; }
  ServoChannel servo(int channel) { return {*this, channel}; }
  RelayChannel relay(int channel) { return {*this, channel}; }
  StepperChannel stepper(int channel) { return {*this, channel}; }
  BldcChannel bldc(int channel) { return {*this, channel}; }
  // The board goes safe if the ultrasonic sensor measures less than `threshold`, 1-400 cm; 0: off.
  void proximity(Channel channel, Centimetres threshold, Duration timeout = default_timeout);
  void fields(std::string_view names, Duration timeout = default_timeout);  // "DEFAULT,ENC1"
  void setting(std::string_view key, std::string_view value, Duration timeout = default_timeout);
  // Sets the board's timeout and heartbeat interval together. A single setting may be refused,
  // because the interval must be below the timeout. Throws Error{usage} for values outside their
  // ranges, and for a timeout that is too short for the host's heartbeats (SessionOptions::timing).
  void link_timing(Duration board_timeout, Duration heartbeat, Duration timeout = default_timeout);

  BoardIdentity identify(Duration timeout = default_timeout);
  // The wiring that the board keeps (docs/reference/wiring.md). Needs the board's own cable.
  BoardWiring wiring(Duration timeout = default_timeout);
  // Checks `wiring` and sends it to the board, which uses it from its next start. Throws
  // Error{data} for a wiring with a fault. Works only over the board's own cable.
  void give_wiring(const Wiring& wiring, Duration timeout = default_timeout);
  // The newest state, with the fields of all datagrams since the board started. state().age() is
  // its age, also while the link is lost.
  ReceivedState state() const;
  // Waits for the next state. Throws Error{refused} if no state arrives in time.
  ReceivedState next_state(Duration timeout = default_timeout);
  // A queue of the states that arrive after the call: the newest state, or all.
  States states(StatesOptions options = {});
  LinkStatus link() const;
  Statistics statistics() const;
  // The counters of the transports, summed over all paths.
  CarrierCounters carrier_counters() const;
  // The transports' names for people. A name may change when a USB board is plugged in again.
  std::string name() const;
  // The state of each path, in the order of the URLs; after close(), the last state.
  std::vector<PathStatus> paths() const;

  // Any number of callbacks of each kind, in the order in which they were added. A new callback
  // first receives the newest state, link, and transport event (up or down, and a later warning).
  // A callback ends with the board, or by its handle (subscription.hpp).
  Subscription on_state(std::function<void(const ReceivedState&)> callback);
  Subscription on_link(std::function<void(const LinkStatus&)> callback);
  Subscription on_event(std::function<void(const CarrierEvent&)> callback);
  // Called when a path starts or stops carrying.
  Subscription on_path(std::function<void(const PathStatus&)> callback);
  // The board restarted, or this computer slept longer than the board's timeout. The readings of
  // i2c() and attach() end. Unless SessionOptions::fields is empty, the fields are requested again.
  // A restart sets thresholds of U to 0, and may lose settings (C). Called before the new state.
  Subscription on_restart(std::function<void()> callback);
  // Why output commands are refused; none if armed.
  Subscription on_arming(std::function<void(DisarmCause)> callback);
  // The board refused a posted command, or the command was not sent.
  Subscription on_refused(std::function<void(const RefusedPost&)> callback);

  // Records every datagram in both directions to a file (recording.hpp, docs/how-to/recordings.md),
  // or to a recording that other boards share. The recording lasts until close(), until it is
  // closed or destroyed, or until the next record(). If the disk is full, the recording ends,
  // on_event() reports that, and the link continues. Throws Error if the file cannot be written.
  void record(const std::string& path, RecordingOptions options = {});
  void record(Recording& recording);

  // If feed() is not called for `period`, the heartbeats stop and the board goes safe; 0: off.
  // Throws Error{usage} for a period below 0 or above one hour. feed() makes no system call. A
  // blocking call does not feed, because its thread does not supervise the robot while it waits. If
  // a call lasts longer than the period, only a stop is sent, and the call throws at its timeout.
  // So give the calls of the feeding thread timeouts below the period.
  void watchdog(Duration period);
  void feed();

  // For programs with an event loop (async_board.hpp, with r4link::asio only). Calls `action` with
  // the AsyncBoard on the thread of the link, and returns at once. False if the Board is closed:
  // then `action` is never called. `action` and the handlers of its operations must return at once,
  // because heartbeats wait for them. `action` and handlers must not throw, call waiting functions
  // of the Board, or open or close the AsyncBoard. close() waits for handlers.
  bool post_to_loop(std::function<void(AsyncBoard&)> action);

 private:
  struct R4LINK_PRIVATE Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace r4
