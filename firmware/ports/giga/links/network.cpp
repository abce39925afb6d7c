// SPDX-License-Identifier: GPL-3.0-or-later
#include "network.hpp"

#include "../../../stop_detector.hpp"
#include "../chip/board_clock.hpp"
#include "../chip/timers.hpp"

namespace r4 {
namespace giga {

namespace {

constexpr std::chrono::milliseconds pause(1);

template <class Bytes>
std::uint32_t ip_of(const Bytes& bytes) {
  std::uint32_t ip = 0;
  for (int i = 0; i < 4; ++i) ip = ip << 8 | bytes[i];
  return ip;
}

SocketAddress address_of(UdpAddress to) {
  nsapi_addr_t address = {};
  address.version = NSAPI_IPv4;
  for (int i = 0; i < 4; ++i) address.bytes[i] = static_cast<std::uint8_t>(to.ip >> (24 - 8 * i));
  return SocketAddress(address, to.port);
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

void Network::take_settings() {
  const Wanted before = wanted_;
  if (!handed_over_.take(version_, wanted_)) return;
  peers_.set_host(wanted_.host);
  const bool same = std::strcmp(wanted_.network, before.network) == 0 &&
                    std::strcmp(wanted_.password, before.password) == 0 &&
                    wanted_.udp_port == before.udp_port;
  if (same) return;
  if (state() == NetworkState::up) leave();
  tried_ = false;
  state_.store(wanted_.network[0] == '\0' ? NetworkState::idle : NetworkState::joining);
}

bool Network::turn() {
  take_settings();
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
  // begin(network) would pass a null password, from which the core copies 64 bytes.
  const int status = open ? WiFi.begin(wanted_.network, "", ENC_TYPE_NONE)
                          : WiFi.begin(wanted_.network, wanted_.password);
  tried_ = true;
  tried_ms_ = BoardClock::now_ms();
  if (status != WL_CONNECTED || socket_.open(WiFi.getNetwork()) != NSAPI_ERROR_OK) return;
  if (socket_.bind(wanted_.udp_port) != NSAPI_ERROR_OK) {
    socket_.close();
    return;
  }
  socket_.set_blocking(false);
  heard_ = false;
  ip_.store(ip_of(WiFi.localIP()));
  link_.set_up(true);
  state_.store(NetworkState::up);
}

void Network::leave() {
  link_.set_up(false);
  ip_.store(0);
  socket_.close();
  WiFi.disconnect();
}

bool Network::carry() {
  const bool received = receive_next();
  return send_next() || received;
}

bool Network::receive_next() {
  char buffer[udp_max_size];
  SocketAddress address;
  const int size = socket_.recvfrom(&address, buffer, sizeof buffer);
  if (size <= 0) return false;
  UdpAddress from;
  from.ip = ip_of(address.get_addr().bytes);
  from.port = address.get_port();
  heard_ = true;
  heard_ms_ = BoardClock::now_ms();
  const Text datagram(buffer, static_cast<std::size_t>(size));
  if (firmware::is_stop(datagram)) stop_at_once();  // the loop may be busy
  peers_.hold(link_.held(0));
  for (int i = 1; i < UdpLink::most_held; ++i) peers_.also_hold(link_.held(i));
  link_.give(peers_.heard(from, datagram), datagram);
  return true;
}

// If the stack has no room, the datagram is lost.
bool Network::send_next() {
  std::uint32_t peer = everyone;
  char buffer[max_datagram];
  Text datagram;
  if (!link_.take(BoardClock::now_ms(), peer, buffer, datagram)) return false;
  UdpAddress to[UdpPeers::most_places];
  const int places = peers_.find(peer, to);
  for (int i = 0; i < places; ++i) {
    socket_.sendto(address_of(to[i]), datagram.data(), static_cast<unsigned>(datagram.size()));
  }
  return true;
}

}  // namespace giga
}  // namespace r4
