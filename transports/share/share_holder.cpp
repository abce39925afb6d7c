// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_holder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "../../protocol/messages/command_field.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/message.hpp"
#include "share_socket.hpp"

namespace r4 {
namespace {

using Kind = ShareMessage::Kind;

constexpr int messages_in_a_turn = 8;

bool is_stop(std::string_view bytes) {
  Datagram datagram;
  return read_datagram(Text(bytes.data(), bytes.size()), datagram) && asks_to_stop(datagram);
}

}  // namespace

class ShareHolder::Sharer : public std::enable_shared_from_this<Sharer> {
 public:
  Sharer(ShareHolder& holder, LoopDescriptor connection)
      : holder_(holder), connection_(std::move(connection)) {}

  bool is_here() const { return connection_.is_open(); }
  bool is_served() const { return is_here() && served_; }
  void set_served() { served_ = true; }

  // Copies may be lost. A program that would miss any other message is disconnected.
  void tell(Kind kind, std::string_view text) {
    const int error = send_message(connection_.native_handle(), kind, text);
    if (would_block(error) && !is_copy(kind)) end();
  }

  void receive() {
    const auto self = shared_from_this();  // a stop may release the holder
    const auto take = [this](const auto& message) { holder_.on_message(*this, message); };
    if (receive_messages(connection_, messages_in_a_turn, take) == Received::end) end();
    if (!is_here()) return;
    connection_.async_wait(asio::posix::descriptor_base::wait_read,
                           readable_.handler([this] { receive(); }));
  }

  void end() noexcept {
    readable_.cancel();
    asio::error_code ignored;
    connection_.close(ignored);
  }

 private:
  ShareHolder& holder_;
  LoopDescriptor connection_;
  OperationSlot readable_;
  bool served_ = false;
};

bool ShareHolder::hold(const ShareName& name, BoardRole role) {
  LoopDescriptor listener(io_);
  if (!give_to_loop(listener, take_share_name(name, role))) return false;
  release();
  name_ = name;
  listener_ = std::move(listener);
  listen();
  return true;
}

void ShareHolder::release() noexcept {
  accepting_.cancel();
  asio::error_code ignored;
  listener_.close(ignored);
  for (const auto& sharer : std::exchange(sharers_, {})) sharer->end();
}

std::size_t ShareHolder::served() const {
  return static_cast<std::size_t>(std::count_if(
      sharers_.begin(), sharers_.end(), [](const auto& each) { return each->is_served(); }));
}

void ShareHolder::tell(Kind kind, std::string_view text) {
  if (served() == 0) return;
  std::array<char, max_datagram + masking_room> room;
  if (is_copy(kind)) {
    const Text masked = without_secrets(Text(text.substr(0, max_datagram)), room.data());
    text = {masked.data(), std::min(masked.size(), max_datagram)};
  }
  for (const auto& sharer : sharers_) {
    if (sharer->is_served()) sharer->tell(kind, text);
  }
}

void ShareHolder::listen() {
  listener_.async_wait(asio::posix::descriptor_base::wait_read,
                       accepting_.handler([this] { accept(); }));
}

void ShareHolder::accept() {
  FileDescriptor connection = accept_sharer(listener_.native_handle());
  accept_timer_.expires_after(between_arrivals);
  accept_timer_.async_wait(accepting_.handler([this] { listen(); }));
  if (!connection || !is_one_of_us(connection.get(), name_)) return;
  LoopDescriptor waited_for(io_);
  if (!give_to_loop(waited_for, std::move(connection))) return;  // the program may reconnect
  std::erase_if(sharers_, [](const auto& each) { return !each->is_here(); });
  const auto sharer = std::make_shared<Sharer>(*this, std::move(waited_for));
  sharers_.push_back(sharer);
  sharer->receive();  // its hello has usually arrived
}

void ShareHolder::on_message(Sharer& from, const std::optional<ShareMessage>& message) {
  if (message && message->kind == Kind::stop && is_stop(message->text)) {
    owner_.on_stop_of_another(message->text);
    if (!from.is_served() && served() < most_served_after_a_stop) serve(from);
  } else if (message && message->kind == Kind::hello) {
    on_hello(from);
  } else if (message && message->kind == Kind::ask) {
    owner_.on_asked();
  } else {
    from.tell(Kind::welcome, ShareMessage::version);
    from.end();
  }
}

void ShareHolder::on_hello(Sharer& from) {
  if (from.is_served()) return from.tell(Kind::welcome, ShareMessage::version);
  if (served() < most_served) return serve(from);
  const Problem full{ErrorKind::refused, "",
                     fmt::format("{} programs share it already, which is the limit", most_served),
                     "end one of these programs; its place is free at once"};
  from.tell(Kind::event, text_of({CarrierEvent::Kind::down, full}));
}

void ShareHolder::serve(Sharer& sharer) {
  sharer.set_served();
  sharer.tell(Kind::welcome, ShareMessage::version);
  for (const CarrierEvent& event : owner_.standing()) sharer.tell(Kind::event, text_of(event));
}

}  // namespace r4
