// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_client.hpp"

#include <fmt/format.h>

#include <cerrno>

namespace r4 {
namespace {

constexpr int most_at_once = 64;

}  // namespace

ShareClient::Joined ShareClient::join(const ShareName& name, BoardRole role,
                                      ShareMessage::Kind greeting) {
  leave();
  process_ = 0;
  FileDescriptor connection = connect_to_holder(name, role);
  if (!connection) return would_block(errno) ? Joined::crowd : Joined::nobody;
  if (!is_one_of_us(connection.get(), name)) return Joined::stranger;
  if (send_message(connection.get(), greeting, ShareMessage::version) != 0) return Joined::nobody;
  connection_.assign(connection.get());
  process_ = process_of(connection.release());
  silence_ = 2;  // the greeting asks for an answer
  listen();
  expect_answer();
  return Joined::holder;
}

void ShareClient::listen() {
  connection_.async_wait(asio::posix::descriptor_base::wait_read,
                         readable_.handler([this] { receive(); }));
}

void ShareClient::receive() {
  const auto take = [this](const std::optional<ShareMessage>& message) {
    silence_ = 0;
    if (message) return owner_.on_message(*message);
    owner_.on_no_help(
        {ErrorKind::open, "",
         fmt::format("the program that has it open (pid {}) uses another version of R4 link",
                     process_),
         "end that program, or use the same version in both programs"});
  };
  const Received received = receive_messages(connection_, most_at_once, take);
  if (received == Received::end) {
    leave();
    return owner_.on_closed();
  }
  if (received == Received::all) owner_.on_all_heard();
  if (connection_.is_open()) listen();
}

void ShareClient::expect_answer() {
  timer_.expires_after(answer_within);
  timer_.async_wait(answering_.handler([this] {
    expect_answer();
    if (silence_ == 2) return owner_.on_no_help(silence());
    if (silence_++ == 0) return;
    send_message(connection_.native_handle(), ShareMessage::Kind::hello, ShareMessage::version);
  }));
}

Problem ShareClient::silence() const {
  const std::string pid = process_ == 0 ? "" : fmt::format(" (pid {})", process_);
  const std::string resume = process_ == 0 ? "fg" : fmt::format("kill -CONT {}", process_);
  return {ErrorKind::open, "", fmt::format("the program that has it open{} does not answer", pid),
          fmt::format("end it; if it is only stopped, you can continue it ({}), but if it controls "
                      "the board, the outputs resume",
                      resume)};
}

SendResult ShareClient::send_stop(std::string_view datagram) {
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
