// SPDX-License-Identifier: GPL-3.0-or-later
// Any datagrams, from any peer, at any time: the board does not crash, and changes no output
// without a valid command.
//
// The input is lines. Each line is a control byte and a payload. The control byte: bits 0-1 are the
// peer, and bit 2 is the port. Bit 3 adds a checksum after the payload. Bits 4-6 are the time that
// passes before the line. A payload that begins with '!' is an event on the board.
//
// Other payloads have placeholders for the values that only a host with a session has:
//   $T  the T of the newest heartbeat that the peer received
//   $S  the field of the peer's session, "SID:...;"
//   $N  the peer's next packet number; $L its last number; $P its next number as a paper host
//   $A  a valid signature of the text before it
//   $W  the newest LEASE that the peer received
//
// If the first payload is "!k", the board has a key. Then only a stop is executed without a
// signature ($A), and an unsigned heartbeat does not keep the link alive.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <set>
#include <string>

#include "firmware/application/application.hpp"
#include "protocol/datagram/crc32.hpp"
#include "protocol/datagram/numbers.hpp"
#include "protocol/keys/authentication.hpp"
#include "protocol/messages/state_fields.hpp"

namespace {

using namespace r4;
using firmware::BoardState;
using firmware::Outputs;

void require(bool holds) {
  if (!holds) std::abort();
}

bool within_ranges(const Outputs& outputs) {
  for (const Drive& drive : outputs.osmc) {
    if (drive.pwm > pwm_max || drive.direction > Direction::forward) return false;
  }
  for (const Drive& drive : outputs.dhb12) {
    if (drive.pwm > pwm_max || drive.direction > Direction::forward) return false;
  }
  for (const std::uint16_t us : outputs.servo_us) {
    if (us > servo_max_us) return false;
  }
  for (const Bldc& bldc : outputs.bldc) {
    if (bldc.speed > pwm_max || bldc.direction > Direction::forward) return false;
  }
  for (const firmware::StepperTarget& stepper : outputs.stepper) {
    if (stepper.speed < 1 || stepper.speed > stepper_speed_max) return false;
  }
  return true;
}

constexpr int ports = 2;
constexpr std::uint32_t peers = 4;

// A user's UART that receives more bytes than states can carry.
class UserUartLine final : public firmware::UserUartPort {
 public:
  void set_up(const UartMode& mode) override {
    require(!mode.on() || (mode.baud >= uart_min_baud && mode.baud <= uart_max_baud));
    require(mode.stop_bits == 1 || mode.stop_bits == 2);
  }
  std::size_t receive(std::uint8_t* out, std::size_t size) override {
    for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<std::uint8_t>(i);
    return size;
  }
  std::uint32_t take_lost() override { return 1; }
  bool send(const std::uint8_t* bytes, std::size_t size) override {
    require(size >= 1 && size <= uart_max_write);
    for (std::size_t i = 0; i < size; ++i) sum_ += bytes[i];
    waits_ = !waits_;
    return waits_;
  }
  void drop() override { waits_ = false; }

 private:
  bool waits_ = false;
  unsigned sum_ = 0;
};

// A user's I2C bus with a device at every even address. The bus can be held.
class UserBus final : public firmware::UserI2cPort {
 public:
  void begin(const firmware::UserTransfer& transfer) override {
    require(transfer.address >= i2c_first_address && transfer.address <= i2c_last_address);
    require(transfer.out_size <= i2c_max_bytes && transfer.in_size <= i2c_max_bytes);
    require(!busy_ && !released_);
    busy_ = true;
    answers_ = transfer.address % 2 == 0;
    for (std::size_t i = 0; i < transfer.out_size; ++i) sum_ += transfer.out[i];
    for (std::size_t i = 0; i < transfer.in_size; ++i)
      transfer.in[i] = static_cast<std::uint8_t>(i);
  }
  Progress progress() override {
    if (held) return Progress::busy;
    busy_ = false;
    return answers_ ? Progress::done : Progress::refused;
  }
  void release() override {
    busy_ = false;
    released_ = true;
  }
  void drive(bool, bool) override { require(released_); }
  bool scl_is_high() override { return !held; }
  bool sda_is_high() override { return !held; }
  void resume() override { released_ = false; }
  bool held = false;

 private:
  bool busy_ = false;
  bool released_ = false;
  bool answers_ = false;
  unsigned sum_ = 0;
};

// A board with its hardware, and the values that its hosts have.
class World final : public firmware::Hal, public firmware::Observer {
 public:
  explicit World(bool keyed) : keyed_(keyed) {
    firmware::Application::Config config;
    const std::uint8_t chance[Authentication::chance_size] = {1};
    config.chance = chance;
    if (keyed) config.settings.site.keys[0] = key();
    config.identity = Identity{"1", "fuzz", "none"};
    config.i2c = &i2c_;
    for (int i = 0; i < uart_channels; ++i) config.uarts[i] = &uarts_[i];
    board_ = std::make_unique<firmware::Application>(*this, config, this);
    for (int i = 0; i < ports; ++i) {
      // A peer's SID is the same on both ports, so the peer's other port is another path of the
      // session.
      for (std::uint32_t peer = 0; peer < peers; ++peer) hosts_[i][peer].sid = peer + 1;
      ports_[i].world = this;
      ports_[i].number = i;
      ports_[i].limit = i == 0 ? max_datagram : 508;
      board().add_port(ports_[i]);
    }
    board().start(now_ms_);
  }

  void line(std::uint8_t control, const std::string& payload) {
    constexpr std::uint32_t waits_ms[] = {0, 1, 9, 60, 260, 490, 999, 2500};
    pass(waits_ms[control >> 4 & 7]);
    if (!payload.empty() && payload[0] == '!') return happen(payload);
    const Source from{static_cast<std::uint8_t>(control >> 2 & 1), control & 3U};
    signed_ = !keyed_;
    std::string bytes = expand(payload, host(from));
    if ((control & 8) != 0) append_checksum(bytes);
    receive(from, bytes);
    if (executed_ != 0 && !stop_) receive_again(from, bytes);
  }

 private:
  struct Port final : firmware::Port {
    World* world = nullptr;
    int number = 0;
    std::size_t limit = max_datagram;
    void send(Text datagram, Priority, std::uint32_t peer) override {
      world->on_sent(number, datagram, peer);
    }
    std::size_t max_size() const override { return limit; }
  };
  struct Host {
    std::uint32_t board_t = 0;
    std::uint32_t number = 1000;  // for datagrams with a SID
    std::uint32_t paper_number = 0;
    SessionId sid = no_session;
    std::set<std::uint32_t> told;  // LEASE values
    std::uint32_t newest_told = 0;
    bool watches = false;  // the peer has echoed a LEASE
    std::uint32_t watches_ms = 0;
  };

  firmware::Application& board() { return *board_; }
  Host& host(Source source) { return hosts_[source.port][source.peer]; }

  void apply(const Outputs& outputs) override {
    require(within_ranges(outputs));
    outputs_ = outputs;
  }
  void make_safe() override { outputs_ = Outputs(); }
  void sample(firmware::Inputs& inputs) override { inputs = inputs_; }
  void zero(int channel) override { require(channel >= 1 && channel <= stepper_channels); }
  bool clear_fault() override { return true; }

  void on_state(std::uint32_t, BoardState, SafeReason) override {}
  void on_outputs(std::uint32_t, const Outputs& outputs) override { require(outputs == outputs_); }
  void on_executed(std::uint32_t, std::uint32_t pnum, const Command& command) override {
    require(executed_ == 0 || pnum == executed_pnum_);  // the commands of a group have one number
    ++executed_;
    executed_pnum_ = pnum;
    require(executed_ == 1 || drives_output(command.kind));
    stop_ = command.kind == CommandKind::stop;
    const bool leaves = command.kind == CommandKind::leave;
    // A new timeout may end the session, but only after the command.
    require(stop_ || board().link().has_owner() != leaves);
    require(!leaves || outputs_ == Outputs());
  }
  void on_refused(std::uint32_t, std::uint32_t, Refusal) override { ++refused_; }
  void on_rejected(std::uint32_t, Verdict) override { ++rejected_; }

  void on_sent(int port, Text bytes, std::uint32_t peer) {
    require(bytes.size() <= ports_[port].limit);
    Datagram datagram;
    require(static_cast<bool>(read_datagram(bytes, datagram)) && datagram.has_pnum() &&
            datagram.has_time());
    const MessageKind kind = kind_of(datagram);
    State state;
    if (kind == MessageKind::state) {
      require(read_state(datagram, state));
      require(peer < peers && may_get_states(port, peer));
      require(board().link().has_owner() || state.safe != SafeReason::none);
    }
    Nack nack;
    if (read_nack(datagram, nack) && nack.lease != 0) {
      hosts_[port][peer].told.insert(nack.lease);
      hosts_[port][peer].newest_told = nack.lease;
    }
    if (kind == MessageKind::board_heartbeat) {
      for (std::uint32_t p = 0; p < peers; ++p) {
        if (peer != p && peer != everyone) continue;
        hosts_[port][p].board_t = static_cast<std::uint32_t>(datagram.time_ms());
      }
    }
    ++sent_;
  }

  // States may be sent to each path of the controlling host, and to everyone on ports without its
  // paths. During a lease, states may also be sent to a watcher that has echoed its LEASE.
  bool may_get_states(int port, std::uint32_t peer) const {
    const BoardLink& link = board_->link();
    const Host& host = hosts_[port][peer];
    if (host.watches && now_ms_ - host.watches_ms < Watchers::lease_ms) return true;
    if (!link.has_owner()) return false;
    const SessionPaths& paths = board_->paths();
    if (paths.has(Source{static_cast<std::uint8_t>(port), peer})) return true;
    if (peer != everyone) return false;
    for (int i = 0; i < paths.size(); ++i) {
      if (paths[i].port == port) return false;
    }
    return true;
  }
  void on_lease(Source from, const Datagram& datagram) {
    Host& watcher = host(from);
    if (datagram.time_ms() > 0xFFFFFFFFU) return;
    if (watcher.told.count(static_cast<std::uint32_t>(datagram.time_ms())) == 0) return;
    watcher.watches = true;
    watcher.watches_ms = now_ms_;
  }

  // Advances the time. The board is polled when it is due, but at most about nine times for a line,
  // to keep fuzzing fast.
  void pass(std::uint32_t ms) {
    for (std::uint32_t left = ms; left != 0;) {
      const std::uint32_t due = std::max(board().poll(now_ms_), ms / 8);
      const std::uint32_t step = std::min(std::max(due, 1U), left);
      check();
      now_ms_ += step;
      left -= step;
    }
    require(board().poll(now_ms_) <= firmware::Application::interlock_period_ms);
    for (std::uint8_t port = 0; port < ports; ++port) board().drained(port);
    check();
  }

  void happen(const std::string& payload) {
    const int value = payload.size() > 2 ? static_cast<unsigned char>(payload[2]) : 0;
    switch (payload.size() > 1 ? payload[1] : 0) {
      case 'h':
        inputs_.handle = value % 2 == 0 ? Handle::held : Handle::released;
        break;
      case 'u':
        inputs_.ultrasonic_cm[value & 3] = static_cast<std::uint16_t>(value);
        break;
      case 'd':
        board().port_down(static_cast<std::uint8_t>(value % ports), now_ms_);
        break;
      case 'f':
        board().fail(value % 2 == 0 ? SafeReason::fault : SafeReason::watchdog, now_ms_);
        require(outputs_ == Outputs());
        break;
      case 'b':
        bus_.held = value % 2 != 0;
        break;
      case 'j':  // the loop does not run: time passes without a poll
        now_ms_ += static_cast<std::uint32_t>(value) * 20;
        return;
      default:
        break;
    }
    check();
  }

  void receive(Source from, const std::string& bytes) {
    Datagram datagram;
    const bool valid = static_cast<bool>(read_datagram(Text(bytes), datagram));
    const MessageKind kind = valid ? kind_of(datagram) : MessageKind::state;
    if (kind == MessageKind::host_heartbeat && signed_) {
      heard_any_ = true;
      heard_ms_ = now_ms_;
    }
    const Outputs before = outputs_;
    const BoardLinkState state = board().link().state();
    const int sent = sent_;
    const bool watches = valid && asks_to_watch(datagram);
    if (watches) on_lease(from, datagram);
    executed_ = refused_ = rejected_ = 0;
    stop_ = false;
    board().receive(from.port, from.peer, Text(bytes), now_ms_);
    // A damaged datagram has no effect and gets no answer.
    if (!valid) require(executed_ == 0 && sent_ == sent);
    // Outputs change only by an executed command, by a heartbeat that restores them, or to the safe
    // state.
    if (outputs_ != before && outputs_ != Outputs()) {
      require(executed_ != 0 || kind == MessageKind::host_heartbeat);
    }
    if (watches) require(executed_ == 0 && (outputs_ == before || outputs_ == Outputs()));
    require(executed_ == 0 || refused_ == 0);
    require(refused_ <= 1 && rejected_ <= (keyed_ ? 1 : 0));
    if (!signed_)
      require(board().link().state() == state || board().link().state() == BoardLinkState::lost);
    if (executed_ != 0) {
      require(valid && kind == MessageKind::command && datagram.pnum() == executed_pnum_);
      if (stop_) {
        require(outputs_ == Outputs() && board().reason() == SafeReason::stop);
      } else {
        require(signed_ && board().link().is_session_of({from, datagram.session_id()}));
        require(executed_ == datagram.command_count());  // the whole group, or no command of it
        require(executed_ <= max_group);
        require(datagram.has_pnum() && board().link().last_executed() == executed_pnum_);
      }
    }
    check();
  }

  void receive_again(Source from, const std::string& bytes) {
    const Outputs before = outputs_;
    receive(from, bytes);
    require(executed_ == 0 && (outputs_ == before || outputs_ == Outputs()));
  }

  // Checks the conditions that must always hold.
  void check() {
    if (board().state() != BoardState::active) require(outputs_ == Outputs());
    if (outputs_ == Outputs()) return;
    require(board().reason() == SafeReason::none && board().link().has_owner());
    require(heard_any_ && now_ms_ - heard_ms_ <= board().settings().timeout_ms);
  }

  std::string expand(const std::string& payload, Host& host) {
    std::string bytes;
    for (std::size_t i = 0; i < payload.size(); ++i) {
      const char name = payload[i] == '$' && i + 1 < payload.size() ? payload[i + 1] : 0;
      switch (name) {
        case 'T':
          bytes += std::to_string(host.board_t);
          break;
        case 'N':
          bytes += std::to_string(host.number++);
          break;
        case 'L':
          bytes += std::to_string(host.number - 1);
          break;
        case 'P':
          bytes += std::to_string(host.paper_number++);
          break;
        case 'S': {
          char digits[session_id_size];
          write_session_id(digits, host.sid);
          bytes += "SID:" + std::string(digits, sizeof digits) + ";";
          break;
        }
        case 'W':
          bytes += std::to_string(host.newest_told);
          break;
        case 'A':
          sign(bytes);
          break;
        default:
          bytes += payload[i];
          continue;
      }
      ++i;
    }
    return bytes;
  }

  static Key key() {
    Key key;
    key.id = 1;
    return key;
  }
  void sign(std::string& bytes) {
    const Text nonce = board().authentication().nonce();
    bytes += "A:1," + std::to_string(++counter_) + "," + std::to_string(now_ms_);
    char tag[tag_size];
    write_tag(signing_key(key()), nonce, Text(bytes), tag);
    bytes += "," + std::string(tag, tag_size);
    signed_ = true;
  }

  static void append_checksum(std::string& bytes) {
    bytes += '^';
    static constexpr char digits[] = "0123456789abcdef";
    const std::uint32_t crc = crc32(Text(bytes));
    bytes += "0x";
    for (int shift = 28; shift >= 0; shift -= 4) bytes += digits[crc >> shift & 0xF];
    bytes += '^';
  }

  const bool keyed_;
  bool signed_ = false;  // true: the line is signed, or the board needs no signature
  std::uint64_t counter_ = 0;
  std::uint32_t now_ms_ = 0xffffff00U;
  firmware::Inputs inputs_ = held();
  Outputs outputs_;
  Port ports_[ports];
  Host hosts_[ports][peers];
  UserBus bus_;
  firmware::UserI2c i2c_{bus_};
  UserUartLine lines_[uart_channels];
  firmware::UserUart uarts_[uart_channels] = {firmware::UserUart(lines_[0]),
                                              firmware::UserUart(lines_[1])};
  std::unique_ptr<firmware::Application> board_;
  int sent_ = 0;
  int executed_ = 0;
  int refused_ = 0;
  int rejected_ = 0;
  bool stop_ = false;
  std::uint32_t executed_pnum_ = 0;
  bool heard_any_ = false;
  std::uint32_t heard_ms_ = 0;

  static firmware::Inputs held() {
    firmware::Inputs inputs;
    inputs.handle = Handle::held;
    return inputs;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string input(reinterpret_cast<const char*>(data), size);
  World world(input.compare(0, 3, "0!k") == 0);
  for (std::size_t at = 0; at < size;) {
    std::size_t end = input.find('\n', at + 1);  // the control byte may itself be a line feed
    if (end == std::string::npos) end = size;
    world.line(static_cast<std::uint8_t>(input[at]), input.substr(at + 1, end - at - 1));
    at = end + 1;
  }
  return 0;
}
