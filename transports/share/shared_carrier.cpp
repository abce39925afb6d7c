// SPDX-License-Identifier: GPL-3.0-or-later
#include "shared_carrier.hpp"

#include <cerrno>
#include <chrono>
#include <optional>
#include <utility>

#include "../operation_slot.hpp"
#include "r4link/datagram.hpp"
#include "share_message.hpp"
#include "share_places.hpp"
#include "wire_holder.hpp"
#include "wire_sharer.hpp"

namespace r4 {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = ShareMessage::Kind;
using std::chrono::milliseconds;

constexpr milliseconds answer_within{200};
constexpr SharePlaces::Patience at_first{milliseconds(500), answer_within};
// Where a link may be under way by other wires, which must not wait.
constexpr SharePlaces::Patience again{milliseconds(0), milliseconds(20)};
// A holder that says nothing for so long is asked whether it is alive, and has so long again to answer.
constexpr milliseconds ask_after{400};
constexpr milliseconds look_again{5}, look_again_slowly{100};
// So long the wire may be nobody's before that is told.
constexpr milliseconds take_over_within{100};
constexpr milliseconds courtesy{20};  // left to a program that is about to take the wire to control

class SharedCarrier final : public Carrier,
                            private Carrier::Handler,
                            private WireHolder::Owner,
                            private WireSharer::Owner {
 public:
  SharedCarrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                std::shared_ptr<DeviceClaim> claim, FindWire find, BoardRole role)
      : claim_(std::move(claim)),
        own_(std::move(own)),
        role_(role),
        name_(own_->name()),
        holder_(io, *this, program_invocation_short_name),
        sharer_(io, *this),
        places_(std::move(find), holder_, sharer_),
        timer_(io) {
    claim_->on_taken = [this] { on_taken(); };
  }
  ~SharedCarrier() override { close(); }

  void open(Carrier::Handler& handler) override;
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer to) override;
  bool up() const override { return up_; }
  WireTrouble trouble() const override { return own_->trouble(); }
  // What is sent on a wire that another program holds the board would take for the holder's.
  bool is_shared() const override { return state_ == State::sharing || own_->is_shared(); }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override {
    counted_ = own_->counters();
    return counted_ += shared_counters_;
  }

 private:
  enum class State { closed, attaching, holding, sharing };

  void on_datagram(std::string_view bytes, Peer from) override;
  void on_carrier_event(const CarrierEvent& event) override;
  void on_drained() override { handler_->on_drained(); }
  void on_taken();
  void on_overheard(std::string_view bytes) override;
  void on_oversize(std::string_view beginning) override;
  // Those who share our wire.
  Kind standing(std::string& text) const override;
  void on_stop_of_another(std::string_view datagram) override;
  bool gives_way() override;
  void on_given_away() override { attach_later(courtesy); }
  // The holder of the wire that we share.
  void on_message(const ShareMessage& message) override;
  void on_all_heard() override { handler_->on_drained(); }
  void on_holder_lost() override;

  void take_part();
  bool try_to_take_part();
  bool try_to_share();
  bool try_to_hold();
  void expect_answer(milliseconds within);
  void look_after_holder();
  bool leave_holder();
  void leave_other_version();
  void attach_later(milliseconds delay);
  void look();
  void look_later();
  const SharePlaces::Patience& patience() const { return tried_ ? again : at_first; }
  bool late() const { return Clock::now() - since_ >= take_over_within; }
  void tell(const CarrierEvent& event);

  const std::shared_ptr<DeviceClaim> claim_;  // how own_ opens its device
  const std::unique_ptr<Carrier> own_;
  const BoardRole role_;
  std::string name_;
  WireHolder holder_;
  WireSharer sharer_;
  SharePlaces places_;
  LoopTimer timer_;
  OperationSlot looking_;
  State state_ = State::closed;
  bool up_ = false;
  bool moved_ = false;
  bool tried_ = false;  // before: now a link may be under way
  // Of the holder whose wire we share.
  bool welcome_ = false;
  bool heard_ = false;  // since it was looked after
  bool asked_ = false;
  std::optional<Problem> trouble_;  // why it is down, or the warning that stands
  Clock::time_point since_;         // we have no part in the wire
  Carrier::Handler* handler_ = nullptr;
  CarrierCounters shared_counters_;  // of what others carried for us
  mutable CarrierCounters counted_;  // of it and our own
};

void SharedCarrier::open(Carrier::Handler& handler) {
  close();
  handler_ = &handler;
  state_ = State::attaching;
  since_ = Clock::now();
  try {
    places_.begin();
    take_part();
  } catch (...) {
    tried_ = true;
    close();
    throw;
  }
  tried_ = true;
}

void SharedCarrier::close() noexcept {
  state_ = State::closed;
  handler_ = nullptr;
  up_ = moved_ = false;
  trouble_.reset();
  looking_.cancel();
  sharer_.leave();
  own_->close();  // the wire is free before others are told so
  holder_.release();
}

// Throws Error where neither will do.
void SharedCarrier::take_part() {
  // Between our two questions others may come and go.
  const Clock::time_point deadline = Clock::now() + take_over_within + share_places * answer_within;
  do {
    if (try_to_take_part()) return;
  } while (!tried_ && Clock::now() < deadline);
  throw Error(ErrorKind::open, name_, "other programs take it, one after the other",
              "end those that control the board");
}

bool SharedCarrier::try_to_take_part() {
  if (role_ == BoardRole::watch && try_to_share()) return true;
  if (role_ == BoardRole::control) {
    places_.ask_for_wire(name_, patience());
  }
  try {
    return try_to_hold();
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::open) throw;
    if (places_.somebody_has_come()) return false;  // and was faster
    if (places_.no_help()) throw Error(*places_.no_help());
    throw;
  }
}

// True if we share it now, or may do so soon.
bool SharedCarrier::try_to_share() {
  if (!places_.join(name_, patience())) return false;
  state_ = State::sharing;
  welcome_ = heard_ = false;
  asked_ = true;  // by the hello
  sharer_.listen();
  expect_answer(answer_within);
  return true;
}

void SharedCarrier::expect_answer(milliseconds within) {
  timer_.expires_after(within);
  timer_.async_wait(looking_.handler([this] { look_after_holder(); }));
}

// A board that says nothing is told by this from a holder that hangs.
void SharedCarrier::look_after_holder() {
  if (heard_) {
    heard_ = asked_ = false;
  } else if (!asked_) {
    asked_ = true;
    sharer_.ask_whether_alive();
  } else {
    places_.pass_over_hanging(name_);
    if (leave_holder()) return;
    // When it goes on it finds our hello.
    tell({CarrierEvent::Kind::down, *places_.no_help()});
    if (state_ != State::sharing) return;
  }
  expect_answer(ask_after);
}

// It is no help to us. False: neither is any other, and the wire is not to be had without it.
bool SharedCarrier::leave_holder() {
  since_ = Clock::now();
  try {
    // One of those that leave it with us may be about to hold another.
    for (int i = 0; i < 3; ++i) {
      if (try_to_share() || try_to_hold()) return true;
    }
  } catch (const Error&) {
    return false;
  }
  return false;
}

void SharedCarrier::leave_other_version() {
  sharer_.leave();
  attach_later(look_again_slowly);
  places_.pass_over_other_version(name_);
  tell({CarrierEvent::Kind::down, *places_.no_help()});
}

// Where a holder hangs that only watches, it is taken from that one. Throws Error if it cannot be opened.
bool SharedCarrier::try_to_hold() {
  if (!places_.hold(name_)) return false;
  const State before = std::exchange(state_, State::holding);
  try {
    claim_->yields = role_ == BoardRole::watch && holder_.holds();
    claim_->takes = places_.one_hangs();
    own_->open(*this);
  } catch (...) {
    state_ = before;
    holder_.release();
    throw;
  }
  sharer_.leave();
  return true;
}

void SharedCarrier::attach_later(milliseconds delay) {
  state_ = State::attaching;
  places_.forget();
  since_ = Clock::now() + delay;
  timer_.expires_after(delay);
  timer_.async_wait(looking_.handler([this] { look(); }));
}

void SharedCarrier::look() {
  try {
    places_.follow();
    if (try_to_take_part()) return;
  } catch (const Error& error) {
    places_.forget();
    if (late()) tell({CarrierEvent::Kind::down, error.problem()});
    if (state_ != State::attaching) return;
  }
  look_later();
}

void SharedCarrier::look_later() {
  timer_.expires_after(late() ? look_again_slowly : look_again);
  timer_.async_wait(looking_.handler([this] { look(); }));
}

SendResult SharedCarrier::send(std::string_view bytes, Priority priority, Peer to) {
  switch (state_) {
    case State::holding: {
      const SendResult result = own_->send(bytes, priority, to);
      if (result == SendResult::sent) holder_.tell(Kind::sent, bytes);
      return result;
    }
    case State::sharing:
      // Nothing else is ours to say: the board would take it for the holder's.
      if (priority != Priority::stop) return SendResult::down;
      ++shared_counters_.tx_datagrams;
      shared_counters_.tx_bytes += bytes.size();
      return sharer_.send_stop(bytes);
    case State::attaching:
    case State::closed:
      break;
  }
  return SendResult::down;
}

// --- we hold the wire

void SharedCarrier::on_datagram(std::string_view bytes, Peer from) {
  // Ours first: it may be driving.
  handler_->on_datagram(bytes, from);
  if (state_ == State::holding) holder_.tell(Kind::received, bytes, priority_of(bytes));
}

void SharedCarrier::on_overheard(std::string_view bytes) {
  handler_->on_overheard(bytes);
  if (state_ == State::holding) holder_.tell(Kind::sent, bytes);
}

void SharedCarrier::on_oversize(std::string_view beginning) {
  handler_->on_oversize(beginning);
  if (state_ == State::holding) holder_.tell(Kind::oversize, beginning);
}

void SharedCarrier::on_carrier_event(const CarrierEvent& event) {
  // A board that is found elsewhere is another name.
  const bool renamed = name_ != own_->name();
  name_ = own_->name();
  const bool goes = event.kind == CarrierEvent::Kind::down && places_.wire().is_place;
  const bool comes = event.kind == CarrierEvent::Kind::up && trouble_;
  if (state_ == State::holding && (goes || comes)) places_.rename();
  tell(event);
  if (!up_) return;
  if (auto stranger = places_.take_stranger()) tell({CarrierEvent::Kind::warning, *stranger});
  if (renamed && up_ && state_ == State::holding) holder_.tell(Kind::up, name_);
}

// To those who share the wire and to our program, unless it knows that already. `up` is told anew when
// the datagrams come from elsewhere.
void SharedCarrier::tell(const CarrierEvent& event) {
  const bool up = event.kind == CarrierEvent::Kind::up;
  const bool down = event.kind == CarrierEvent::Kind::down;
  const bool known = down && !up_ && trouble_ && trouble_->reason == event.problem.reason;
  const bool turns = (up || down) && up != up_;
  if (turns && state_ != State::holding) ++(up ? shared_counters_.ups : shared_counters_.downs);
  if (turns) up_ = up;
  trouble_ = up ? std::nullopt : std::optional(event.problem);
  if (state_ == State::holding && holder_.sharers() != 0) {
    std::string text;
    const Kind kind = standing(text);
    holder_.tell(kind, text);
  }
  if (!known) handler_->on_carrier_event(event);
}

Kind SharedCarrier::standing(std::string& text) const {
  text = trouble_ ? problem_text(*trouble_) : name_;
  if (!up_) return Kind::down;
  return trouble_ ? Kind::warning : Kind::up;
}

void SharedCarrier::on_stop_of_another(std::string_view datagram) {
  if (own_->send(datagram, Priority::stop, everyone) == SendResult::sent) {
    holder_.tell(Kind::sent, datagram);
    handler_->on_overheard(datagram);
  }
}

// It may be from long ago that this program went on last.
void SharedCarrier::on_taken() {
  holder_.release();
  attach_later(milliseconds(0));
}

bool SharedCarrier::gives_way() {
  if (role_ == BoardRole::control) return false;
  own_->close();
  return true;
}

// --- we share the wire

void SharedCarrier::on_message(const ShareMessage& message) {
  heard_ = true;
  if (places_.joined_is_passed_over()) {
    places_.forget();
    // It goes on, and tells how the wire is to those that come.
    if (welcome_) {
      sharer_.leave();
      return attach_later(milliseconds(0));
    }
  }
  switch (message.kind) {
    case Kind::welcome:
      welcome_ = true;
      if (!message.same_version) leave_other_version();
      break;
    case Kind::received:
      ++shared_counters_.rx_datagrams;
      shared_counters_.rx_bytes += message.text.size();
      handler_->on_datagram(message.text, everyone);
      break;
    case Kind::sent:
      return handler_->on_overheard(message.text);
    case Kind::oversize:
      ++shared_counters_.rx_oversize;
      handler_->on_oversize(message.text);
      break;
    case Kind::up:
      name_ = std::string(message.text);
      tell({CarrierEvent::Kind::up, Problem{ErrorKind::open, name_, "", ""}});
      break;
    case Kind::down:
      return tell({CarrierEvent::Kind::down, message.problem});
    case Kind::warning:
      return tell({CarrierEvent::Kind::warning, message.problem});
    case Kind::moved:
      moved_ = true;
      break;
    default:
      break;
  }
}

void SharedCarrier::on_holder_lost() {
  if (std::exchange(moved_, false)) return attach_later(courtesy);
  if (welcome_) return attach_later(milliseconds(0));
  // It ends, or has had enough of us.
  state_ = State::attaching;
  places_.forget();
  if (late() && !trouble_) tell({CarrierEvent::Kind::down, sharer_.turned_away(name_)});
  if (state_ == State::attaching) look_later();
}

}  // namespace

std::unique_ptr<Carrier> make_shared_carrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                                             std::shared_ptr<DeviceClaim> claim, FindWire find,
                                             BoardRole role) {
  return std::make_unique<SharedCarrier>(io, std::move(own), std::move(claim), std::move(find),
                                         role);
}

}  // namespace r4
