// SPDX-License-Identifier: GPL-3.0-or-later
// The common part of udp_host.hpp and udp_board.hpp: socket, queue and state of the network.
#pragma once

#include <array>
#include <asio/io_context.hpp>
#include <asio/ip/udp.hpp>
#include <string>
#include <string_view>

#include "../operation_slot.hpp"
#include "../send_queue.hpp"
#include "../writable_wait.hpp"
#include "network/udp_route.hpp"
#include "r4link/carrier.hpp"
#include "r4link/datagram.hpp"
#include "udp_host_socket.hpp"
#include "udp_url.hpp"

namespace r4 {

// More than 15 data members: the socket with timers and waits, the queue, the network's state.
class UdpEnd : public Carrier {
 public:
  void close() noexcept override;
  SendResult send(std::string_view bytes, Priority priority, Peer to) override;
  bool up() const override { return up_; }
  const std::string& name() const override { return name_; }
  const CarrierCounters& counters() const override { return counters_; }

 protected:
  using Endpoint = asio::ip::udp::endpoint;

  UdpEnd(asio::io_context& io, UdpUrl url);

  // `full`: the socket takes no packet now.
  virtual SendResult transmit(std::string_view bytes, Peer to) = 0;
  // 0 if the network is up, else errno.
  virtual int probe(const std::vector<OwnAddress>& own) = 0;
  virtual void close_socket() noexcept;
  virtual void listen() = 0;

  // Opens the socket without binding it. Throws Error.
  void open_socket(const Endpoint& local, bool v6_only);
  // Closes the socket and throws why it cannot be bound. `fix`: for a port of another program.
  [[noreturn]] void refuse(const asio::error_code& error, const Endpoint& local,
                           const std::string& fix);
  // The socket is bound: begins to receive, and is up.
  void begin(Handler& handler);
  void hand_over(std::string_view bytes, Peer from);
  // `standing`: `to` is the destination for everyone, so a failed packet shows a lost network.
  // `from`: an address of this computer; unspecified: any.
  SendResult transmit_to(std::string_view bytes, const Endpoint& to, bool standing,
                         const asio::ip::address& from = {});
  void set_up(bool up);
  // Goes up or down by the result of probe(). Ignores errors that are not of the network.
  void check_network(const std::vector<OwnAddress>& own);
  // Reports a change of the status, or of the reason why it is down.
  void report();
  void warn(const std::string& reason, const std::string& fix);

  Problem no_route(const std::string& subject, int error) const;

  asio::io_context& io_;
  const UdpUrl url_;
  std::string name_;
  Handler* handler_ = nullptr;
  UdpSocket socket_;
  OperationSlot reception_;
  WritableWait writable_;
  CarrierCounters counters_;
  Endpoint sender_;
  Problem why_down_;
  std::array<char, max_datagram> received_;

 private:
  void send_waiting();
  void lose_network(int error);
  void report_later();
  void probe_later();

  LoopTimer probe_timer_;
  OperationSlot probe_;
  bool up_ = false;
  bool cut_ = false;       // the interface does not work, though the system may accept packets
  std::string reported_;   // "up", or why it is down
  int refused_error_ = 0;  // why the system refused the last packet; 0 after a success
  int reported_refusal_ = 0;
  OperationSlot reporting_;
  SendQueue queue_;
};

// The host as in a URL: "[::1]" for an IPv6 address.
std::string bracketed(const std::string& host);

}  // namespace r4
