// SPDX-License-Identifier: GPL-3.0-or-later
#include "bus_plan.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <string>

#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/messages/packed_form.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4::tool {
namespace {

constexpr std::uint32_t samples = 64;  // of each kind of datagram
constexpr std::uint32_t fastest_states_hz = 1000;
constexpr std::uint32_t widest = std::numeric_limits<std::uint32_t>::max();
constexpr double second_ns = 1e9;

using Datagrams = std::vector<std::string>;

// Draws each random number in its own statement: compilers evaluate arguments in any order.
class Speaker {
 public:
  explicit Speaker(bool longest) : longest_(longest) {}

  Datagrams state(FieldSet fields) {
    State state;
    fill(state);
    constexpr std::size_t room = max_datagram - DatagramWriter::trailer_max;
    Datagrams parts;
    const std::uint32_t t_ms = any();
    DatagramWriter writer(buffer_.data(), buffer_.size());
    for (const StateField field : fields) {
      const std::size_t before = writer.size();
      write_field(writer, field, state);
      if (writer.ok() && writer.size() <= room) continue;
      writer.truncate(before);
      parts.push_back(text(writer.finish(board_pnum(), t_ms)));
      writer = DatagramWriter(buffer_.data(), buffer_.size());
      write_field(writer, field, state);
    }
    parts.push_back(text(writer.finish(board_pnum(), t_ms)));
    return parts;
  }
  Datagrams board_heartbeat() {
    const std::uint32_t t_ms = any();
    return {text(write_board_heartbeat(buffer_.data(), buffer_.size(), board_pnum(), t_ms,
                                       longest_ ? SafeReason::link : SafeReason::none))};
  }
  Datagrams host_heartbeat() {
    DatagramWriter writer(buffer_.data(), buffer_.size());
    writer.field("H").values("ROS2-R4");
    const std::uint32_t t_ms = any();
    return {text(writer.session(session_id).finish(any(), t_ms))};
  }
  Datagrams command() {
    DatagramWriter writer(buffer_.data(), buffer_.size());
    if (longest_) {
      writer.field("P").value(std::numeric_limits<std::int32_t>::min());
      writer.value(std::uint32_t{20000}).value(std::uint32_t{4});
    } else if ((servo_next_ = !servo_next_)) {
      writer.field("S").value(between(500, servo_max_us)).value(between(1, servo_channels));
    } else {
      writer.field("O").value(between(0, pwm_max)).value(between(0, 1));
      writer.value(between(1, osmc_channels));
    }
    return {text(writer.session(session_id).packet(any()).finish())};
  }

 private:
  static constexpr SessionId session_id = 0x0123456789abcdef;

  static std::string text(Text bytes) { return {bytes.data(), bytes.size()}; }

  std::uint32_t between(std::uint32_t low, std::uint32_t high) {
    return longest_ ? high : low + static_cast<std::uint32_t>(random_() % (high - low + 1));
  }
  std::uint32_t any() { return longest_ ? widest : static_cast<std::uint32_t>(random_()); }
  // A packet number after some hours; a host's numbers start at random.
  std::uint32_t board_pnum() { return longest_ ? widest : between(100000, 999999); }
  std::int32_t position(std::uint32_t range) {
    return longest_ ? std::numeric_limits<std::int32_t>::min()
                    : static_cast<std::int32_t>(between(0, 2 * range)) -
                          static_cast<std::int32_t>(range);
  }

  void fill(State& state) {
    const std::uint32_t centivolts[] = {2428, 1215, 502, 331, 166, 598};
    for (int i = 0; i < analog_channels; ++i) {
      const std::uint32_t cv = longest_ ? 3839 : between(centivolts[i] - 3, centivolts[i] + 3);
      state.raw.analog_cv[i] = static_cast<std::int32_t>(cv);
    }
    state.handle = Handle::held;
    for (Drive& drive : state.raw.dhb12) drive = any_drive();
    for (Drive& drive : state.raw.osmc) drive = any_drive();
    for (std::int32_t& steps : state.raw.stepper_steps) steps = position(20000);
    for (std::uint16_t& us : state.raw.servo_us) {
      us = static_cast<std::uint16_t>(between(500, servo_max_us));
    }
    for (std::int32_t& counts : state.raw.encoder_counts) counts = position(200000);
    for (std::int32_t& hz : state.raw.encoder_hz) hz = position(4000);
    for (std::int32_t& counts : state.raw.encoder_index_counts) counts = position(200000);
    for (std::uint16_t& cm : state.raw.ultrasonic_cm)
      cm = static_cast<std::uint16_t>(between(5, 400));
    for (Bldc& bldc : state.raw.bldc) bldc.speed = static_cast<std::uint16_t>(between(0, pwm_max));
    state.relays = static_cast<std::uint8_t>(between(0, 255));
    state.last_command = any();
    state.rx_ok = board_pnum();
    if (!longest_) return;
    state.rx_crc = state.rx_lost = state.rx_duplicate = state.rx_refused = state.late = widest;
  }
  Drive any_drive() {
    Drive drive;
    drive.pwm = static_cast<std::uint16_t>(between(0, pwm_max));
    drive.direction = static_cast<Direction>(between(0, 1));
    return drive;
  }

  std::array<char, max_datagram> buffer_;
  std::mt19937 random_{1};  // fixed seed: same results on every machine
  bool longest_;
  bool servo_next_ = false;
};

struct Kind {
  const char* name;
  std::uint32_t hz;
  bool to_board;
  Datagrams (*next)(Speaker&, const BusPlan&);
};

struct Sum {
  double datagrams = 0, bytes = 0, frames = 0, bits = 0, ns = 0;

  void add_frame(const CanFrame& frame, const BusPlan& plan, bool worst) {
    const bool switches = plan.bit_rate.data != 0;
    const CanBits counted = worst ? worst_can_bits(frame.size, frame.fd, frame.extended, switches)
                                  : can_bits(frame, switches);
    ++frames;
    bits += total(counted);
    ns += static_cast<double>(time_ns(counted, plan.bit_rate));
  }
  void add(const std::string& plain, const BusPlan& plan, const Kind& kind, std::uint32_t node,
           bool worst) {
    std::array<std::uint8_t, max_datagram> packed;
    const std::size_t size = plan.packed ? pack(Text(plain), packed.data(), packed.size()) : 0;
    const std::string path =
        size == 0 ? plain : std::string(reinterpret_cast<const char*>(packed.data()), size);
    IsotpSenderOptions options;
    options.channel.id = kind.to_board ? command_id(node) : telemetry_id(node);
    options.channel.fd = plan.bit_rate.data != 0;
    options.tx_dl = options.channel.fd ? max_fd_size : max_classic_size;
    options.flow_control = false;  // no receiver answers here
    IsotpSender sender(options);
    sender.begin(Text(path), 0);
    std::uint32_t count = 0;
    for (CanFrame frame; sender.offer(0, frame); sender.frame_sent(0), ++count) {
      add_frame(frame, plan, worst);
    }
    if (kind.to_board && count > 1) {
      CanFrame clear_to_send{};
      clear_to_send.data[0] = isotp_frame::control(IsotpFrameType::flow_control, 0);
      isotp_frame::finish(clear_to_send, options.channel, reply_id(node), 3);
      add_frame(clear_to_send, plan, worst);
    }
    ++datagrams;
    bytes += static_cast<double>(path.size());
  }
};

Sum each(const BusPlan& plan, const Kind& kind, std::uint32_t count, bool worst) {
  Speaker speaker(worst);
  Sum sum;
  for (std::uint32_t i = 0; i < count; ++i) {
    for (const std::string& plain : kind.next(speaker, plan)) {
      sum.add(plain, plan, kind, i % plan.boards, worst);
    }
  }
  for (double* const part : {&sum.datagrams, &sum.bytes, &sum.frames, &sum.bits, &sum.ns}) {
    *part /= count;
  }
  return sum;
}

BusTraffic traffic_of(const BusPlan& plan, const Kind& kind) {
  const double per_second = 1.0 * plan.boards * kind.hz;
  const Sum average = each(plan, kind, samples, false);
  const Sum worst = each(plan, kind, 1, true);
  BusTraffic traffic{kind.name};
  traffic.datagrams = per_second * average.datagrams;
  traffic.bytes = average.bytes / average.datagrams;
  traffic.frames = per_second * average.frames;
  traffic.bits = per_second * average.bits;
  traffic.load = per_second * average.ns / second_ns;
  traffic.worst_load = per_second * worst.ns / second_ns;
  return traffic;
}

}  // namespace

BusLoad load_of(const BusPlan& plan) {
  const Kind kinds[] = {
      {"state", plan.states_hz, false,
       [](Speaker& speaker, const BusPlan& of) { return speaker.state(of.fields); }},
      {"board heartbeat", board_heartbeats_hz, false,
       [](Speaker& speaker, const BusPlan&) { return speaker.board_heartbeat(); }},
      {"host heartbeat", host_heartbeats_hz, true,
       [](Speaker& speaker, const BusPlan&) { return speaker.host_heartbeat(); }},
      {"command", plan.commands_hz, true,
       [](Speaker& speaker, const BusPlan&) { return speaker.command(); }},
  };
  BusLoad load;
  double bytes = 0;
  for (const Kind& kind : kinds) {
    load.traffic.push_back(traffic_of(plan, kind));
    const BusTraffic& traffic = load.traffic.back();
    load.total.datagrams += traffic.datagrams;
    load.total.frames += traffic.frames;
    load.total.bits += traffic.bits;
    load.total.load += traffic.load;
    load.total.worst_load += traffic.worst_load;
    bytes += traffic.bytes * traffic.datagrams;
  }
  load.total.bytes = bytes / load.total.datagrams;
  return load;
}

std::uint32_t most_boards(BusPlan plan, double limit) {
  for (plan.boards = can_nodes; plan.boards != 0; --plan.boards) {
    if (load_of(plan).total.load <= limit) break;
  }
  return plan.boards;
}

std::uint32_t highest_rate(BusPlan plan, double limit) {
  plan.states_hz = 1;
  const BusLoad load = load_of(plan);
  const double per_state = load.traffic.front().load;
  const double left = limit - (load.total.load - per_state);
  const double rate = left <= 0 ? 0 : left / per_state;
  return static_cast<std::uint32_t>(std::min<double>(rate, fastest_states_hz));
}

}  // namespace r4::tool
