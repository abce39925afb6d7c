// SPDX-License-Identifier: GPL-3.0-or-later
// A CAN medium that members in one event loop share. The bus has one socket with kernel filters for
// the ids in use, passes frames in batches, and reports the state of the bus as events. A member
// receives the frames with the ids of all members, except frames that members send. Frames leave in
// the order of offers, and no transfer interrupts another member's transfer. The bus takes at most
// `ahead` frames, and more when the interface has taken all of them. After 100 ms without progress
// the bus drops these frames. Without a wire (vcan, vxcan), the bus polls briefly before sleeping.
#pragma once

#include <algorithm>
#include <array>
#include <asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../adaptive_polling.hpp"
#include "../operation_slot.hpp"
#include "../writable_wait.hpp"
#include "bus_stops.hpp"
#include "can_medium.hpp"
#include "r4link/carrier.hpp"

namespace r4 {

// More than 15 data members, because socket, timers, waiting frames and members change together.
class CanBus : public std::enable_shared_from_this<CanBus> {
 public:
  using Clock = CanMedium::Clock;
  static constexpr std::size_t ahead = 32;
  static constexpr std::chrono::milliseconds patience{100};

  class Member {
   public:
    virtual void on_frame(const CanFrame& frame, std::uint32_t at_us) = 0;
    virtual void on_drained() {}  // all arrived frames were delivered
    // True during a transfer whose next frame comes from the other end.
    virtual bool awaits_frame() const { return false; }
    // True if there is a frame to send now. The bus accepts the frame with frame_sent().
    virtual bool offer(std::uint32_t, CanFrame&) { return false; }
    // Like offer(), for a frame that may overtake accepted frames.
    virtual bool offer_urgent(std::uint32_t, CanFrame&) { return false; }
    virtual void frame_sent(std::uint32_t) {}
    // The interface has taken a frame of this member after a wait.
    virtual void on_late_frame(const CanFrame&, std::uint32_t) {}
    virtual void on_sent() {}  // all members had a turn to offer frames: time to set a timer
    // The bus is up, is down (which ends all transfers), or has a warning.
    virtual void on_bus(const CarrierEvent& event) = 0;
    // The bus took no frame for `patience`: the waiting frames are lost.
    virtual void on_stuck() {}

   protected:
    ~Member() = default;
  };

  // The members' clock, in us; wraps.
  static std::uint32_t to_us(Clock::time_point at) {
    return static_cast<std::uint32_t>(
        std::chrono::duration_cast<std::chrono::microseconds>(at.time_since_epoch()).count());
  }
  static std::uint32_t now_us() { return to_us(Clock::now()); }

  // The bus of `interface` in this event loop, opened if it is not open. Throws Error.
  static std::shared_ptr<CanBus> of(asio::io_context& io, const std::string& interface, bool fd);

  // A separate bus on `medium`, which is opened. Throws Error.
  static std::shared_ptr<CanBus> on(asio::io_context& io, std::unique_ptr<CanMedium> medium);

  CanBus(asio::io_context& io, std::unique_ptr<CanMedium> medium);
  ~CanBus();
  CanBus(const CanBus&) = delete;
  CanBus& operator=(const CanBus&) = delete;

  // Until a member leaves, it receives the 11-bit `ids`, or with join_all() frames of every kind.
  void join(Member& member, std::vector<std::uint32_t> ids);
  void join_all(Member& member);
  void leave(Member& member) noexcept;
  bool has(const Member* member) const;

  void send();
  // True if frames were delivered. Call before acting on a time-out: a late loop may find both.
  bool take();
  BusStops& stops() { return stops_; }

  bool up() const { return trouble_ != Trouble::down; }
  // The newest event, for a new member; none if the event does not apply at present.
  const std::optional<CarrierEvent>& standing() const { return standing_; }
  // True if frames wait for the interface. When no frame waits, members may offer again.
  bool full() const { return out_count_ != 0; }
  template <class Predicate>
  bool holds(Predicate predicate) const {
    const auto end = out_.begin() + static_cast<std::ptrdiff_t>(out_count_);
    return std::any_of(out_.begin(), end, predicate);
  }
  bool heard_rate_switch() const { return medium_->heard_rate_switch(); }
  // Frames that the kernel dropped because this program was late, plus the controller's overflows.
  std::uint32_t overflows() const { return medium_->overflows() + controller_overflows_; }

 private:
  enum class Trouble : std::uint8_t { none, not_acknowledged, error_warning, error_passive, down };
  struct Membership {
    Member* member;  // null: has left
    std::vector<std::uint32_t> ids;
    bool all;
  };

  void watch_socket();
  void listen();
  void receive();
  bool someone_awaits_a_frame() const;
  void hand_over(std::size_t count);
  void on_error_frame(const CanMedium::Received& received);
  void send_urgent(std::uint32_t now_us);
  bool refill(std::uint32_t now_us);
  void have_left(std::size_t count);
  void drop_queue();
  void send_later(CanMedium::Outcome outcome);
  void go_bus_off();
  void warn_of(Trouble trouble);
  void go_down(Problem problem, bool reopen);
  void be_down(Problem problem);
  void come_up();
  void look_later();
  void look();
  void look_at_controller();
  void tell(CarrierEvent event);
  void hear();
  bool set_filters();
  void clear_places();
  template <class Action>
  void for_each_member(Action action);

  asio::io_context& io_;
  const std::unique_ptr<CanMedium> medium_;
  BusStops stops_;
  LoopDescriptor readable_;
  OperationSlot reading_;
  WritableWait writable_;
  LoopTimer retry_timer_;
  OperationSlot retrying_;
  LoopTimer look_timer_;
  OperationSlot looking_;
  OperationSlot deafness_;  // the report that the kernel has refused the filters

  std::vector<Membership> members_;
  std::size_t next_ = 0;  // index of the member that offers next
  int calling_ = 0;       // not 0 while members are called: no place is removed
  bool sending_ = false;
  bool receiving_ = false;
  AdaptivePolling polling_;
  Clock::time_point woken_;
  std::array<CanFrame, ahead> out_;
  std::array<Member*, ahead> out_of_{};  // the member that offered the frame; null: has left
  bool late_ = false;                    // the interface has refused frames of out_ once
  std::size_t out_count_ = 0;
  Clock::time_point progress_;

  Trouble trouble_ = Trouble::none;
  std::optional<CarrierEvent> standing_;
  std::uint32_t controller_overflows_ = 0;
  std::array<CanMedium::Received, CanMedium::batch> in_;
};

// Members may join and leave during a call. A new member does not get this event.
template <class Action>
void CanBus::for_each_member(Action action) {
  ++calling_;
  const std::size_t count = members_.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (members_[i].member != nullptr) action(*members_[i].member);
  }
  --calling_;
  clear_places();
}

}  // namespace r4
