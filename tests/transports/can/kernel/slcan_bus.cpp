// SPDX-License-Identifier: GPL-3.0-or-later
// slcan_bus: a CAN bus of 500 kbit/s as a process, exact to the bit, whose two nodes are Linux
// network interfaces.
//
// slcan_bus opens a pty for each node and prints one line:
// {"type":"ready","ptys":["/dev/pts/3","/dev/pts/4"]}. Each pty uses the slcan protocol, as the
// adapters of line discipline 17 of Linux do:
//
//     fd = os.open(pty, os.O_RDWR | os.O_NOCTTY); fcntl.ioctl(fd, termios.TIOCSETD, 17 as an int)
//     ip link set slcan0 type can bitrate 500000 && ip link set slcan0 up
//
// (or slcan_attach). The process keeps the ptys open, so the interfaces exist until the process
// ends. The kernel sends C, S and O when an interface of known bit rate comes up. The process
// refuses a wrong bit rate, and then the node stays off the bus. O resets the controller: no
// errors, an empty queue, and a return from bus-off after 128 times 11 recessive bits. The
// controller has three mailboxes, lowest id first. While the mailboxes are full, the pty is not
// read, and frames wait in the kernel.
//
// The bus (support/can_bus_model.hpp) follows the clock. If the process is delayed, it catches up:
// frames on the bus keep their correct times, whenever the process computes them.
//
// The process reports to the kernel what a hardware controller reports to its driver. The line
// s[awpb]RRRTTT follows a change of a node's state (active, warning from 96 errors, passive,
// bus-off; the counters). The line e3aaa follows a frame that was not acknowledged, and e3ccc
// follows a damaged frame, each at most every 10 ms. These lines have three letters because slcan
// ignores lines of less than five characters. The kernel turns these lines into error frames. Linux
// 6.1 switches the carrier off at bus-off. slcan switches the carrier on again only after `ip link
// set slcan0 down` and `up` (no restart-ms, no CAN_ERR_RESTARTED).
//
// Orders, one line each on stdin. The answer to each order is one line, {"type":"done"} or
// {"type":"error","reason":…}. The process ends at the end of stdin.
//
//     spoil K | heal K   damages the frames of node K: passive, then bus-off | ends the damage
//     errors K TEC REC   sets the counters of node K, and its state accordingly
//     away K | back K    disconnects node K from the bus: it does not acknowledge | reconnects it
//     stall K | go K     does not read the pty of node K, as if the controller were full | reads it
//     status             the answer has the counters of each node
//
// Changes of state are printed when they occur: {"type":"state","node":0,"state":"passive",…}.
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/support/can_bus_model.hpp"

namespace r4::test {
namespace {

constexpr std::uint32_t bitrate = 500000;
constexpr std::size_t node_count = 2;
constexpr unsigned warning_errors = 96;
constexpr std::size_t mailboxes = 3;
constexpr std::uint64_t look_every_ns = 5000000;
constexpr std::uint64_t between_error_messages_ns = 10000000;
constexpr std::array<std::uint32_t, 9> slcan_rates{10000,  20000,  50000,  100000, 125000,
                                                   250000, 500000, 800000, 1000000};

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "slcan_bus: %s: %s\n", what.c_str(), std::strerror(errno));
  std::exit(1);
}

void say(const std::string& line) {
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

std::uint64_t clock_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1000000000U +
         static_cast<std::uint64_t>(now.tv_nsec);
}

template <class Number>
bool parse(std::string_view text, Number& number, int base) {
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number, base);
  return error == std::errc() && rest == end;
}

// --- frames as slcan writes them: tIIILDD…, TIIIIIIIILDD…, r and R without data

std::optional<CanFrame> read_frame(std::string_view line) {
  CanFrame frame{};
  const char kind = line[0];
  frame.extended = kind == 'T' || kind == 'R';
  frame.remote = kind == 'r' || kind == 'R';
  const std::size_t id_digits = frame.extended ? 8 : 3;
  if (line.size() < 2 + id_digits || !parse(line.substr(1, id_digits), frame.id, 16)) return {};
  const char length = line[1 + id_digits];
  if (length < '0' || length > '8') return {};
  frame.size = static_cast<std::uint8_t>(length - '0');
  const std::string_view data = line.substr(2 + id_digits);
  if (frame.remote) return data.empty() ? std::optional(frame) : std::nullopt;
  if (data.size() != 2U * frame.size) return {};
  for (std::size_t i = 0; i < frame.size; ++i) {
    if (!parse(data.substr(2 * i, 2), frame.data[i], 16)) return {};
  }
  return frame;
}

std::string text_of(const CanFrame& frame) {
  std::string text =
      frame.extended ? fmt::format("{}{:08X}{}", frame.remote ? 'R' : 'T', frame.id, frame.size)
                     : fmt::format("{}{:03X}{}", frame.remote ? 'r' : 't', frame.id, frame.size);
  for (int i = 0; !frame.remote && i < frame.size; ++i)
    text += fmt::format("{:02X}", frame.data[i]);
  return text + '\r';
}

// --- the bus and its ptys

class Bus {
 public:
  Bus() {
    for (std::size_t i = 0; i < node_count; ++i) add_adapter(i);
  }
  [[noreturn]] void run();

 private:
  struct Adapter {
    int node = 0;
    int pty = -1;
    int kept = -1;  // the far end, kept open so that the pty always has a far end
    std::string name;
    std::string input;
    bool open = false;
    bool right_rate = true;
    bool stalled = false;
    int unread = 0;  // bytes in the pty while there was no room
    char told = 'a';
    std::array<std::uint64_t, 2> error_told_ns{};  // by kind
    std::uint64_t overruns = 0;                    // bytes for which the pty had no room
  };

  void add_adapter(std::size_t number);
  bool has_room(const Adapter& adapter) const {
    return !adapter.stalled && bus_.waiting(adapter.node) < mailboxes;
  }
  void read(Adapter& adapter);
  void read_if_closed(Adapter& adapter);
  void take_lines(Adapter& adapter);
  void take(Adapter& adapter, std::string_view line);
  void reset(Adapter& adapter);
  static void write(Adapter& adapter, const std::string& text);
  void tell_state(std::size_t number);
  void tell_error(Adapter& adapter, CanBusError error);
  bool read_orders();
  std::string obey(const std::string& order);
  std::uint64_t now_ns() const { return clock_ns() - begun_ns_; }

  CanBusModel bus_{CanBusOptions{.rate = {bitrate, 0}}};
  std::deque<Adapter> adapters_;
  std::string orders_;
  const std::uint64_t begun_ns_ = clock_ns();
};

void Bus::add_adapter(std::size_t number) {
  Adapter& adapter = adapters_.emplace_back();
  adapter.pty = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (adapter.pty < 0 || ::grantpt(adapter.pty) != 0 || ::unlockpt(adapter.pty) != 0) {
    fail("a pty");
  }
  std::array<char, 64> name{};
  if (::ptsname_r(adapter.pty, name.data(), name.size()) != 0) fail("a pty's name");
  adapter.name = name.data();
  adapter.kept = ::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios raw{};
  if (adapter.kept < 0 || ::tcgetattr(adapter.kept, &raw) != 0) fail(adapter.name);
  ::cfmakeraw(&raw);
  if (::tcsetattr(adapter.kept, TCSANOW, &raw) != 0) fail(adapter.name);

  CanNodeOptions node;
  node.room = mailboxes;
  node.comes_back = false;
  node.sent = [this, number](const CanFrame&) { tell_state(number); };
  node.received = [this, number](const CanFrame& frame) {
    tell_state(number);
    write(adapters_[number], text_of(frame));
  };
  node.failed = [this, number](CanBusError error) {
    tell_error(adapters_[number], error);
    tell_state(number);
  };
  node.changed = [this, number](CanNodeState state) {
    // After O the node may return from bus-off once. The next bus-off lasts until the next O.
    if (state == CanNodeState::active) bus_.let_come_back(adapters_[number].node, false);
    tell_state(number);
  };
  adapter.node = bus_.add_node(node);
  bus_.set_present(adapter.node, false);
}

void Bus::run() {
  std::string ptys;
  for (const Adapter& adapter : adapters_) {
    ptys += fmt::format("{}\"{}\"", ptys.empty() ? "" : ",", adapter.name);
  }
  say(fmt::format(R"({{"type":"ready","ptys":[{}]}})", ptys));
  for (;;) {
    std::vector<pollfd> waits{{STDIN_FILENO, POLLIN, 0}};
    for (const Adapter& adapter : adapters_) {
      waits.push_back({has_room(adapter) ? adapter.pty : -1, POLLIN, 0});
    }
    const std::uint64_t now = now_ns();
    const bool full = std::any_of(adapters_.begin(), adapters_.end(),
                                  [this](const Adapter& each) { return !has_room(each); });
    const std::uint64_t next_ns =
        std::min(bus_.next_ns(), full ? now + look_every_ns : ~std::uint64_t{0});
    const std::uint64_t wait_ns = next_ns > now ? next_ns - now : 0;
    const timespec wait{static_cast<time_t>(wait_ns / 1000000000U),
                        static_cast<long>(wait_ns % 1000000000U)};
    const bool for_ever = next_ns == ~std::uint64_t{0};
    if (::ppoll(waits.data(), waits.size(), for_ever ? nullptr : &wait, nullptr) < 0 &&
        errno != EINTR) {
      fail("poll");
    }
    bus_.run_until(now_ns());
    if (waits[0].revents != 0 && !read_orders()) std::exit(0);
    for (std::size_t i = 0; i < adapters_.size(); ++i) {
      if (waits[i + 1].revents != 0) read(adapters_[i]);
      if (!has_room(adapters_[i])) read_if_closed(adapters_[i]);
      take_lines(adapters_[i]);
    }
  }
}

// --- the pty of a node

void Bus::read(Adapter& adapter) {
  std::array<char, 4096> bytes;
  const ssize_t count = ::read(adapter.pty, bytes.data(), bytes.size());
  if (count > 0) adapter.input.append(bytes.data(), static_cast<std::size_t>(count));
}

// The kernel writes one frame and waits until it is read. Later bytes are a command. Frames before
// a C are not sent.
void Bus::read_if_closed(Adapter& adapter) {
  int unread = 0;
  if (::ioctl(adapter.pty, FIONREAD, &unread) != 0) return;
  const int before = std::exchange(adapter.unread, unread);
  if (before != 0 && unread > before) read(adapter);
  const std::string all = '\r' + adapter.input;
  const std::size_t close = all.rfind("\rC\r");
  if (close == std::string::npos) return;
  adapter.input.erase(0, close);
  take(adapter, "C");
  adapter.input.erase(0, 2);
}

void Bus::take_lines(Adapter& adapter) {
  std::size_t end = 0;
  while (has_room(adapter) && (end = adapter.input.find('\r')) != std::string::npos) {
    const std::string line = adapter.input.substr(0, end);
    adapter.input.erase(0, end + 1);
    if (!line.empty()) take(adapter, line);
  }
}

void Bus::take(Adapter& adapter, std::string_view line) {
  const std::string ok = "\r";
  const std::string error = "\a";
  switch (line[0]) {
    case 't':
    case 'T':
    case 'r':
    case 'R': {
      const std::optional<CanFrame> frame = read_frame(line);
      const bool taken = frame && adapter.open && bus_.send(adapter.node, *frame);
      return write(adapter, taken ? (frame->extended ? "Z\r" : "z\r") : error);
    }
    case 'S': {
      const std::size_t rate = line.size() == 2 ? static_cast<std::size_t>(line[1] - '0') : 9;
      adapter.right_rate = rate < slcan_rates.size() && slcan_rates[rate] == bitrate;
      return write(adapter, adapter.right_rate && !adapter.open ? ok : error);
    }
    case 'O':
      if (!adapter.right_rate) return write(adapter, error);
      reset(adapter);
      return write(adapter, ok);
    case 'C':
      adapter.open = false;
      bus_.clear(adapter.node);
      bus_.set_present(adapter.node, false);
      return write(adapter, ok);
    default:
      return write(adapter, error);
  }
}

// The kernel treats an interface that comes up as error-active.
void Bus::reset(Adapter& adapter) {
  adapter.open = true;
  adapter.told = 'a';
  bus_.clear(adapter.node);
  bus_.set_present(adapter.node, true);
  if (bus_.state(adapter.node) == CanNodeState::bus_off) {
    bus_.let_come_back(adapter.node, true);
  } else {
    bus_.set_errors(adapter.node, 0, 0);
  }
}

void Bus::write(Adapter& adapter, const std::string& text) {
  const ssize_t count = ::write(adapter.pty, text.data(), text.size());
  if (count != static_cast<ssize_t>(text.size())) {
    adapter.overruns += text.size() - static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  }
}

void Bus::tell_state(std::size_t number) {
  Adapter& adapter = adapters_[number];
  const unsigned sent = bus_.transmit_errors(adapter.node);
  const unsigned received = bus_.receive_errors(adapter.node);
  const CanNodeState state = bus_.state(adapter.node);
  const char letter = state == CanNodeState::bus_off               ? 'b'
                      : state == CanNodeState::passive             ? 'p'
                      : std::max(sent, received) >= warning_errors ? 'w'
                                                                   : 'a';
  if (letter == adapter.told) return;
  adapter.told = letter;
  write(adapter, fmt::format("s{}{:03d}{:03d}\r", letter, received, sent));
  const char* const name = letter == 'b'   ? "bus-off"
                           : letter == 'p' ? "passive"
                           : letter == 'w' ? "warning"
                                           : "active";
  say(fmt::format(R"({{"type":"state","node":{},"state":"{}","tec":{},"rec":{},"t_us":{}}})",
                  number, name, sent, received, bus_.now_ns() / 1000));
}

void Bus::tell_error(Adapter& adapter, CanBusError error) {
  const bool damaged = error == CanBusError::damaged;
  std::uint64_t& told_ns = adapter.error_told_ns[damaged ? 1 : 0];
  if (told_ns != 0 && bus_.now_ns() - told_ns < between_error_messages_ns) return;
  told_ns = bus_.now_ns();
  write(adapter, damaged ? "e3ccc\r" : "e3aaa\r");
}

// --- orders

bool Bus::read_orders() {
  std::array<char, 4096> bytes;
  const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (count <= 0) return false;
  orders_.append(bytes.data(), static_cast<std::size_t>(count));
  std::size_t end = 0;
  while ((end = orders_.find('\n')) != std::string::npos) {
    say(obey(orders_.substr(0, end)));
    orders_.erase(0, end + 1);
  }
  return true;
}

std::string Bus::obey(const std::string& order) {
  std::istringstream words(order);
  std::string verb;
  words >> verb;
  const auto error = [&](const char* reason) {
    return fmt::format(R"({{"type":"error","order":"{}","reason":"{}"}})", verb, reason);
  };
  const std::string done = R"({"type":"done"})";
  if (verb == "status") {
    std::string nodes;
    for (const Adapter& adapter : adapters_) {
      nodes += fmt::format(R"({}{{"state":"{}","tec":{},"rec":{},"waiting":{},"overruns":{}}})",
                           nodes.empty() ? "" : ",", adapter.told,
                           bus_.transmit_errors(adapter.node), bus_.receive_errors(adapter.node),
                           bus_.waiting(adapter.node), adapter.overruns);
    }
    std::uint64_t frames = 0;
    std::uint64_t failed = 0;
    for (const auto& [id, traffic] : bus_.traffic()) {
      frames += traffic.frames;
      failed += traffic.failed;
    }
    return fmt::format(
        R"({{"type":"status","t_us":{},"busy_us":{},"frames":{},"failed":{},"nodes":[{}]}})",
        bus_.now_ns() / 1000, bus_.busy_ns() / 1000, frames, failed, nodes);
  }
  std::size_t number = 0;
  if (!(words >> number) || number >= adapters_.size())
    return error("unknown order, or no such node");
  Adapter& adapter = adapters_[number];
  if (verb == "spoil" || verb == "heal") {
    bus_.spoil(adapter.node, verb == "spoil");
  } else if (verb == "errors") {
    unsigned sent = 0;
    unsigned received = 0;
    if (!(words >> sent >> received)) return error("how many?");
    bus_.set_errors(adapter.node, sent, received);
    tell_state(number);
  } else if (verb == "away" || verb == "back") {
    bus_.set_present(adapter.node, verb == "back" && adapter.open);
  } else if (verb == "stall" || verb == "go") {
    adapter.stalled = verb == "stall";
  } else {
    return error("unknown order");
  }
  return done;
}

}  // namespace
}  // namespace r4::test

int main() { r4::test::Bus().run(); }
