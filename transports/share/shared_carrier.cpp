// SPDX-License-Identifier: GPL-3.0-or-later
#include "shared_carrier.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../operation_slot.hpp"
#include "share_client.hpp"
#include "share_holder.hpp"
#include "share_message.hpp"
#include "share_socket.hpp"

namespace r4 {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = ShareMessage::Kind;
using Joined = ShareClient::Joined;
using std::chrono::milliseconds;

// The roles of a holder, in the order of the search.
constexpr std::array holders{BoardRole::control, BoardRole::watch};
constexpr milliseconds look_again{5}, look_again_slowly{100};
// A longer time without a holder is reported.
constexpr milliseconds take_over_within{100};

// More than 15 data members: the carrier, the search and both ends of sharing are one machine.
class SharedCarrier final : public Carrier,
                            private Carrier::Handler,
                            private ShareHolder::Owner,
                            private ShareClient::Owner {
 public:
  SharedCarrier(asio::io_context& io, std::unique_ptr<Carrier> own, Claim claim, FindShareName find,
                BoardRole role)
      : claim_(std::move(claim)),
        own_(std::move(own)),
        find_(std::move(find)),
        role_(role),
        name_(own_->name()),
        holder_(io, *this),
        client_(io, *this),
        timer_(io) {
    claim_->on_taken = [this] { lose(); };
  }
  ~SharedCarrier() override { close(); }

  void open(Carrier::Handler& handler) override;
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer to) override;
  bool up() const override { return up_; }
  TransportTrouble trouble() const override { return own_->trouble(); }
  // The board cannot distinguish the datagrams of this program and of the holder.
  bool is_shared() const override { return is_served() || own_->is_shared(); }
  void change_role(BoardRole role) override;
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override {
    counted_ = own_->counters();
    return counted_ += shared_counters_;
  }

 private:
  enum class State { closed, seeking, asking, joined, holding };
  struct Search {
    Clock::time_point began = Clock::now();
    std::size_t first = 0;           // the index in `holders` of the first one not passed over
    std::size_t next = 0;            // the index of the next holder to ask
    std::optional<Problem> no_help;  // why the first holder was passed over
  };

  void on_datagram(std::string_view bytes, Peer from) override {
    // This program gets the datagram first, because it may be driving.
    handler_->on_datagram(bytes, from);
    if (state_ == State::holding) holder_.tell(Kind::received, bytes);
  }
  void on_carrier_event(const CarrierEvent& event) override;
  void on_drained() override { handler_->on_drained(); }
  void on_overheard(std::string_view bytes) override {
    handler_->on_overheard(bytes);
    if (state_ == State::holding) holder_.tell(Kind::sent, bytes);
  }
  void on_oversize(std::string_view beginning) override {
    handler_->on_oversize(beginning);
    if (state_ == State::holding) holder_.tell(Kind::oversize, beginning);
  }
  std::vector<CarrierEvent> standing() const override;
  void on_stop_of_another(std::string_view datagram) override {
    // The other program repeats the stop until the board obeys.
    if (state_ != State::holding) return;
    if (own_->send(datagram, Priority::stop, everyone) != SendResult::sent) return;
    holder_.tell(Kind::sent, datagram);
    handler_->on_overheard(datagram);
  }
  void on_asked() override {
    if (role_ == BoardRole::watch) lose();
  }
  void on_message(const ShareMessage& message) override;
  void on_all_heard() override { handler_->on_drained(); }
  void on_no_help(const Problem& why) override {
    if (state_ == State::joined) search_.began = Clock::now();
    pass_over(why);
    state_ = State::seeking;
    look();
  }
  void on_closed() override {
    if (state_ == State::joined) return lose();
    const bool let_go = role_ == BoardRole::control;
    state_ = State::seeking;
    look_later(let_go ? milliseconds(0) : late() ? look_again_slowly : look_again);
  }

  bool take_part();
  void require_control();
  bool hold_to_watch();
  void open_own();
  void pass_over(const Problem& why);
  void lose() {
    seek();
    // After seek(): the transport is free before other programs look for a holder.
    holder_.release();
  }
  void seek();
  void look();
  void look_later(milliseconds delay) {
    timer_.expires_after(delay);
    timer_.async_wait(looking_.handler([this] { look(); }));
  }
  bool late() const { return Clock::now() - search_.began >= take_over_within; }
  bool is_served() const {
    return state_ == State::joined || (state_ == State::asking && role_ == BoardRole::watch);
  }
  void tell(const CarrierEvent& event);

  const Claim claim_;
  const std::unique_ptr<Carrier> own_;
  const FindShareName find_;
  BoardRole role_;
  std::string name_;
  ShareName share_;
  ShareHolder holder_;
  ShareClient client_;
  LoopTimer timer_;
  OperationSlot looking_;
  Search search_;
  State state_ = State::closed;
  bool up_ = false;
  std::optional<Problem> trouble_;  // why the transport is down, or its warning
  Carrier::Handler* handler_ = nullptr;
  CarrierCounters shared_counters_;  // counts of datagrams through another holder
  mutable CarrierCounters counted_;
};

void SharedCarrier::open(Carrier::Handler& handler) {
  close();
  handler_ = &handler;
  state_ = State::seeking;
  search_ = {};
  try {
    if (!take_part()) look_later(look_again);
  } catch (...) {
    close();
    throw;
  }
}

void SharedCarrier::close() noexcept {
  state_ = State::closed;
  handler_ = nullptr;
  up_ = false;
  trouble_.reset();
  looking_.cancel();
  client_.leave();
  own_->close();  // the transport is free before other programs look for a holder
  holder_.release();
}

// Joins or becomes the holder. False: look again soon. Throws Error if the transport does not open.
bool SharedCarrier::take_part() {
  if (!holder_.holds()) share_ = find_();
  const bool controls = role_ == BoardRole::control;
  if (controls && !holder_.holds()) require_control();
  search_.next = std::max<std::size_t>(search_.first, controls ? 1 : 0);
  Joined joined = Joined::holder;
  while (search_.next < holders.size()) {
    const BoardRole asked = holders[search_.next++];
    joined = with_system_errors(
        name_, [&] { return client_.join(share_, asked, controls ? Kind::ask : Kind::hello); });
    if (joined == Joined::nobody || joined == Joined::stranger) continue;
    if (joined == Joined::holder && !is_stopped(client_.process())) {
      state_ = State::asking;
      return true;
    }
    const bool waits = Clock::now() - search_.began < ShareClient::answer_within;
    if (joined == Joined::crowd && waits) return false;
    pass_over(client_.silence());
  }
  if (!controls && joined == Joined::nobody && !hold_to_watch()) return false;
  open_own();
  return true;
}

// Takes the name of the controlling program. Throws Error{refused} if another program has it.
void SharedCarrier::require_control() {
  FileDescriptor other;
  for (int i = 0; !other && i < 2; ++i) {  // the other program may have ended in between
    if (holder_.hold(share_, BoardRole::control)) return;
    if (const auto problem = out_of_resources(name_, errno)) throw Error(*problem);
    other = connect_to_holder(share_, BoardRole::control);
  }
  // If another user's program has this name, it does not block the transport.
  if (other && !is_one_of_us(other.get(), share_)) return holder_.release();
  const pid_t process = other ? process_of(other.get()) : 0;
  const bool stopped = is_stopped(process);
  const std::string program = program_of(process);
  Problem problem{
      ErrorKind::refused, name_,
      fmt::format("controlled by {}{}{}", program, other ? fmt::format(" (pid {})", process) : "",
                  stopped ? ", which is stopped" : ""),
      stopped
          ? fmt::format("end that program (kill -KILL {0}); if you continue it (kill -CONT {0}), "
                        "the outputs resume",
                        process)
          : "end that program, or only watch the board, as r4 monitor does"};
  problem.holder = Program{process, program};
  throw Error(std::move(problem));
}

void SharedCarrier::change_role(BoardRole role) {
  if (role == role_) return;
  const bool controls = role == BoardRole::control;
  const bool is_open = state_ != State::closed;
  bool is_found = is_open && controls;
  try {
    if (is_found && state_ == State::seeking) share_ = find_();
  } catch (const Error&) {
    is_found = false;  // its name is taken when it is found
  }
  if (is_found) require_control();
  role_ = role;
  if (is_open) controls ? seek() : lose();
}

// Takes the name of the watching holder. False if another program was faster. A controlling program
// takes its own name before it looks for this name, so one of the two programs finds the other.
bool SharedCarrier::hold_to_watch() {
  if (!holder_.hold(share_, BoardRole::watch)) {
    if (const auto problem = out_of_resources(name_, errno)) throw Error(*problem);
    return false;
  }
  if (search_.no_help) return true;
  const FileDescriptor other = connect_to_holder(share_, BoardRole::control);
  if (other ? !is_one_of_us(other.get(), share_) : !would_block(errno)) return true;
  holder_.release();
  return false;
}

// If a watching holder was passed over, an exclusive device is taken from that holder.
void SharedCarrier::open_own() {
  state_ = State::holding;
  try {
    claim_->yields = role_ == BoardRole::watch;
    claim_->takes = search_.no_help.has_value();
    with_system_errors(name_, [&] { own_->open(*this); });
  } catch (const Error& error) {
    state_ = State::seeking;
    if (role_ == BoardRole::watch) holder_.release();
    if (error.kind() == ErrorKind::open && search_.no_help) throw Error(*search_.no_help);
    throw;
  }
  if (state_ == State::holding && !holder_.holds()) look_later(look_again_slowly);
}

void SharedCarrier::pass_over(const Problem& why) {
  client_.leave();
  search_.first = search_.next;
  if (search_.no_help) return;
  search_.no_help = why;
  search_.no_help->thing = name_;
}

void SharedCarrier::seek() {
  client_.leave();
  own_->close();
  state_ = State::seeking;
  search_ = {};
  look_later(milliseconds(0));
}

void SharedCarrier::look() {
  if (state_ == State::holding) {
    if (!holder_.hold(share_, role_)) look_later(look_again_slowly);
    return;
  }
  try {
    if (take_part()) return;
  } catch (const Error& error) {
    const bool is_news =
        (late() || search_.no_help) && (up_ || !trouble_ || error.kind() != ErrorKind::open);
    search_.first = 0;  // ask all holders again
    search_.no_help.reset();
    if (is_news) tell({CarrierEvent::Kind::down, error.problem()});
    if (state_ != State::seeking) return;
  }
  look_later(late() ? look_again_slowly : look_again);
}

SendResult SharedCarrier::send(std::string_view bytes, Priority priority, Peer to) {
  if (state_ == State::holding) {
    const SendResult result = own_->send(bytes, priority, to);
    if (result == SendResult::sent) holder_.tell(Kind::sent, bytes);
    return result;
  }
  // For a served program, the holder sends only stops, because the board would attribute other
  // datagrams to the holder.
  if (!is_served() || priority != Priority::stop) return SendResult::down;
  ++shared_counters_.tx_datagrams;
  shared_counters_.tx_bytes += bytes.size();
  return client_.send_stop(bytes);
}

void SharedCarrier::on_carrier_event(const CarrierEvent& event) {
  name_ = own_->name();
  tell(event);
  // Another device may get the same device path immediately.
  const bool is_gone = event.kind == CarrierEvent::Kind::down && share_.is_path;
  if (is_gone && state_ == State::holding) lose();
}

void SharedCarrier::tell(const CarrierEvent& event) {
  const bool up = event.kind == CarrierEvent::Kind::up;
  const bool down = event.kind == CarrierEvent::Kind::down;
  const bool known = down && !up_ && trouble_ && trouble_->reason == event.problem.reason;
  if ((up || down) && up != up_) {
    up_ = up;
    if (state_ != State::holding) ++(up ? shared_counters_.ups : shared_counters_.downs);
  }
  trouble_ = up ? std::nullopt : std::optional(event.problem);
  holder_.tell(Kind::event, text_of(event));
  if (!known) handler_->on_carrier_event(event);
}

std::vector<CarrierEvent> SharedCarrier::standing() const {
  std::vector<CarrierEvent> events;
  if (up_) events.push_back({CarrierEvent::Kind::up, {ErrorKind::open, name_, "", ""}});
  if (trouble_) {
    events.push_back({up_ ? CarrierEvent::Kind::warning : CarrierEvent::Kind::down, *trouble_});
  }
  return events;
}

void SharedCarrier::on_message(const ShareMessage& message) {
  switch (message.kind) {
    case Kind::welcome:
      if (role_ == BoardRole::watch) state_ = State::joined;
      break;
    case Kind::received:
      ++shared_counters_.rx_datagrams;
      shared_counters_.rx_bytes += message.text.size();
      handler_->on_datagram(message.text, everyone);
      break;
    case Kind::sent:
      handler_->on_overheard(message.text);
      break;
    case Kind::oversize:
      ++shared_counters_.rx_oversize;
      handler_->on_oversize(message.text);
      break;
    case Kind::event: {
      CarrierEvent event = message.event;
      if (event.kind == CarrierEvent::Kind::up) name_ = event.problem.thing;
      event.problem.thing = name_;
      tell(event);
      break;
    }
    default:
      break;
  }
}

}  // namespace

std::unique_ptr<Carrier> make_shared_carrier(asio::io_context& io, std::unique_ptr<Carrier> own,
                                             Claim claim, FindShareName find, BoardRole role) {
  return std::make_unique<SharedCarrier>(io, std::move(own), std::move(claim), std::move(find),
                                         role);
}

}  // namespace r4
