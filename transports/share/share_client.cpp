// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_client.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <utility>

namespace r4 {
namespace {

constexpr int most_at_once = 64;

}  // namespace

ShareClient::Joined ShareClient::join(const ShareName& name, BoardRole role,
                                      ShareMessage::Kind greeting, const std::string& thing) {
  leave();
  thing_ = thing;
  process_ = 0;
  FileDescriptor connection = connect_to_holder(name, role);
  if (!connection) return would_block(errno) ? Joined::crowd : Joined::nobody;
  if (!is_one_of_us(connection.get(), name)) return Joined::stranger;
  if (send_message(connection.get(), greeting, ShareMessage::version) != 0) return Joined::nobody;
  connection_.assign(connection.get());
  process_ = process_of(connection.release());
  heard_ = false;
  asked_ = true;
  listen();
  expect_answer();
  return Joined::holder;
}

void ShareClient::listen() {
  connection_.async_wait(asio::posix::descriptor_base::wait_read,
                         readable_.handler([this] { receive(); }));
}

void ShareClient::receive() {
  for (int i = 0; i < most_at_once; ++i) {
    const ssize_t size =
        receive_packet(connection_.native_handle(), packet_.data(), packet_.size());
    if (size < 0 && would_block(errno)) {
      owner_.on_all_heard();
      break;
    }
    // The holder ended without reading all messages. Its own messages can be read.
    if (size < 0 && errno == ECONNRESET) continue;
    if (size <= 0) {
      leave();
      return owner_.on_closed();
    }
    heard_ = true;
    const auto message = read_share_message({packet_.data(), static_cast<std::size_t>(size)});
    if (!message) {
      return owner_.on_no_help(
          {ErrorKind::open, thing_,
           fmt::format("the program that holds it (pid {}) is of another version of R4 link",
                       process_),
           "end it, or use the same version for both"});
    }
    owner_.on_message(*message);
    if (!connection_.is_open()) return;
  }
  if (connection_.is_open()) listen();
}

void ShareClient::expect_answer() {
  timer_.expires_after(answer_within);
  timer_.async_wait(answering_.handler([this] { look_for_answer(); }));
}

void ShareClient::look_for_answer() {
  expect_answer();
  if (std::exchange(heard_, false)) {
    asked_ = false;
  } else if (!std::exchange(asked_, true)) {
    send_message(connection_.native_handle(), ShareMessage::Kind::hello, ShareMessage::version);
  } else {
    owner_.on_no_help(silence());
  }
}

Problem ShareClient::silence() const {
  if (process_ == 0) {
    return {ErrorKind::open, thing_,
            "the program that holds it does not answer, and many wait for it",
            "let it go on, if it was stopped (fg, or kill -CONT), or end it"};
  }
  return {ErrorKind::open, thing_,
          fmt::format("the program that holds it (pid {}) does not answer", process_),
          fmt::format("let it go on, if it was stopped (kill -CONT {0}), or end it", process_)};
}

SendResult ShareClient::send_stop(std::string_view datagram) {
  if (!connection_.is_open()) return SendResult::down;
  const int error = send_message(connection_.native_handle(), ShareMessage::Kind::stop, datagram);
  if (error == 0) return SendResult::sent;
  return would_block(error) ? SendResult::full : SendResult::down;
}

void ShareClient::leave() noexcept {
  readable_.cancel();
  answering_.cancel();
  asio::error_code ignored;
  connection_.close(ignored);
}

}  // namespace r4
