// SPDX-License-Identifier: GPL-3.0-or-later
#include "wire_sharer.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <optional>
#include <utility>

#include "../file_descriptor.hpp"

namespace r4 {
namespace {

constexpr int most_at_once = 64;

}  // namespace

WireSharer::Joined WireSharer::join(const SharedWire& wire, BoardRole role,
                                    std::string_view program, std::chrono::milliseconds within) {
  ReachedHolder reached = reach_holder(wire, within);
  if (reached.hangs) return Joined::hanging;
  FileDescriptor connection = std::move(reached.connection);
  if (!connection) return Joined::none;
  const ShareCredentials there = credentials_of(connection.get());
  if (!is_one_of_us(connection.get(), wire)) {
    stranger_ = there;
    return Joined::stranger;
  }
  if (send_message(connection.get(), ShareMessage::Kind::hello, hello_text(role, program)) != 0) {
    return Joined::none;
  }
  leave();
  holder_ = there;
  connection_.assign(connection.get());
  static_cast<void>(connection.release());
  return Joined::holder;
}

std::optional<ShareMessage> WireSharer::wait_for_answer(std::chrono::milliseconds within) {
  pollfd waiting{connection_.native_handle(), POLLIN, 0};
  int ready = 0;
  do {
    ready = ::poll(&waiting, 1, static_cast<int>(within.count()));
  } while (ready < 0 && errno == EINTR);
  if (ready <= 0) return std::nullopt;
  const ssize_t size = receive_packet(connection_.native_handle(), packet_.data(), packet_.size());
  if (size <= 0) {
    ShareMessage ended;  // before it saw us
    ended.kind = ShareMessage::Kind::moved;
    return ended;
  }
  std::optional<ShareMessage> message =
      read_share_message({packet_.data(), static_cast<std::size_t>(size)});
  if (!message) message.emplace().same_version = false;
  return message;
}

std::string WireSharer::holder(std::string_view program) const {
  return fmt::format("{} (pid {})", program, holder_.pid);
}

Problem WireSharer::silence(const std::string& thing) const {
  if (holder_.pid == ::getpid()) {
    return {ErrorKind::open, thing, "this program has it open already",
            "use that one, or close it first"};
  }
  return {ErrorKind::open, thing,
          fmt::format("the program that holds it (pid {}) does not answer", holder_.pid),
          fmt::format("let it go on, if it was stopped (kill -CONT {0}), or end it", holder_.pid)};
}

Problem WireSharer::silence_of_another(const std::string& thing) {
  return {ErrorKind::open, thing, "the program that holds it does not answer, and many wait for it",
          "let it go on, if it was stopped (fg, or kill -CONT), or end it"};
}

Problem WireSharer::other_version(const std::string& thing) const {
  return {ErrorKind::open, thing,
          fmt::format("the program that holds it (pid {}) is of another version of R4 link",
                      holder_.pid),
          "end it, or use the same version for both"};
}

Problem WireSharer::turned_away(const std::string& thing) const {
  return {ErrorKind::open, thing,
          fmt::format("the program that holds it (pid {}) does not share it", holder_.pid),
          "end it, or try again"};
}

Problem WireSharer::stranger(const std::string& thing, const SharedWire& wire) const {
  const std::string sharers = wire.group.name.empty() ? fmt::format("user {}", ::geteuid())
                                                      : "the group " + wire.group.name;
  return {ErrorKind::permission, thing,
          fmt::format("user {} (pid {}) has taken the names by which programs of {} share it",
                      stranger_.uid, stranger_.pid, sharers),
          "it works, but for this program alone; have that program ended, and begin again"};
}

void WireSharer::listen() {
  connection_.async_wait(asio::posix::descriptor_base::wait_read,
                         readable_.handler([this] { receive(); }));
}

void WireSharer::receive() {
  for (int i = 0; i < most_at_once; ++i) {
    const ssize_t size =
        receive_packet(connection_.native_handle(), packet_.data(), packet_.size());
    if (size < 0 && would_block(errno)) {
      owner_.on_all_heard();
      break;
    }
    if (size < 0 && errno == ECONNRESET)
      continue;  // it has not read all: what it said is still there
    if (size <= 0 || static_cast<std::size_t>(size) > packet_.size()) return lost();
    const std::optional<ShareMessage> message =
        read_share_message({packet_.data(), static_cast<std::size_t>(size)});
    if (!message) return lost();
    owner_.on_message(*message);
    if (!connection_.is_open()) return;  // left by it
  }
  if (connection_.is_open()) listen();
}

SendResult WireSharer::send_stop(std::string_view datagram) {
  if (!connection_.is_open()) return SendResult::down;
  const int error = send_message(connection_.native_handle(), ShareMessage::Kind::stop, datagram);
  if (error == 0) return SendResult::sent;
  return would_block(error) ? SendResult::full : SendResult::down;
}

void WireSharer::ask_whether_alive() {
  send_message(connection_.native_handle(), ShareMessage::Kind::alive, {});
}

void WireSharer::lost() {
  leave();
  owner_.on_holder_lost();
}

void WireSharer::leave() noexcept {
  readable_.cancel();
  asio::error_code ignored;
  connection_.close(ignored);
}

}  // namespace r4
