// SPDX-License-Identifier: GPL-3.0-or-later
// The input of a CAN bus: any frames at any times, to the ends of a board and of a host, and to a
// listener that surveys the bus. The ends of board and host also send to each other, lose frames,
// time out and cancel. The input is a list of actions.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "r4link/can/can_survey.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "tests/fuzz/input.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4 {
namespace {

constexpr Text stop_datagram("E:STOP;^0x506f0fbe^");
constexpr Text watch_datagram("W:5;^0x414648b3^");
constexpr std::uint32_t longest_wait_us = 127000;  // STmin; N_As, N_Bs and N_Cr are less
constexpr CanLane lanes[] = {CanLane::dialogue, CanLane::telemetry};

// Appends all counters of a node, in a fixed order.
template <class Counters>
void append(std::vector<std::uint32_t>& all, const Counters& counters) {
  static_assert(sizeof(Counters) % sizeof(std::uint32_t) == 0, "counters of 32 bits alone");
  const std::size_t first = all.size();
  all.resize(first + sizeof(Counters) / sizeof(std::uint32_t));
  std::memcpy(&all[first], &counters, sizeof counters);
}
std::vector<std::uint32_t> counters_of(const CanNode& node) {
  std::vector<std::uint32_t> all;
  append(all, node.counters());
  for (const CanLane lane : lanes) {
    append(all, node.sent(lane));
    append(all, node.received(lane));
  }
  return all;
}

std::uint32_t completed(const CanNode& node) {
  return node.received(CanLane::dialogue).datagrams + node.received(CanLane::telemetry).datagrams;
}

// One end of the bus, with the conditions that hold for any input.
class End {
 public:
  End(CanEnd end, std::uint8_t node, bool fd)
      : board_(end == CanEnd::board), number_(node % can_nodes), node_(end, node, fd) {}

  void begin(Text datagram, std::uint32_t now_us) {
    const CanLane lane = node_.lane_of(datagram);
    require(board_ || lane == CanLane::dialogue);
    const bool possible = node_.idle(lane) && !datagram.empty() && datagram.size() <= max_datagram;
    require(node_.begin(datagram, now_us) == possible);
    require(!possible || !node_.idle(lane));
    check();
  }

  bool offer(std::uint32_t now_us, CanFrame& frame) {
    std::memset(&frame, 0xA5, sizeof frame);
    if (!node_.offer(now_us, frame)) return false;
    require(has_valid_size(frame) && frame.size != 0 && !frame.extended && !frame.remote);
    if (!board_) {
      require(frame.id == command_id(number_));
    } else if (frame.id == went_safe_id(number_)) {
      require(frame.size == 1 && !frame.fd && frame.data[0] != 0 &&
              frame.data[0] < safe_reason_count);
    } else {
      require(frame.id == reply_id(number_) || frame.id == telemetry_id(number_));
    }
    check();
    return true;
  }

  void frame_sent(std::uint32_t now_us) {
    node_.frame_sent(now_us);
    check();
  }

  void on_frame(const CanFrame& frame, std::uint32_t now_us) {
    const CanNodeCounters before = node_.counters();
    const std::uint32_t completed_before = completed(node_);
    const Text datagram = node_.on_frame(frame, now_us);
    require(datagram.size() <= max_datagram);
    std::uint32_t sum = 0;  // reads every byte, so that a sanitizer checks it
    for (const char c : datagram) sum += static_cast<std::uint8_t>(c);
    require(datagram.empty() || sum != 0 || datagram[0] == 0);

    const CanNodeCounters& after = node_.counters();
    const std::uint32_t whole = completed(node_) - completed_before;
    const std::uint32_t bad = after.bad_form - before.bad_form;
    require(whole <= 1 && bad <= whole && after.unpacked - before.unpacked <= whole);
    const CanIdMeaning meaning = classify(frame);
    const bool stop = meaning.kind == CanIdKind::emergency_stop;
    require(after.stops - before.stops == (stop && board_ ? 1U : 0U));
    if (stop) {
      require(whole == 0 && datagram == (board_ ? stop_datagram : Text()));
    } else if (meaning.kind == CanIdKind::watch) {
      require(whole == 0);
      require(datagram == (board_ && meaning.node == number_ ? watch_datagram : Text()));
    } else {
      require(datagram.empty() == (whole == bad));
    }
    if (meaning.kind == CanIdKind::other) require(datagram.empty());
    check();
  }

  // After poll(), the deadline is in the future, or the node has a frame to send.
  void poll(std::uint32_t now_us) {
    node_.poll(now_us);
    check();
    const IsotpDeadline deadline = node_.deadline();
    if (!deadline.armed) return;
    CanFrame frame;
    if (reached(now_us, deadline.at_us)) {
      require(offer(now_us, frame));
    } else {
      require(deadline.at_us - now_us <= longest_wait_us);
    }
  }

  void cancel() {
    node_.cancel();
    require(node_.idle(CanLane::dialogue) && node_.idle(CanLane::telemetry));
    require(!node_.deadline().armed);
    check();
  }

  void use_packed_form(bool wanted) { node_.use_packed_form(wanted); }

 private:
  void check() {
    std::vector<std::uint32_t> now = counters_of(node_);
    for (std::size_t i = 0; i < counters_.size(); ++i) require(now[i] >= counters_[i]);
    counters_ = std::move(now);
  }

  const bool board_;
  const std::uint8_t number_;
  CanNode node_;
  std::vector<std::uint32_t> counters_;
};

// Receives all frames and sends no frame.
class Listener {
 public:
  Listener() {
    survey_.on_datagram([this](std::uint8_t node, const Datagram& datagram) {
      Datagram again;
      require(node < can_nodes && read_datagram(datagram.bytes(), again));
      require(again.has_pnum() && again.has_time());
      ++datagrams_;
    });
    survey_.on_stop([this] { ++stops_; });
  }

  void on_frame(CanFrame frame, std::uint32_t now_us) {
    // The kernel passes on only frames with these identifiers and sizes.
    frame.id &= frame.extended ? 0x1FFFFFFFU : max_can_id;
    frame.size = std::min(frame.size, frame.fd ? max_fd_size : max_classic_size);
    const std::uint64_t datagrams = datagrams_;
    const std::uint64_t stops = stops_;
    const std::uint64_t busy_ns = survey_.busy_ns();
    survey_.on_frame(frame, now_us);
    ++frames_;
    const bool stop = classify(frame).kind == CanIdKind::emergency_stop;
    require(stops_ - stops == (stop ? 1U : 0U) && datagrams_ - datagrams <= (stop ? 0U : 1U));
    require(survey_.busy_ns() > busy_ns);
  }

  void check() const {
    CanTraffic sum;
    for (const auto& [id, traffic] : survey_.traffic()) {
      require(id <= CanSurvey::extended_ids && traffic.frames != 0);
      sum.frames += traffic.frames;
      sum.busy_ns += traffic.busy_ns;
    }
    require(sum.frames == frames_ && sum.busy_ns == survey_.busy_ns());
    std::uint64_t heard = 0;
    for (std::uint8_t node = 0; node < can_nodes; ++node) {
      const HeardNode& board = survey_.board(node);
      heard += board.states + board.heartbeats + board.answers;
      require(board.damaged <= frames_);
    }
    require(heard == datagrams_);
  }

 private:
  CanSurvey survey_{{1000000, 5000000}};
  std::uint64_t frames_ = 0;
  std::uint64_t datagrams_ = 0;
  std::uint64_t stops_ = 0;
};

class Fuzz {
 public:
  explicit Fuzz(Input& input) : Fuzz(input, input.byte(), input.byte()) {}

  void run() {
    now_us_ = input_.word() << 16;
    while (!input_.empty()) {
      act(input_.byte());
      board_.poll(now_us_);
      host_.poll(now_us_);
    }
    listener_.check();
  }

 private:
  Fuzz(Input& input, std::uint8_t node, std::uint8_t flags)
      : input_(input),
        node_(node % can_nodes),
        board_(CanEnd::board, node, (flags & 1) != 0),
        host_(CanEnd::host, node, (flags & 2) != 0) {}

  void act(std::uint8_t action) {
    End& end = (action & 0x80) != 0 ? board_ : host_;
    switch (action % 8) {
      case 0:
        now_us_ += input_.word();
        break;
      case 1:
        begin(end);
        break;
      case 2:
      case 3:
        take(foreign_frame());
        break;
      case 4:
      case 5:
        exchange(action);
        break;
      case 6:
        end.use_packed_form((action & 0x40) != 0);
        break;
      default:
        if ((action & 0x70) == 0) {
          end.cancel();
        } else {
          end.frame_sent(now_us_);
        }
    }
  }

  // A heartbeat, bytes that are not a datagram, an answer, or a state.
  void begin(End& end) {
    std::array<char, 256> buffer;
    const std::uint8_t kind = input_.byte();
    if (kind % 4 == 0) {
      const auto reason = static_cast<SafeReason>(kind / 4 % safe_reason_count);
      end.begin(write_board_heartbeat(buffer.data(), buffer.size(), kind, now_us_, reason),
                now_us_);
    } else if (kind % 4 == 1) {
      const std::vector<char> bytes(input_.word() % 1100, static_cast<char>(kind));
      end.begin(Text(bytes.data(), bytes.size()), now_us_);
    } else {
      DatagramWriter writer(buffer.data(), buffer.size());
      writer.field(kind % 4 == 2 ? Text("N") : Text("AIN24")).value(std::uint32_t{kind});
      end.begin(writer.finish(kind, now_us_), now_us_);
    }
  }

  CanFrame foreign_frame() {
    const std::uint32_t ids[] = {emergency_stop_id, went_safe_id(node_),   command_id(node_),
                                 reply_id(node_),   telemetry_id(node_),   watch_id(node_),
                                 reply_id(node_),   input_.word() % 0x1000};
    CanFrame frame;
    std::memset(&frame, 0x55, sizeof frame);
    const std::uint8_t flags = input_.byte();
    frame.id = ids[flags % 8];
    frame.fd = (flags & 0x08) != 0;
    frame.extended = (flags & 0xF0) == 0x10;
    frame.remote = (flags & 0xF0) == 0x20;
    frame.size = input_.byte();
    for (std::uint8_t i = 0; i < 12 && i < frame.size; ++i) frame.data[i] = input_.byte();
    return frame;
  }

  void take(const CanFrame& frame) {
    board_.on_frame(frame, now_us_);
    host_.on_frame(frame, now_us_);
    listener_.on_frame(frame, now_us_);
  }

  // Moves frames between the two ends. Some frames are lost, or are offered but not accepted.
  void exchange(std::uint8_t action) {
    CanFrame frame;
    for (int i = 0; i < 40; ++i) {
      bool moved = false;
      for (End* const from : {&board_, &host_}) {
        if (!from->offer(now_us_, frame) || (action & 0x40) != 0) continue;
        from->frame_sent(now_us_);
        End& to = from == &board_ ? host_ : board_;
        if ((action & 0x20) == 0 || i % 5 != 4) {
          to.on_frame(frame, now_us_);
          listener_.on_frame(frame, now_us_);
        }
        moved = true;
      }
      if (!moved) return;
      now_us_ += (action & 0x10) != 0 ? 1000 : 100;
    }
  }

  Input& input_;
  const std::uint8_t node_;
  End board_;
  End host_;
  Listener listener_;
  std::uint32_t now_us_ = 0;
};

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  r4::Input input(data, size);
  r4::Fuzz(input).run();
  return 0;
}
