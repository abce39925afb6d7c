// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/can_backbone.hpp"

#include <algorithm>
#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/packed_form.hpp"
#include "transports/framing/can/isotp_receiver.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace r4::test {
namespace {

using simulation::Random;

constexpr std::uint64_t us_ns = 1000;
constexpr std::uint64_t second_ns = 1000000000;
constexpr std::uint64_t poll_every_ns = 1000000;
constexpr std::uint64_t drain_ns = 200000000;  // for datagrams under way at the end

struct Message {
  std::string plain;
  std::uint64_t due_ns = 0;
  bool state = false;      // a newer state replaces a waiting state
  bool heartbeat = false;  // a heartbeat of the host
};

// Writes the next datagrams of a board and its host, with numbers as some hours after the start.
class Voice {
 public:
  explicit Voice(std::uint64_t seed) : random_(seed) {
    board_t_ = static_cast<std::uint32_t>(random_.next());
    board_pnum_ = static_cast<std::uint32_t>(random_.between(100000, 999999));
    host_pnum_ = static_cast<std::uint32_t>(random_.next());
    session_ = random_.next();
  }

  std::string state(FieldSet fields, std::uint64_t now_ns) {
    State state;
    const std::int32_t volts[] = {2428, 1215, 502, 331, 166, 598};
    for (int i = 0; i < analog_channels; ++i) {
      state.raw.analog_cv[i] = volts[i] + static_cast<std::int32_t>(random_.below(7)) - 3;
    }
    state.handle = Handle::held;
    for (Drive& drive : state.raw.dhb12) drive = any_drive();
    for (Drive& drive : state.raw.osmc) drive = any_drive();
    for (std::int32_t& steps : state.raw.stepper_steps) steps = moving(20000);
    for (std::uint16_t& us : state.raw.servo_us) {
      us = static_cast<std::uint16_t>(random_.between(500, 2500));
    }
    for (std::int32_t& count : state.raw.encoder_counts) count = moving(200000);
    for (std::int32_t& hz : state.raw.encoder_hz) hz = moving(4000);
    for (std::int32_t& count : state.raw.encoder_index_counts) count = moving(200000);
    for (std::uint16_t& cm : state.raw.ultrasonic_cm) {
      cm = static_cast<std::uint16_t>(random_.between(5, 400));
    }
    state.last_command = host_pnum_;
    state.rx_ok = board_pnum_;
    DatagramWriter writer(buffer_.data(), buffer_.size());
    for (const StateField field : fields) write_field(writer, field, state);
    return text(writer.finish(board_pnum_++, board_time(now_ns)));
  }
  std::string board_heartbeat(std::uint64_t now_ns) {
    return text(write_board_heartbeat(buffer_.data(), buffer_.size(), board_pnum_++,
                                      board_time(now_ns), SafeReason::none));
  }
  std::string host_heartbeat(std::uint64_t now_ns) {
    DatagramWriter writer(buffer_.data(), buffer_.size());
    writer.field("H").values("ROS2-R4");
    return text(writer.session(session_).finish(host_pnum_++, board_time(now_ns)));
  }
  std::string command() {
    DatagramWriter writer(buffer_.data(), buffer_.size());
    if (random_.chance(0.5)) {
      const Drive drive = any_drive();
      writer.field("O").value(std::uint32_t{drive.pwm});
      writer.value(static_cast<std::uint32_t>(drive.direction)).value(channel(4));
    } else {
      const std::uint32_t us = static_cast<std::uint32_t>(random_.between(500, 2500));
      writer.field("S").value(us).value(channel(16));
    }
    return text(writer.session(session_).packet(host_pnum_++).finish());
  }

 private:
  static std::string text(Text bytes) { return {bytes.data(), bytes.size()}; }
  std::uint32_t channel(std::uint32_t of) {
    return static_cast<std::uint32_t>(random_.between(1, of));
  }
  Drive any_drive() {
    Drive drive;
    drive.pwm = static_cast<std::uint16_t>(random_.below(4096));
    drive.direction = static_cast<decltype(drive.direction)>(random_.below(2));
    return drive;
  }
  std::int32_t moving(std::int32_t range) {
    return static_cast<std::int32_t>(random_.below(2 * static_cast<std::uint64_t>(range))) - range;
  }
  std::uint32_t board_time(std::uint64_t now_ns) const {
    return board_t_ + static_cast<std::uint32_t>(now_ns / 1000000);
  }

  Random random_;
  std::array<char, max_datagram> buffer_;
  std::uint32_t board_t_;
  std::uint32_t board_pnum_;
  std::uint32_t host_pnum_;
  SessionId session_;
};

// One direction of the link of a board: datagrams in, datagrams out. A controller holds at most one
// frame of a stream at any time.
class Stream {
 public:
  Stream(CanBusModel& bus, const BackboneOptions& options, int from, int to,
         const IsotpSenderOptions& sender, const IsotpReceiverOptions& receiver, Flow& flow)
      : bus_(bus),
        options_(options),
        from_(from),
        to_(to),
        channel_(sender.channel),
        sender_(sender),
        receiver_(receiver, buffer_.data(), static_cast<std::uint32_t>(buffer_.size())),
        flow_(flow) {}

  void say(Message message) {
    ++flow_.sent;
    if (message.state) {
      const auto older = std::find_if(waiting_.begin(), waiting_.end(),
                                      [](const Message& each) { return each.state; });
      if (older != waiting_.end()) {
        ++flow_.replaced;
        *older = std::move(message);
        return;
      }
    }
    waiting_.push_back(std::move(message));
    pump();
  }
  void sent(int node, const CanFrame& frame) {
    if (node == from_ && frame.id == channel_.id) {
      sender_in_controller_ = false;
      sender_.frame_sent(bus_.now_us());
      bus_.at(bus_.now_ns(), [this] { pump(); });
    } else if (node == to_ && frame.id == channel_.flow_control_id) {
      receiver_in_controller_ = false;
      receiver_.frame_sent(bus_.now_us());
    }
  }
  void received(int node, const CanFrame& frame) {
    if (node == to_ && receiver_.on_frame(frame, bus_.now_us()).datagram) arrived();
    if (node == from_) sender_.on_frame(frame, bus_.now_us());
    bus_.at(bus_.now_ns() + options_.reaction_us * us_ns, [this] { pump(); });
  }
  void pump() {
    const std::uint32_t now_us = bus_.now_us();
    sender_.poll(now_us);
    receiver_.poll(now_us);
    if (!sender_.busy() && !waiting_.empty()) begin();
    CanFrame frame;
    if (!sender_in_controller_ && sender_.offer(now_us, frame)) {
      sender_in_controller_ = bus_.send(from_, frame);
    }
    if (!receiver_in_controller_ && receiver_.offer(now_us, frame)) {
      receiver_in_controller_ = bus_.send(to_, frame);
    }
  }
  std::uint32_t errors() const {
    const IsotpSenderCounters& s = sender_.counters();
    const IsotpReceiverCounters& r = receiver_.counters();
    return s.send_timeout + s.flow_control_timeout + r.send_timeout + r.consecutive_timeout +
           r.wrong_sequence_number + r.interrupted + r.unexpected_frame + r.malformed;
  }
  std::uint32_t max_silence_us() const { return max_silence_us_; }

 private:
  void begin() {
    Message message = std::move(waiting_.front());
    waiting_.pop_front();
    std::array<std::uint8_t, max_datagram> packed;
    const std::size_t size =
        options_.packed ? pack(Text(message.plain), packed.data(), packed.size()) : 0;
    path_ =
        size == 0 ? message.plain : std::string(reinterpret_cast<const char*>(packed.data()), size);
    flow_.bytes += static_cast<std::uint32_t>(path_.size());
    under_way_.push_back(std::move(message));
    sender_.begin(Text(path_), bus_.now_us());
  }
  void arrived() {
    std::array<char, max_datagram> unpacked;
    Text bytes = receiver_.text();
    if (is_packed(static_cast<std::uint8_t>(bytes[0]))) {
      bytes =
          Text(unpacked.data(),
               unpack(receiver_.data(), receiver_.size(), unpacked.data(), unpacked.size()).size);
    }
    while (!under_way_.empty() && Text(under_way_.front().plain) != bytes) under_way_.pop_front();
    if (under_way_.empty()) return;
    const Message message = std::move(under_way_.front());
    under_way_.pop_front();
    ++flow_.delivered;
    flow_.max_late_us = std::max(flow_.max_late_us, since_us(message.due_ns));
    if (message.heartbeat) {
      max_silence_us_ = std::max(max_silence_us_, since_us(heartbeat_ns_));
      heartbeat_ns_ = bus_.now_ns();
    }
  }
  std::uint32_t since_us(std::uint64_t then_ns) const {
    return static_cast<std::uint32_t>((bus_.now_ns() - then_ns) / us_ns);
  }

  CanBusModel& bus_;
  const BackboneOptions& options_;
  int from_;
  int to_;
  IsotpChannel channel_;
  std::array<std::uint8_t, max_datagram> buffer_{};
  IsotpSender sender_;
  IsotpReceiver receiver_;
  Flow& flow_;
  std::deque<Message> waiting_;
  std::deque<Message> under_way_;
  std::string path_;
  bool sender_in_controller_ = false;
  bool receiver_in_controller_ = false;
  std::uint64_t heartbeat_ns_ = 0;
  std::uint32_t max_silence_us_ = 0;
};

class Backbone {
 public:
  explicit Backbone(const BackboneOptions& options)
      : options_(options), bus_(options.bus), random_(options.bus.seed ^ 0x5a5a5a5aU) {
    host_ = add_node(1000, CanQueue::fifo);
    for (int board = 0; board < options_.boards; ++board) {
      add_board(static_cast<std::uint32_t>(board), add_node(3, CanQueue::mailboxes));
    }
    bus_.at(poll_every_ns, [this] { poll(); });
  }

  BackboneResult run() {
    const std::uint64_t duration_ns = options_.seconds * second_ns;
    bus_.run_until(duration_ns);
    result_.load = bus_.load();
    std::uint64_t frames = 0;
    for (const auto& [id, traffic] : bus_.traffic()) frames += traffic.frames;
    result_.frames_per_second = static_cast<double>(frames) / options_.seconds;
    bus_.run_until(duration_ns + drain_ns);
    for (const auto& stream : streams_) {
      result_.isotp_errors += stream->errors();
      result_.max_silence_us = std::max(result_.max_silence_us, stream->max_silence_us());
    }
    return result_;
  }

 private:
  int add_node(std::size_t room, CanQueue queue) {
    const int node = static_cast<int>(nodes_++);
    CanNodeOptions options;
    options.room = room;
    options.queue = queue;
    options.sent = [this, node](const CanFrame& frame) {
      for (Stream* const stream : heard_by(node, frame)) stream->sent(node, frame);
    };
    options.received = [this, node](const CanFrame& frame) {
      for (Stream* const stream : heard_by(node, frame)) stream->received(node, frame);
    };
    return bus_.add_node(std::move(options));
  }
  // The streams to which a frame belongs, at the given node.
  std::vector<Stream*> heard_by(int node, const CanFrame& frame) {
    const CanIdMeaning meaning = classify(frame);
    const int board = meaning.node;
    if (node != host_ && node != 1 + board) return {};
    const std::size_t first = 2 * static_cast<std::size_t>(board);
    if (meaning.kind == CanIdKind::telemetry) return {streams_[first].get()};
    return {streams_[first + 1].get()};
  }

  void add_board(std::uint32_t node, int board) {
    IsotpSenderOptions sender;
    IsotpReceiverOptions receiver;
    sender.tx_dl = options_.tx_dl;
    sender.channel.fd = options_.tx_dl > max_classic_size;
    sender.channel.id = telemetry_id(node);
    sender.flow_control = false;
    receiver.channel = sender.channel;
    receiver.listen_only = true;
    streams_.push_back(std::make_unique<Stream>(bus_, options_, board, host_, sender, receiver,
                                                result_.telemetry));
    Stream* const telemetry = streams_.back().get();

    sender.channel.id = command_id(node);
    sender.channel.flow_control_id = reply_id(node);
    sender.flow_control = true;
    receiver.channel = sender.channel;
    receiver.listen_only = false;
    streams_.push_back(
        std::make_unique<Stream>(bus_, options_, host_, board, sender, receiver, result_.commands));
    Stream* const commands = streams_.back().get();

    voices_.push_back(std::make_unique<Voice>(random_.next()));
    Voice* const voice = voices_.back().get();
    every(options_.states_hz, [=, this](std::uint64_t now_ns) {
      telemetry->say({voice->state(options_.fields, now_ns), now_ns, true, false});
    });
    every(options_.board_heartbeats_hz, [=](std::uint64_t now_ns) {
      telemetry->say({voice->board_heartbeat(now_ns), now_ns, false, false});
    });
    every(options_.host_heartbeats_hz, [=](std::uint64_t now_ns) {
      commands->say({voice->host_heartbeat(now_ns), now_ns, false, true});
    });
    every(options_.commands_hz, [=](std::uint64_t now_ns) {
      commands->say({voice->command(), now_ns, false, false});
    });
  }

  // Runs `action` to the end of the run, from a random phase. If all streams are in step, the phase
  // is 0.
  void every(std::uint32_t hz, std::function<void(std::uint64_t)> action) {
    if (hz == 0) return;
    const std::uint64_t period_ns = second_ns / hz;
    const std::uint64_t first_ns = options_.in_step ? 0 : random_.below(period_ns);
    again(first_ns, period_ns, std::make_shared<std::function<void(std::uint64_t)>>(action));
  }
  void again(std::uint64_t time_ns, std::uint64_t period_ns,
             const std::shared_ptr<std::function<void(std::uint64_t)>>& action) {
    if (time_ns >= options_.seconds * second_ns) return;
    bus_.at(time_ns, [this, time_ns, period_ns, action] {
      (*action)(time_ns);
      again(time_ns + period_ns, period_ns, action);
    });
  }
  void poll() {
    for (const auto& stream : streams_) stream->pump();
    bus_.at(bus_.now_ns() + poll_every_ns, [this] { poll(); });
  }

  const BackboneOptions& options_;
  CanBusModel bus_;
  Random random_;
  BackboneResult result_;
  std::vector<std::unique_ptr<Stream>> streams_;  // for each board: telemetry, then commands
  std::vector<std::unique_ptr<Voice>> voices_;
  std::size_t nodes_ = 0;
  int host_ = 0;
};

}  // namespace

BackboneResult run_backbone(const BackboneOptions& options) { return Backbone(options).run(); }

}  // namespace r4::test
