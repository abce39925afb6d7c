// SPDX-License-Identifier: GPL-3.0-or-later
#include "wire_holder.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <asio/post.hpp>
#include <cerrno>
#include <cstdint>
#include <optional>
#include <utility>

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/settings.hpp"
#include "../send_queue.hpp"
#include "../writable_wait.hpp"
#include "r4link/datagram.hpp"
#include "share_socket.hpp"

namespace r4 {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = ShareMessage::Kind;

constexpr std::size_t normal_entries = 32;
constexpr std::size_t state_entries = 8;
constexpr int messages_in_a_turn = 8;
constexpr const char* same_version = "use the same version of R4 link for both";

bool is_stop(std::string_view bytes) {
  Datagram datagram;
  return read_datagram(Text(bytes.data(), bytes.size()), datagram) && asks_to_stop(datagram);
}

}  // namespace

// One program that has come to the wire.
class WireHolder::Sharer : public std::enable_shared_from_this<Sharer> {
 public:
  enum class Standing { silent, turned_away, welcome };

  Sharer(WireHolder& holder, asio::io_context& io, LoopDescriptor connection)
      : holder_(holder),
        connection_(std::move(connection)),
        writable_(io),
        queue_(normal_entries, state_entries, dropped_) {}

  bool lost() const { return lost_; }
  Clock::time_point came() const { return came_; }
  void set_standing(Standing standing) { standing_ = standing; }
  bool is(Standing standing) const { return !lost_ && standing_ == standing; }
  bool waits() const { return !lost_ && standing_ != Standing::welcome; }

  bool has_left() {
    pollfd connection{connection_.native_handle(), 0, 0};
    return ::poll(&connection, 1, 0) > 0;
  }

  void tell(Kind kind, std::string_view text, Priority priority) {
    if (lost_ || gone_) return;
    const Clock::time_point now = Clock::now();
    if (queue_.empty()) {
      const int error = send_message(connection_.native_handle(), kind, text);
      if (error == 0) return;
      if (!would_block(error)) return hear_out();
      stuck_since_ = now;
    } else if (now - stuck_since_ > patience) {
      return lose();
    }
    queue_.push(text, priority, static_cast<Peer>(kind), now);
    writable_.start(connection_.native_handle(), [this] { send_waiting(); });
  }

  // The last word to it: it goes out at once or not at all.
  void bid_farewell(Kind kind, std::string_view text) {
    if (!lost_) send_message(connection_.native_handle(), kind, text);
    lose();
  }
  void refuse(const std::string& reason, const std::string& fix) {
    bid_farewell(Kind::down, refusal(reason, fix));
  }
  std::string refusal(const std::string& reason, const std::string& fix) const {
    return problem_text({ErrorKind::refused, holder_.owner_.name(), reason, fix});
  }

  // What has come from it, and what will.
  void receive() {
    const auto self = shared_from_this();  // who hears of a stop may close the wire
    std::array<char, ShareMessage::max_size + 1> packet;
    for (int i = 0; i < messages_in_a_turn && !lost_; ++i) {
      const ssize_t size =
          receive_packet(connection_.native_handle(), packet.data(), packet.size());
      if (size < 0 && would_block(errno)) break;
      if (size < 0 && errno == ECONNRESET) continue;  // it has not read all: ours is still there
      if (size <= 0) return lose();
      const std::string_view bytes(packet.data(),
                                   std::min(static_cast<std::size_t>(size), packet.size()));
      const std::optional<ShareMessage> message = read_share_message(bytes);
      if (!message) return refuse("what was said to it is no message", same_version);
      // The last word of one that says too much may be a stop.
      const bool too_much = !may_speak();
      if (!too_much || message->kind == Kind::stop) holder_.on_message(*this, *message);
      if (too_much) {
        return refuse(fmt::format("it was told more than {} things in a second", most_messages),
                      "stop it once: that is repeated until the board obeys");
      }
    }
    if (!lost_) listen();
  }

  // It waits no longer. What it has said is heard.
  void cut_off() {
    receive();
    if (is(Standing::silent))
      refuse("the program that came to share it said nothing", same_version);
    if (waits()) lose();
  }

  void end() noexcept {
    lost_ = true;
    readable_.cancel();
    writable_.stop();
    asio::error_code ignored;
    connection_.close(ignored);
  }

 private:
  // It is removed when nobody is looking at it.
  void lose() {
    if (lost_) return;
    end();
    holder_.remove_lost_later();
  }

  void listen() {
    connection_.async_wait(asio::posix::descriptor_base::wait_read,
                           readable_.handler([this] { receive(); }));
  }

  bool may_speak() {
    const Clock::time_point now = Clock::now();
    if (now - counted_since_ >= std::chrono::seconds(1)) {
      counted_since_ = now;
      messages_ = 0;
    }
    return ++messages_ <= most_messages;
  }

  void send_waiting() {
    while (const SendQueue::Entry* const entry = queue_.front(Clock::now())) {
      const int error =
          send_message(connection_.native_handle(), static_cast<Kind>(entry->to), entry->text());
      if (error != 0 && !would_block(error)) return hear_out();
      if (error != 0) {
        writable_.start(connection_.native_handle(), [this] { send_waiting(); });
        return;
      }
      stuck_since_ = Clock::now();
      queue_.pop();
    }
    writable_.stop();
  }

  // It has ended. What it said before is still read: it may be a stop.
  void hear_out() {
    gone_ = true;
    writable_.stop();
  }

  WireHolder& holder_;
  LoopDescriptor connection_;
  OperationSlot readable_;
  WritableWait writable_;
  std::uint64_t dropped_ = 0;
  SendQueue queue_;  // `to` is the kind
  Clock::time_point stuck_since_;
  Clock::time_point counted_since_;
  int messages_ = 0;
  const Clock::time_point came_ = Clock::now();
  Standing standing_ = Standing::silent;
  bool gone_ = false;
  bool lost_ = false;
};

template <class Which>
std::size_t WireHolder::count(Which which) const {
  return static_cast<std::size_t>(std::count_if(sharers_.begin(), sharers_.end(),
                                                [&](const auto& each) { return which(*each); }));
}

WireHolder::WireHolder(asio::io_context& io, Owner& owner, std::string program)
    : io_(io),
      owner_(owner),
      program_(std::move(program)),
      listener_(io),
      accept_timer_(io),
      cut_off_timer_(io) {}

WireHolder::~WireHolder() { release(); }

bool WireHolder::hold(const SharedWire& wire) {
  LoopDescriptor listener = on_loop(hold_wire(wire));
  if (!listener.is_open()) return false;
  release();
  listen_at(std::move(listener), wire);
  return true;
}

bool WireHolder::rename(const SharedWire& wire) {
  if (wire.name.empty()) {
    stop_listening();
    return true;
  }
  LoopDescriptor listener = on_loop(hold_wire(wire));
  if (!listener.is_open()) return false;
  stop_listening();
  listen_at(std::move(listener), wire);
  return true;
}

// Closed, with errno, if the loop cannot wait for it: an error here must not end the program, which may be driving.
LoopDescriptor WireHolder::on_loop(FileDescriptor descriptor) {
  LoopDescriptor waited_for(io_);
  if (!descriptor) return waited_for;
  asio::error_code error;
  waited_for.assign(descriptor.get(), error);
  if (!error) static_cast<void>(descriptor.release());
  errno = error.value();
  return waited_for;
}

void WireHolder::listen_at(LoopDescriptor listener, const SharedWire& wire) {
  wire_ = wire;
  listener_ = std::move(listener);
  listen();
}

void WireHolder::stop_listening() noexcept {
  wire_ = {};
  accepting_.cancel();
  asio::error_code ignored;
  listener_.close(ignored);
}

void WireHolder::release() noexcept {
  stop_listening();
  for (const auto& sharer : sharers_) sharer->end();
  sharers_.clear();
  removing_.cancel();
  giving_away_.cancel();
  cutting_off_.cancel();
}

std::size_t WireHolder::sharers() const {
  return count([](const Sharer& each) { return each.is(Sharer::Standing::welcome); });
}

void WireHolder::tell(Kind kind, std::string_view text, Priority priority) {
  if (sharers_.empty()) return;
  std::array<char, max_datagram + masking_room> room;
  if (kind == Kind::sent || kind == Kind::received || kind == Kind::oversize) {
    const Text masked = without_secrets(Text(text.substr(0, max_datagram)), room.data());
    text = {masked.data(), std::min(masked.size(), max_datagram)};
  }
  for (const auto& sharer : sharers_) {
    if (sharer->is(Sharer::Standing::welcome)) sharer->tell(kind, text, priority);
  }
}

void WireHolder::listen() {
  listener_.async_wait(asio::posix::descriptor_base::wait_read,
                       accepting_.handler([this] { accept(); }));
}

void WireHolder::accept() {
  const Clock::time_point now = Clock::now();
  if (now - window_began_ >= arrival_window) {
    window_began_ = now;
    arrivals_ = 0;
  }
  if (arrivals_ == most_arrivals) return accept_at(window_began_ + arrival_window);
  ++arrivals_;
  FileDescriptor connection = accept_sharer(listener_.native_handle());
  // Without a descriptor the program goes on waiting, and the loop would be woken for it at once.
  if (!connection && !would_block(errno)) return accept_at(now + accept_again);
  if (connection && may_come(connection.get(), wire_)) take_in(std::move(connection));
  if (listener_.is_open()) listen();
}

void WireHolder::accept_at(Clock::time_point time) {
  accept_timer_.expires_at(time);
  accept_timer_.async_wait(accepting_.handler([this] { accept(); }));
}

void WireHolder::take_in(FileDescriptor connection) {
  LoopDescriptor waited_for = on_loop(std::move(connection));
  if (!waited_for.is_open()) return;  // it is let go, and may come again
  const auto sharer = std::make_shared<Sharer>(*this, io_, std::move(waited_for));
  sharers_.push_back(sharer);
  sharer->receive();  // what it comes for is there already, mostly
  if (count([](const Sharer& each) { return each.waits(); }) > most_waiting)
    longest_waiting()->cut_off();
  cut_off_in_time();
}

// Null: nobody waits.
std::shared_ptr<WireHolder::Sharer> WireHolder::longest_waiting() const {
  const auto found = std::find_if(sharers_.begin(), sharers_.end(),
                                  [](const auto& each) { return each->waits(); });
  return found == sharers_.end() ? nullptr : *found;
}

void WireHolder::cut_off_in_time() {
  const Clock::time_point now = Clock::now();
  std::shared_ptr<Sharer> first;
  while ((first = longest_waiting()) && now - first->came() >= patience) first->cut_off();
  if (!first) return cutting_off_.cancel();
  cut_off_timer_.expires_at(first->came() + patience);
  cut_off_timer_.async_wait(cutting_off_.handler([this] { cut_off_in_time(); }));
}

void WireHolder::on_message(Sharer& from, const ShareMessage& message) {
  switch (message.kind) {
    case Kind::hello:
      if (from.is(Sharer::Standing::silent)) return on_hello(from, message);
      break;
    case Kind::stop:
      if (is_stop(message.text)) return on_stop(from, message.text);
      break;
    case Kind::alive:
      return from.tell(Kind::alive, {}, Priority::normal);
    default:
      break;
  }
  from.refuse(
      "who watches may say nothing to the board but a stop",
      "control the board; or, if it did not mean to, use the same version of R4 link for both");
}

void WireHolder::on_hello(Sharer& from, const ShareMessage& hello) {
  if (!hello.same_version) return from.bid_farewell(Kind::welcome, welcome_text(program_));
  if (hello.role == BoardRole::control) {
    // It may have waited in vain, while this program hung.
    if (from.has_left()) return from.bid_farewell(Kind::moved, {});
    if (!owner_.gives_way()) return from.bid_farewell(Kind::busy, program_);
    return give_away(from);
  }
  if (sharers() < most_sharers) return welcome(from);
  from.set_standing(Sharer::Standing::turned_away);
  from.tell(Kind::down,
            from.refusal(fmt::format("{} programs share it already, as many as may", most_sharers),
                         "end one of them; its place is free at once"),
            Priority::normal);
}

void WireHolder::on_stop(Sharer& from, std::string_view datagram) {
  owner_.on_stop_of_another(datagram);
  if (from.is(Sharer::Standing::turned_away) && sharers() < most_sharers + most_stoppers)
    welcome(from);
}

void WireHolder::welcome(Sharer& sharer) {
  sharer.set_standing(Sharer::Standing::welcome);
  sharer.tell(Kind::welcome, welcome_text(program_), Priority::normal);
  std::string text;
  const Kind kind = owner_.standing(text);
  sharer.tell(kind, text, Priority::normal);
}

void WireHolder::give_away(Sharer& to) {
  stop_listening();  // the name is free
  to.bid_farewell(Kind::yours, {});
  for (const auto& sharer : sharers_) sharer->bid_farewell(Kind::moved, {});
  // This is called by `to`, which must not go before it returns.
  asio::post(io_, giving_away_.handler([this] {
    release();
    owner_.on_given_away();
  }));
}

void WireHolder::remove_lost_later() {
  asio::post(io_, removing_.handler([this] {
    std::erase_if(sharers_, [](const auto& sharer) { return sharer->lost(); });
  }));
}

}  // namespace r4
