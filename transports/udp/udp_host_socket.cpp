// SPDX-License-Identifier: GPL-3.0-or-later
#include "udp_host_socket.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <mutex>
#include <vector>

namespace r4 {
namespace {

// Boards may have a thread each. Never destroyed, because a board may be a static object.
struct Bound {
  std::mutex mutex;
  std::vector<UdpHostSocket*> sockets;
};
Bound& bound() {
  static Bound& of_this_process = *new Bound;
  return of_this_process;
}

}  // namespace

asio::error_code UdpHostSocket::bind(const Endpoint& local, const Endpoint& board) {
  Bound& all = bound();
  const std::lock_guard lock(all.mutex);
  asio::error_code error;
  local_ = local;
  board_ = board;
  connected_ = false;
  std::vector<UdpHostSocket*> others;
  for (UdpHostSocket* const each : all.sockets) {
    if (each->local_ != local_) continue;
    if (each->board_ == board) return asio::error::already_open;
    others.push_back(each);
  }
  if (others.empty()) {
    socket_.bind(local_, error);
  } else {
    // Only during bind(), because another program must not share the port.
    const auto share = [&](bool on) {
      const UdpSocket::reuse_address option(on);
      asio::error_code ignored;
      socket_.set_option(option, ignored);
      for (UdpHostSocket* const each : others) each->socket_.set_option(option, ignored);
    };
    share(true);
    socket_.bind(local_, error);
    if (!error) socket_.connect(board, error);
    share(false);
    connected_ = true;
  }
  if (!error) local_.port(socket_.local_endpoint(error).port());
  if (!error) all.sockets.push_back(this);
  return error;
}

void UdpHostSocket::close() noexcept {
  // Under the lock, the next bind() finds the port either free or shared.
  Bound& all = bound();
  const std::lock_guard lock(all.mutex);
  std::erase(all.sockets, this);
  asio::error_code ignored;
  socket_.close(ignored);
}

int UdpHostSocket::reconnect() {
  if (!connected_) return 0;
  sockaddr none{};
  none.sa_family = AF_UNSPEC;
  const int socket = socket_.native_handle();
  const bool done = ::connect(socket, &none, sizeof none) == 0 &&
                    ::connect(socket, board_.data(), static_cast<socklen_t>(board_.size())) == 0;
  return done ? 0 : errno;
}

}  // namespace r4
