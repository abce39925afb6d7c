// SPDX-License-Identifier: GPL-3.0-or-later
#include "can_bus.hpp"

#include <fmt/format.h>
#include <linux/can/error.h>
#include <sched.h>

#include <asio/defer.hpp>
#include <asio/post.hpp>
#include <cerrno>
#include <map>
#include <utility>

#include "../file_descriptor.hpp"
#include "can_socket.hpp"
#include "r4link/can/can_ids.hpp"
#include "r4link/can/can_interface.hpp"

namespace r4 {
namespace {

constexpr const char* check_the_wire = "check wiring, termination and bit rate";
constexpr std::chrono::milliseconds look_interval{100};
constexpr int most_looks = 8;  // then other work of the loop runs
// A program on an emulated processor answers within this time.
constexpr std::chrono::microseconds most_polling{400};
// After this time the loop may sleep, so that a caller of its poll() regains control.
constexpr std::chrono::milliseconds most_awake{10};

Problem filter_problem(Problem problem) {
  if (problem.fix.empty()) {
    problem.reason =
        "the kernel does not accept the CAN filters of this program: " + problem.reason;
    problem.fix = "use fewer nodes of one interface in one program; the kernel accepts 512 filters";
  }
  return problem;
}

class Buses : public asio::execution_context::service {
 public:
  using key_type = Buses;
  static asio::execution_context::id id;
  explicit Buses(asio::execution_context& context) : service(context) {}
  void shutdown() noexcept override {}

  std::map<std::pair<std::string, bool>, std::weak_ptr<CanBus>> buses;
};
asio::execution_context::id Buses::id;

}  // namespace

std::shared_ptr<CanBus> CanBus::of(asio::io_context& io, const std::string& interface, bool fd) {
  std::weak_ptr<CanBus>& known = asio::use_service<Buses>(io).buses[{interface, fd}];
  std::shared_ptr<CanBus> bus = known.lock();
  if (!bus) {
    bus = on(io, std::make_unique<CanSocket>(interface, fd));
    known = bus;
  }
  return bus;
}

std::shared_ptr<CanBus> CanBus::on(asio::io_context& io, std::unique_ptr<CanMedium> medium) {
  auto bus = std::make_shared<CanBus>(io, std::move(medium));
  bus->look_at_controller();
  return bus;
}

CanBus::CanBus(asio::io_context& io, std::unique_ptr<CanMedium> medium)
    : io_(io),
      medium_(std::move(medium)),
      stops_(io, *medium_),
      readable_(io),
      writable_(io),
      retry_timer_(io),
      look_timer_(io),
      polling_(most_polling) {
  medium_->open();
  watch_socket();
  listen();
}

CanBus::~CanBus() {
  writable_.stop();
  if (readable_.is_open()) readable_.release();  // the medium owns the descriptor
}

void CanBus::join(Member& member, std::vector<std::uint32_t> ids) {
  members_.push_back({&member, std::move(ids), false});
  hear();
}

void CanBus::join_all(Member& member) {
  members_.push_back({&member, {}, true});
  hear();
}

void CanBus::leave(Member& member) noexcept {
  for (Membership& each : members_) {
    if (each.member == &member) each.member = nullptr;
  }
  std::replace(out_of_.begin(), out_of_.end(), &member, static_cast<Member*>(nullptr));
  clear_places();
}

bool CanBus::has(const Member* member) const {
  return std::any_of(members_.begin(), members_.end(),
                     [member](const Membership& each) { return each.member == member; });
}

void CanBus::clear_places() {
  if (calling_ != 0 || sending_) return;
  if (std::erase_if(members_, [](const Membership& each) { return each.member == nullptr; }) != 0)
    hear();
}

// If hear() fails, the bus goes down in the next turn, because a member may be joining or leaving.
void CanBus::hear() {
  if (medium_->number() < 0 || set_filters()) return;
  asio::post(io_, deafness_.handler([this, error = errno] {
    go_down(filter_problem(medium_->problem(error)), true);
  }));
}

bool CanBus::set_filters() {
  std::vector<std::uint32_t> ids;
  for (const Membership& each : members_) {
    if (each.member == nullptr) continue;
    if (each.all) return medium_->hear_everything();
    ids.insert(ids.end(), each.ids.begin(), each.ids.end());
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return medium_->hear(ids);
}

// Throws Error if the system does not let the loop wait for the socket.
void CanBus::watch_socket() {
  with_system_errors(medium_->name(), [&] { readable_.assign(medium_->number()); });
}

void CanBus::listen() {
  readable_.async_wait(asio::posix::descriptor_base::wait_read, reading_.handler([this] {
    woken_ = Clock::now();
    receive();
  }));
}

bool CanBus::someone_awaits_a_frame() const {
  return std::any_of(members_.begin(), members_.end(), [](const Membership& each) {
    return each.member != nullptr && each.member->awaits_frame();
  });
}

void CanBus::receive() {
  const std::shared_ptr<CanBus> alive = shared_from_this();
  if (take()) send();
  if (medium_->number() < 0) return;
  if (!medium_->simulated()) return listen();
  const Clock::time_point now = Clock::now();
  polling_.on_silence(someone_awaits_a_frame() ? AdaptivePolling::Silence::within
                                               : AdaptivePolling::Silence::between,
                      now);
  const bool tired = now - woken_ >= most_awake;
  if (tired || !polling_.worthwhile(now)) return listen();
  ::sched_yield();  // the sender may share the processor
  asio::defer(io_, reading_.handler([this] { receive(); }));
}

bool CanBus::take() {
  if (receiving_) return false;
  bool any = false;
  for (int looks = 0; looks < most_looks && medium_->number() >= 0; ++looks) {
    const int count = medium_->receive(in_);
    if (count == -EAGAIN || count == -EINTR) break;
    if (count < 0) {
      go_down(medium_->problem(-count), true);
      return true;
    }
    if (!std::exchange(any, true)) polling_.on_arrival(Clock::now());
    hand_over(static_cast<std::size_t>(count));
    if (static_cast<std::size_t>(count) < in_.size()) break;
  }
  if (any && medium_->number() >= 0) {
    for_each_member([](Member& member) { member.on_drained(); });
  }
  return any;
}

void CanBus::hand_over(std::size_t count) {
  receiving_ = true;
  for (std::size_t i = 0; i < count; ++i) {
    if (in_[i].error != 0) {
      on_error_frame(in_[i]);
      continue;
    }
    if (!in_[i].local) {
      // A frame of another node proves that this node is on the bus.
      if (!up() || trouble_ == Trouble::not_acknowledged) come_up();
    } else if (!up() && classify(in_[i].frame).kind != CanIdKind::emergency_stop) {
      continue;  // the frame did not reach the bus
    }
    const std::uint32_t at_us = to_us(in_[i].at);
    for_each_member([&](Member& member) { member.on_frame(in_[i].frame, at_us); });
  }
  receiving_ = false;
}

void CanBus::on_error_frame(const CanMedium::Received& received) {
  if ((received.error & CAN_ERR_BUSOFF) != 0) return go_bus_off();
  if ((received.error & CAN_ERR_RESTARTED) != 0) return come_up();
  if ((received.error & CAN_ERR_CRTL) != 0) {
    const std::uint8_t controller = received.frame.data[1];
    if ((controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++controller_overflows_;
    if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) {
      come_up();
    } else if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
      warn_of(Trouble::error_passive);
    } else if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
      warn_of(Trouble::error_warning);
    }
  } else if ((received.error & CAN_ERR_ACK) != 0 && trouble_ == Trouble::none) {
    warn_of(Trouble::not_acknowledged);
  }
}

// Error frames report only changes, so the state must be read for a new socket.
void CanBus::look_at_controller() {
  const std::string state = medium_->state();
  if (state == "bus-off") return go_bus_off();
  if (!up()) come_up();
  if (state == "error-passive") warn_of(Trouble::error_passive);
  if (state == "error-warning") warn_of(Trouble::error_warning);
}

void CanBus::go_bus_off() {
  go_down(
      {ErrorKind::open, medium_->name(), "the controller is bus-off: too many errors",
       fmt::format("{}, then: ip link set {} type can restart (slcan, gs_usb: down, and up); with "
                   "restart-ms 100 the interface restarts by itself",
                   check_the_wire, medium_->name().substr(medium_->name().rfind('/') + 1))},
      false);
}

void CanBus::warn_of(Trouble trouble) {
  if (!up() || trouble_ == trouble) return;
  trouble_ = trouble;
  Problem problem{ErrorKind::open, medium_->name(), "the controller warns of errors",
                  check_the_wire};
  if (trouble == Trouble::error_passive) problem.reason = "the controller is error-passive";
  if (trouble == Trouble::not_acknowledged) {
    problem.reason = "no node acknowledges the frames";
    problem.fix = "check that another node is on the bus, at this bit rate";
  }
  standing_ = {CarrierEvent::Kind::warning, std::move(problem)};
  tell(*standing_);
}

void CanBus::go_down(Problem problem, bool reopen) {
  const std::shared_ptr<CanBus> alive = shared_from_this();
  drop_queue();
  retrying_.cancel();
  deafness_.cancel();
  writable_.stop();
  if (reopen) {
    reading_.cancel();
    if (readable_.is_open()) readable_.release();
    medium_->close();
    look_later();
  }
  be_down(std::move(problem));
}

// The reason may change while the bus is down, for example from bus-off to a missing adapter.
void CanBus::be_down(Problem problem) {
  const bool was_up = std::exchange(trouble_, Trouble::down) != Trouble::down;
  if (!was_up && standing_ && standing_->problem.reason == problem.reason) return;
  standing_ = {CarrierEvent::Kind::down, problem};
  tell({was_up ? CarrierEvent::Kind::down : CarrierEvent::Kind::warning, std::move(problem)});
}

void CanBus::come_up() {
  const Trouble before = std::exchange(trouble_, Trouble::none);
  standing_.reset();
  Problem problem{ErrorKind::open, medium_->name(), "", ""};
  if (before == Trouble::down) return tell({CarrierEvent::Kind::up, std::move(problem)});
  if (before == Trouble::none) return;
  problem.reason = "the errors have stopped";
  tell({CarrierEvent::Kind::warning, std::move(problem)});
}

void CanBus::look_later() {
  look_timer_.expires_after(look_interval);
  look_timer_.async_wait(looking_.handler([this] { look(); }));
}

// Opens a new socket, because a new interface may have the same name.
void CanBus::look() {
  const std::shared_ptr<CanBus> alive = shared_from_this();
  try {
    medium_->open();
    if (!set_filters()) throw Error(filter_problem(medium_->problem(errno)));
    watch_socket();
  } catch (const Error& error) {
    medium_->close();
    look_later();
    return be_down(error.problem());
  }
  listen();
  look_at_controller();
}

void CanBus::tell(CarrierEvent event) {  // by value, because standing_ may change in a call
  for_each_member([&](Member& member) { member.on_bus(event); });
}

}  // namespace r4
