// SPDX-License-Identifier: GPL-3.0-or-later
#include "wire_holder.hpp"

#include <array>
#include <asio/post.hpp>
#include <cerrno>
#include <cstdint>
#include <optional>
#include <utility>

#include "../../protocol/messages/command_field.hpp"
#include "../file_descriptor.hpp"
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

bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK; }

bool is_stop(std::string_view bytes) {
  Datagram datagram;
  return read_datagram(Text(bytes.data(), bytes.size()), datagram) && asks_to_stop(datagram);
}

}  // namespace

// One program that shares the wire.
class WireHolder::Sharer {
 public:
  Sharer(WireHolder& holder, asio::io_context& io, FileDescriptor connection)
      : holder_(holder),
        connection_(io, connection.release()),
        writable_(io),
        queue_(normal_entries, state_entries, dropped_) {
    listen();
  }

  bool lost() const { return lost_; }
  bool welcome() const { return welcome_; }
  void set_welcome() { welcome_ = true; }

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

 private:
  void listen() {
    connection_.async_wait(asio::posix::descriptor_base::wait_read,
                           readable_.handler([this] { receive(); }));
  }

  void receive() {
    std::array<char, ShareMessage::max_size + 1> packet;
    for (int i = 0; i < messages_in_a_turn && !lost_; ++i) {
      const ssize_t size =
          receive_packet(connection_.native_handle(), packet.data(), packet.size());
      if (size < 0 && would_block(errno)) break;
      if (size < 0 && errno == ECONNRESET) continue;  // it has not read all: ours is still there
      if (size <= 0 || static_cast<std::size_t>(size) > packet.size()) return lose();
      const std::optional<ShareMessage> message =
          read_share_message({packet.data(), static_cast<std::size_t>(size)});
      if (!message) return lose();
      // The last word of one that says too much may be a stop.
      const bool too_much = !may_speak();
      if (!too_much || message->kind == Kind::stop) holder_.on_message(*this, *message);
      if (too_much) return lose();
    }
    if (!lost_) listen();
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

  // It is removed when nobody is looking at it.
  void lose() {
    if (std::exchange(lost_, true)) return;
    readable_.cancel();
    writable_.stop();
    asio::error_code ignored;
    connection_.close(ignored);
    holder_.remove_lost_later();
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
  bool welcome_ = false;
  bool gone_ = false;
  bool lost_ = false;
};

WireHolder::WireHolder(asio::io_context& io, Owner& owner, std::string program)
    : io_(io), owner_(owner), program_(std::move(program)), listener_(io) {}

WireHolder::~WireHolder() { release(); }

bool WireHolder::hold(const SharedWire& wire) {
  FileDescriptor descriptor = hold_wire(wire);
  if (!descriptor) return false;
  release();
  wire_ = wire;
  listener_.assign(descriptor.release());
  listen();
  return true;
}

void WireHolder::release() noexcept {
  wire_ = {};
  accepting_.cancel();
  removing_.cancel();
  giving_away_.cancel();
  asio::error_code ignored;
  listener_.close(ignored);
  sharers_.clear();
}

void WireHolder::tell(Kind kind, std::string_view text, Priority priority) {
  for (const auto& sharer : sharers_) {
    if (sharer->welcome()) sharer->tell(kind, text, priority);
  }
}

void WireHolder::listen() {
  listener_.async_wait(asio::posix::descriptor_base::wait_read,
                       accepting_.handler([this] { accept(); }));
}

// One that has closed its end, or is one too many, is told by the end of its connection.
void WireHolder::accept() {
  if (FileDescriptor connection = accept_sharer(listener_.native_handle(), wire_);
      connection && sharers_.size() < most_sharers) {
    sharers_.push_back(std::make_unique<Sharer>(*this, io_, std::move(connection)));
  }
  listen();
}

void WireHolder::on_message(Sharer& from, const ShareMessage& message) {
  switch (message.kind) {
    case Kind::hello:
      if (!from.welcome()) return on_hello(from, message);
      break;
    case Kind::stop:
      if (is_stop(message.text)) return owner_.on_stop_of_another(message.text);
      break;
    default:
      break;
  }
  from.bid_farewell(Kind::moved, {});  // it says what no program of ours does
}

void WireHolder::on_hello(Sharer& from, const ShareMessage& hello) {
  if (!hello.same_version) return from.bid_farewell(Kind::welcome, welcome_text(program_));
  if (hello.role == BoardRole::control) {
    if (!owner_.gives_way()) return from.bid_farewell(Kind::busy, program_);
    accepting_.cancel();
    asio::error_code ignored;
    listener_.close(ignored);  // the name is free
    from.bid_farewell(Kind::yours, {});
    for (const auto& sharer : sharers_) sharer->bid_farewell(Kind::moved, {});
    // This is called by `from`, which must not go before it returns.
    asio::post(io_, giving_away_.handler([this] {
      release();
      owner_.on_given_away();
    }));
    return;
  }
  from.set_welcome();
  from.tell(Kind::welcome, welcome_text(program_), Priority::normal);
  std::string text;
  const Kind kind = owner_.standing(text);
  from.tell(kind, text, Priority::normal);
}

void WireHolder::remove_lost_later() {
  asio::post(io_, removing_.handler([this] {
    std::erase_if(sharers_, [](const auto& sharer) { return sharer->lost(); });
  }));
}

}  // namespace r4
