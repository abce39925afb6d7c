// SPDX-License-Identifier: GPL-3.0-or-later
#include "network.hpp"

#include "board_clock.hpp"
namespace r4 {
namespace giga {

namespace {

constexpr std::chrono::milliseconds pause(1);

std::uint32_t number_of(const arduino::IPAddress& address) {
  std::uint32_t number = 0;
  for (int i = 0; i < 4; ++i) number = number << 8 | address[i];
  return number;
}

arduino::IPAddress address_of(std::uint32_t ip) {
  return arduino::IPAddress(static_cast<std::uint8_t>(ip >> 24),
                            static_cast<std::uint8_t>(ip >> 16), static_cast<std::uint8_t>(ip >> 8),
                            static_cast<std::uint8_t>(ip));
}

}  // namespace

void Network::start() { thread_.start(mbed::callback(&Network::run, this)); }

void Network::use(const SiteSettings& settings) {
  Wanted wanted = {};
  std::memcpy(wanted.network, settings.network, sizeof wanted.network);
  std::memcpy(wanted.password, settings.password, sizeof wanted.password);
  wanted.host = settings.host;
  wanted.udp_port = settings.udp_port;
  handed_over_.put(wanted);
}

void Network::run(Network* network) {
  for (;;) {
    if (!network->turn()) rtos::ThisThread::sleep_for(pause);
  }
}

bool Network::turn() {
  if (handed_over_.take(version_, wanted_)) {
    if (state() == NetworkState::up) leave();
    peers_.set_host(wanted_.host);
    tried_ = false;
    state_.store(wanted_.network[0] == '\0' ? NetworkState::idle : NetworkState::joining);
  }
  switch (state()) {
    case NetworkState::idle:
      return false;
    case NetworkState::joining:
      if (tried_ && BoardClock::now_ms() - tried_ms_ < retry_ms) return false;
      join();
      return true;
    case NetworkState::up:
      if (WiFi.status() != WL_CONNECTED ||
          (heard_ && BoardClock::now_ms() - heard_ms_ >= quiet_ms)) {
        leave();
        state_.store(NetworkState::joining);
        return true;
      }
      return carry();
  }
  return false;
}

void Network::join() {
  const bool open = wanted_.password[0] == '\0';
  const int status =
      open ? WiFi.begin(wanted_.network) : WiFi.begin(wanted_.network, wanted_.password);
  tried_ = true;
  tried_ms_ = BoardClock::now_ms();
  if (status != WL_CONNECTED || socket_.begin(wanted_.udp_port) != 1) return;
  heard_ = false;
  ip_.store(number_of(WiFi.localIP()));
  link_.set_up(true);
  state_.store(NetworkState::up);
}

void Network::leave() {
  link_.set_up(false);
  ip_.store(0);
  socket_.stop();
  WiFi.disconnect();
}

bool Network::carry() {
  const bool received = receive_next();
  return send_next() || received;
}

bool Network::receive_next() {
  const int size = socket_.parsePacket();
  if (size <= 0) return false;
  char buffer[udp_max_size];
  const int read = socket_.read(buffer, sizeof buffer);  // all at once: byte by byte it skips one
  if (read <= 0) return true;
  UdpAddress from;
  from.ip = number_of(socket_.remoteIP());
  from.port = socket_.remotePort();
  heard_ = true;
  heard_ms_ = BoardClock::now_ms();
  const std::uint32_t peer = peers_.heard(from, heard_ms_);
  link_.give(peer, Text(buffer, static_cast<std::size_t>(read)));
  return true;
}

bool Network::send_next() {
  std::uint32_t peer = firmware::everyone;
  char buffer[max_datagram];
  Text datagram;
  if (!link_.take(BoardClock::now_ms(), peer, buffer, datagram)) return false;
  UdpAddress to;
  if (peers_.find(peer, to) && socket_.beginPacket(address_of(to.ip), to.port) == 1) {
    socket_.write(reinterpret_cast<const std::uint8_t*>(datagram.data()), datagram.size());
    socket_.endPacket();
  }
  return true;
}

}  // namespace giga
}  // namespace r4
