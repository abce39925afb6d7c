// SPDX-License-Identifier: GPL-3.0-or-later
// A CAN bus in virtual time: each frame takes the time of its bits, and arbitration selects the
// next frame.
//
//     CanBusModel bus({.rate = {1000000, 0}, .seed = 7});
//     const int board = bus.add_node({.sent = …, .received = …});
//     bus.send(board, frame);                 // false: no room, try again after a frame was sent
//     bus.at(2'000'000, [&] { … });           // an event of the test
//     bus.run_until(1'000'000'000);
//     bus.load();                             // busy time / time
//
// The model follows ISO 11898-1:2015: arbitration by id among the frames that wait when the bus
// becomes idle (10.4.2.2), and the bits of each frame (can_bits.hpp). The model has error frames
// and retransmission (10.4.4), error counters, and error-passive nodes with 8 bits of suspended
// transmission. The model has bus-off and the return after 128 times 11 recessive bits (12.1.4).
// The model leaves out bit errors within a frame, overload frames, clock differences, and the
// propagation delay. Every error is an error of the CRC or of the acknowledgement, and all nodes
// see the error.
//
// Times are nanoseconds from 0. The same options and the same calls give the same run.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "r4link/can/can_bits.hpp"
#include "tests/simulation/random.hpp"

namespace r4::test {

struct CanBusOptions {
  CanBitRate rate{1000000, 0};
  std::uint64_t seed = 1;
  double corrupted = 0;  // probability that all nodes see a frame damaged, so that it is sent again
  double missed = 0;     // probability that one receiver loses a good frame unnoticed
};

enum class CanQueue : std::uint8_t {
  mailboxes,  // the waiting frame with the lowest id is next
  fifo,       // the oldest frame is next
};
enum class CanNodeState : std::uint8_t { active, passive, bus_off };
enum class CanBusError : std::uint8_t { damaged, not_acknowledged };

struct CanNodeOptions {
  CanQueue queue = CanQueue::mailboxes;
  std::size_t room = 3;    // number of frames that can wait
  bool silent = false;     // only receives: does not acknowledge and does not count errors
  bool comes_back = true;  // returns from bus-off without a command
  // These functions are called at the end of a frame, before its intermission. `sent`: after a
  // frame of this node, before the receivers are called. `received`: after a frame of another node.
  // `failed`: after an error frame. `changed`: after a change of state. All nodes see the error
  // frame of a damaged frame. Only the sender sees the error frame of a missing acknowledgement.
  std::function<void(const CanFrame&)> sent = {};
  std::function<void(const CanFrame&)> received = {};
  std::function<void(CanBusError)> failed = {};
  std::function<void(CanNodeState)> changed = {};
};

struct CanIdTraffic {
  std::uint64_t frames = 0;          // frames that arrived
  std::uint64_t failed = 0;          // attempts that ended in an error frame
  std::uint64_t busy_ns = 0;         // time of frames and failed attempts
  std::uint64_t max_latency_ns = 0;  // from send() to the end of the frame
};

class CanBusModel {
 public:
  explicit CanBusModel(const CanBusOptions& options) : options_(options), random_(options.seed) {}

  int add_node(CanNodeOptions options);
  // Queues a frame. False if there is no room. Frames stay queued during bus-off.
  bool send(int node, const CanFrame& frame);
  // All nodes see the next `count` frames damaged.
  void corrupt_next(unsigned count) { corrupt_next_ = count; }
  // All nodes see the frames of this node damaged, so that this node goes bus-off.
  void spoil(int node, bool spoiled) { to_node(node).spoiled = spoiled; }
  // Connects the node to the bus or disconnects it. A disconnected node does not send, receive or
  // acknowledge. A frame that is on the bus ends first.
  void set_present(int node, bool present) { to_node(node).present = present; }
  // Allows or forbids the return from bus-off without a command. If the node is bus-off, the return
  // begins when it is allowed.
  void let_come_back(int node, bool comes_back) { to_node(node).options.comes_back = comes_back; }
  void set_errors(int node, unsigned transmit_errors, unsigned receive_errors);
  // Discards the waiting frames, but not the frame on the bus.
  void clear(int node);
  // Runs `action` at the given time. Actions of the same time run in the order of the calls, before
  // the events of the bus.
  void at(std::uint64_t time_ns, std::function<void()> action) {
    actions_.emplace(time_ns < now_ns_ ? now_ns_ : time_ns, std::move(action));
  }
  // Runs all events up to and including the given time.
  void run_until(std::uint64_t time_ns);
  // The time of the next event. ~0: no event.
  std::uint64_t next_ns() const;

  std::uint64_t now_ns() const { return now_ns_; }
  std::uint32_t now_us() const { return static_cast<std::uint32_t>(now_ns_ / 1000); }  // wraps
  std::uint64_t busy_ns() const { return busy_ns_; }
  double load() const {
    return now_ns_ == 0 ? 0 : static_cast<double>(busy_ns_) / static_cast<double>(now_ns_);
  }
  const std::map<std::uint32_t, CanIdTraffic>& traffic() const { return traffic_; }
  std::size_t waiting(int node) const { return at_node(node).queue.size(); }
  CanNodeState state(int node) const { return at_node(node).state; }
  unsigned transmit_errors(int node) const { return at_node(node).transmit_errors; }  // TEC
  unsigned receive_errors(int node) const { return at_node(node).receive_errors; }    // REC

 private:
  struct Waiting {
    CanFrame frame;
    std::uint64_t since_ns;
  };
  struct Node {
    CanNodeOptions options;
    std::vector<Waiting> queue;
    CanNodeState state = CanNodeState::active;
    unsigned transmit_errors = 0;
    unsigned receive_errors = 0;
    std::uint64_t recessive_runs = 0;  // number of runs of 11 recessive bits during bus-off
    std::uint64_t suspended_until_ns = 0;
    std::size_t chosen = 0;  // index in the queue of the frame on the bus
    bool sending = false;
    bool present = true;
    bool spoiled = false;
    bool on_bus() const { return present && state != CanNodeState::bus_off; }
  };
  // The next event of the bus and its time.
  enum class Step : std::uint8_t { none, begin, end, come_back };
  struct Next {
    Step step;
    std::uint64_t time_ns;
    std::size_t node;  // for come_back
  };

  const Node& at_node(int node) const { return nodes_[static_cast<std::size_t>(node)]; }
  Node& to_node(int node) { return nodes_[static_cast<std::size_t>(node)]; }
  Next next() const;
  void begin_frame();
  void end_frame();
  void succeed();
  void fail();
  void count_error(Node& node, bool sender);
  void count_success(Node& node, bool sender);
  void update_state(Node& node);
  void come_back(Node& node);
  std::uint64_t bits_ns(std::uint64_t bits) const {
    return time_ns(CanBits{static_cast<std::uint32_t>(bits), 0}, options_.rate);
  }

  CanBusOptions options_;
  simulation::Random random_;
  std::vector<Node> nodes_;
  std::multimap<std::uint64_t, std::function<void()>> actions_;
  std::map<std::uint32_t, CanIdTraffic> traffic_;
  std::uint64_t now_ns_ = 0;
  std::uint64_t busy_ns_ = 0;
  std::uint64_t begun_ns_ = 0;            // start of the frame on the bus
  std::uint64_t frame_ends_ns_ = 0;       // end of the frame on the bus, before its intermission
  std::uint64_t free_at_ns_ = 0;          // end of the intermission
  std::uint64_t recessive_since_ns_ = 0;  // the last 11 bits of a frame are always recessive
  unsigned corrupt_next_ = 0;
  bool on_bus_ = false;
  bool damaged_ = false;
  bool acknowledged_ = false;
};

}  // namespace r4::test
