// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_carrier.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "../../protocol/messages/command_field.hpp"
#include "../board_end.hpp"
#include "../framing/can/can_node.hpp"
#include "../operation_slot.hpp"
#include "../send_queue.hpp"
#include "can_bus.hpp"
#include "can_trouble.hpp"
#include "can_turn.hpp"
#include "overheard_lane.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/command.hpp"

namespace r4 {
namespace {

constexpr std::size_t normal_entries = 32;
constexpr std::size_t state_entries = 1;
constexpr std::uint32_t look_again_us = 20000;

// More than 15 data members: four belong to the timer.
class CanCarrier final : public Carrier, public BoardEnd, private CanBus::Member {
 public:
  CanCarrier(asio::io_context& io, CanCarrierOptions options,
             std::function<std::shared_ptr<CanBus>()> open_bus);
  ~CanCarrier() override { close(); }

  void open(Handler& handler) override;
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer) override;
  void use_packed_form(bool wanted) override { node_.use_packed_form(wanted); }
  bool up() const override { return handler_ != nullptr && bus_->up(); }
  TransportTrouble trouble() const override;
  bool is_shared() const override { return true; }
  const std::string& name() const override { return is_.name; }
  const CarrierCounters& counters() const override;

 private:
  using Clock = CanBus::Clock;
  struct Lane {
    CanLane which;
    SendQueue queue;
  };

  void on_frame(const CanFrame& frame, std::uint32_t at_us) override;
  void on_drained() override { handler_->on_drained(); }
  bool awaits_frame() const override { return node_.awaits_frame(); }
  void on_sent() override { arm(); }
  bool offer(std::uint32_t now_us, CanFrame& frame) override;
  bool offer_urgent(std::uint32_t now_us, CanFrame& frame) override {
    return node_.offer_urgent(now_us, frame);
  }
  void frame_sent(std::uint32_t now_us) override { node_.frame_sent(now_us); }
  void on_late_frame(const CanFrame& frame, std::uint32_t now_us) override {
    if (node_.may_be_answered(frame)) node_.wait_anew(now_us);
  }
  void on_bus(const CarrierEvent& event) override;
  void on_stuck() override;

  Lane& lane(CanLane which) { return lanes_[which == CanLane::dialogue ? 0 : 1]; }
  SendResult send_stop(std::string_view bytes);
  SendResult send_lease();
  bool begin(std::string_view bytes, std::uint32_t now_us);
  bool begin_waiting(std::uint32_t now_us);
  void listen_for_others(const CanFrame& frame);
  void count_late_transfers();
  void arm();
  void on_deadline();

  const CanCarrierOptions is_;
  const std::function<std::shared_ptr<CanBus>()> open_bus_;
  CanNode node_;
  CanTurn turn_{std::random_device{}()};  // for a host
  OverheardLane others_;                  // commands of other hosts to the same board
  mutable CarrierCounters counters_;      // counters() adds the counts of node_ and bus_
  std::array<Lane, 2> lanes_;
  std::shared_ptr<CanBus> bus_;
  StopNumbers stops_;   // for a host
  CanTrouble trouble_;  // for a host
  Handler* handler_ = nullptr;
  LoopTimer timer_;
  OperationSlot timing_;
  bool armed_ = false;
  std::uint32_t armed_for_us_ = 0;
};

std::uint8_t node_of(const Url& url, Role role) {
  url.allow_only(role == Role::host ? "node fd pack" : "node fd");
  can_interface_of(url);
  return static_cast<std::uint8_t>(url.get_number("node", 0, can_nodes - 1, 1));
}

CanCarrier::CanCarrier(asio::io_context& io, CanCarrierOptions options,
                       std::function<std::shared_ptr<CanBus>()> open_bus)
    : is_(std::move(options)),
      open_bus_(std::move(open_bus)),
      node_(is_.role == Role::board ? CanEnd::board : CanEnd::host, is_.node, is_.fd),
      others_(CanIdKind::command, is_.node),
      lanes_{
          Lane{CanLane::dialogue, SendQueue(normal_entries, state_entries, counters_.tx_dropped)},
          Lane{CanLane::telemetry, SendQueue(normal_entries, state_entries, counters_.tx_dropped)}},
      timer_(io) {
  node_.use_packed_form(is_.role == Role::host && is_.packs);
}

TransferCounters transfers_of(const CanNode& node) {
  TransferCounters sum;
  for (const CanLane lane : {CanLane::dialogue, CanLane::telemetry}) {
    const IsotpSenderCounters& out = node.sent(lane);
    const IsotpReceiverCounters& in = node.received(lane);
    sum.wrong_sequence += in.wrong_sequence_number;
    sum.timed_out += in.consecutive_timeout + in.send_timeout + in.too_many_waits +
                     out.flow_control_timeout + out.send_timeout + out.too_many_waits;
    sum.overflow += in.overflow + out.overflow;
    sum.interrupted += in.interrupted;
    sum.cancelled += in.cancelled + out.cancelled;
    sum.unexpected += in.unexpected_frame + out.unexpected_frame;
    sum.malformed += in.malformed + out.malformed + out.invalid_flow_status;
  }
  sum.packed = node.counters().unpacked;
  sum.bad_form = node.counters().bad_form;
  return sum;
}

void CanCarrier::open(Handler& handler) {
  close();
  const std::shared_ptr<CanBus> bus = open_bus_();
  bus_ = bus;
  handler_ = &handler;
  bus->join(*this, is_.role == Role::board
                       ? std::vector<std::uint32_t>{emergency_stop_id, command_id(is_.node),
                                                    watch_id(is_.node)}
                       : std::vector<std::uint32_t>{reply_id(is_.node), telemetry_id(is_.node),
                                                    command_id(is_.node)});
  if (bus->up()) on_bus({CarrierEvent::Kind::up, Problem{ErrorKind::open, is_.name, "", ""}});
  const std::optional<CarrierEvent> standing = bus->standing();
  if (standing && bus_ == bus) on_bus(*standing);  // on_bus() may have closed this carrier
}

void CanCarrier::close() noexcept {
  handler_ = nullptr;
  timing_.cancel();
  armed_ = false;
  for (Lane& each : lanes_) each.queue.clear();
  node_.cancel();
  if (!bus_) return;
  counters_.rx_overflows = bus_->overflows();
  bus_->leave(*this);
  bus_.reset();
}

SendResult CanCarrier::send(std::string_view bytes, Priority priority, Peer) {
  if (handler_ == nullptr || !bus_->up()) return SendResult::down;
  if (bytes.size() > max_datagram) {
    ++counters_.tx_errors;
    return SendResult::full;
  }
  if (priority == Priority::stop && is_.role == Role::host) {
    const SendResult result = send_stop(bytes);
    ++(result == SendResult::sent ? counters_.tx_datagrams : counters_.tx_errors);
    return result;
  }
  if (priority == Priority::lease && is_.role == Role::host) return send_lease();
  if (is_.role == Role::host && !turn_.ours(Clock::now())) {
    return turn_.others() ? SendResult::busy : SendResult::down;
  }
  Lane& own = lane(node_.lane_of(Text(bytes.data(), bytes.size())));
  SendResult result = SendResult::sent;
  if (!own.queue.empty() || !begin(bytes, CanBus::now_us())) {
    result = own.queue.push(bytes, priority, everyone, Clock::now());
  }
  bus_->send();
  return result;
}

// Repeats only the numbered frame. Each bare frame is a new stop, which would undo a clear.
SendResult CanCarrier::send_stop(std::string_view bytes) {
  Datagram stop;
  std::uint32_t pnum = 0;
  if (!read_datagram(Text(bytes.data(), bytes.size()), stop) || !stop_number(stop, pnum)) {
    return bus_->stops().send_bare();
  }
  std::uint32_t number = 0;
  if (!stops_.find(pnum, number)) {
    const SendResult announced = bus_->stops().announce(stops_, number);
    if (announced != SendResult::sent) return announced;
    stops_.add(pnum, number);
  }
  return bus_->stops().repeat(number);
}

bool CanCarrier::begin(std::string_view bytes, std::uint32_t now_us) {
  if (!node_.begin(Text(bytes.data(), bytes.size()), now_us)) return false;
  turn_.on_own(Clock::now());
  ++counters_.tx_datagrams;
  counters_.tx_bytes += bytes.size();
  return true;
}

// All watchers send the same frame, so the frames do not collide.
SendResult CanCarrier::send_lease() {
  const Clock::time_point now = Clock::now();
  if (!trouble_.hears_board(now) || trouble_.hears_host(now)) return SendResult::down;
  node_.ask_for_states();
  bus_->send();
  return SendResult::sent;
}

// Ignores flow control, which looks the same from all hosts, and frames of other boards.
void CanCarrier::listen_for_others(const CanFrame& frame) {
  const CanIdMeaning meaning = classify(frame);
  if (is_.role != Role::host || meaning.node != is_.node) return;
  const Clock::time_point now = Clock::now();
  if (meaning.kind == CanIdKind::went_safe || meaning.kind == CanIdKind::reply ||
      meaning.kind == CanIdKind::telemetry) {
    return trouble_.on_board(now);
  }
  if (meaning.kind != CanIdKind::command || isotp_frame::is_flow_control(frame)) return;
  trouble_.on_host_frame(now);
  if (!turn_.on_other(now)) return;
  node_.stop_commanding();
  lane(CanLane::dialogue).queue.clear();
}

// The dialogue has flow control in both directions.
void CanCarrier::count_late_transfers() {
  const std::uint64_t count = std::uint64_t{node_.sent(CanLane::dialogue).flow_control_timeout} +
                              node_.received(CanLane::dialogue).consecutive_timeout;
  if (count != trouble_.late()) trouble_.on_late(count, Clock::now());
}

TransportTrouble CanCarrier::trouble() const {
  return is_.role == Role::host && up() ? trouble_.now(Clock::now()) : TransportTrouble::none;
}

bool CanCarrier::begin_waiting(std::uint32_t now_us) {
  bool any = false;
  for (Lane& each : lanes_) {
    if (each.queue.empty() || !node_.idle(each.which)) continue;
    const SendQueue::Entry* const entry = each.queue.front(Clock::now());
    if (entry == nullptr) continue;
    any = begin(entry->text(), now_us) || any;
    each.queue.pop();
  }
  return any;
}

bool CanCarrier::offer(std::uint32_t now_us, CanFrame& frame) {
  return node_.offer(now_us, frame) || (begin_waiting(now_us) && node_.offer(now_us, frame));
}

void CanCarrier::on_frame(const CanFrame& frame, std::uint32_t at_us) {
  listen_for_others(frame);
  if (is_.role == Role::host && classify(frame).kind == CanIdKind::command) {
    const std::optional<Text> command = others_.on_frame(frame, at_us);
    if (!command || command->empty()) return;
    Datagram whole;
    if (read_datagram(*command, whole)) trouble_.on_host_datagram(Clock::now());
    return handler_->on_overheard({command->data(), command->size()});
  }
  char room[max_datagram];
  const Text datagram = stops_.in_full(node_.on_frame(frame, at_us), room);
  count_late_transfers();
  if (datagram.empty()) return;
  ++counters_.rx_datagrams;
  counters_.rx_bytes += datagram.size();
  handler_->on_datagram({datagram.data(), datagram.size()}, everyone);
}

const CarrierCounters& CanCarrier::counters() const {
  if (bus_) counters_.rx_overflows = bus_->overflows();
  counters_.transfers = transfers_of(node_);
  return counters_;
}

void CanCarrier::arm() {
  IsotpDeadline deadline = node_.deadline();
  if (handler_ == nullptr || !deadline.armed) return;
  const std::uint32_t now_us = CanBus::now_us();
  // If the bus is full, a due frame waits for room. A later deadline is kept: it may be a time-out.
  if (bus_->full() && reached(now_us, deadline.at_us)) deadline.at_us = now_us + look_again_us;
  if (armed_ && reached(deadline.at_us, armed_for_us_)) return;
  armed_ = true;
  armed_for_us_ = deadline.at_us;
  const auto in_us = static_cast<std::int32_t>(deadline.at_us - now_us);
  timer_.expires_after(std::chrono::microseconds(in_us > 0 ? in_us : 0));
  timer_.async_wait(timing_.handler([this] { on_deadline(); }));
}

void CanCarrier::on_deadline() {
  armed_ = false;
  const std::shared_ptr<CanBus> bus = bus_;
  const CanBus::Member* const self = this;
  bus->take();
  if (!bus->has(self)) return;  // a handler of a frame has closed or destroyed this carrier
  const std::uint32_t now_us = CanBus::now_us();
  const auto answerable = [this](const CanFrame& frame) { return node_.may_be_answered(frame); };
  if (bus->holds(answerable)) node_.wait_anew(now_us);
  node_.poll(now_us);
  count_late_transfers();
  bus->send();  // also frames of other members that are due by now
}

void CanCarrier::on_bus(const CarrierEvent& event) {
  CarrierEvent own = event;
  own.problem.thing = is_.name;
  if (event.kind == CarrierEvent::Kind::down) {
    ++counters_.downs;
    node_.cancel();
    for (Lane& each : lanes_) each.queue.clear();
  } else if (event.kind == CarrierEvent::Kind::up) {
    ++counters_.ups;
    turn_.listen(Clock::now());
  }
  handler_->on_carrier_event(own);
}

void CanCarrier::on_stuck() {
  node_.cancel();
  ++counters_.tx_dropped;
}

}  // namespace

std::unique_ptr<Carrier> make_can_carrier_on(asio::io_context& io, CanCarrierOptions options,
                                             std::function<std::shared_ptr<CanBus>()> open_bus) {
  return std::make_unique<CanCarrier>(io, std::move(options), std::move(open_bus));
}

std::unique_ptr<Carrier> make_can_carrier(asio::io_context& io, const Url& url, Role role,
                                          const Claim&) {
  CanCarrierOptions options{role, node_of(url, role), false, true, ""};
  options.fd = url.get_number("fd", 0, 1, 0) == 1;
  options.packs = role == Role::board || url.get_number("pack", 0, 1, 1) == 1;
  options.name = fmt::format("can://{}?node={}{}{}", url.host(), options.node,
                             options.fd ? "&fd=1" : "", options.packs ? "" : "&pack=0");
  return make_can_carrier_on(io, options, [&io, interface = url.host(), fd = options.fd] {
    return CanBus::of(io, interface, fd);
  });
}

ShareName can_share_name(const Url& url) {
  return {fmt::format("can/{}/{}", url.host(), node_of(url, Role::host))};
}

}  // namespace r4
