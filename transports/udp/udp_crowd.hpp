// SPDX-License-Identifier: GPL-3.0-or-later
// Reads the sockets of many hosts on one loop: those that have something are found together and read one after the
// other, each by a single system call, instead of waking the loop for each.
//
//     idle --a packet comes: read at once--> ... --20,000 packets a second--> busy: read every 300 us
//       ^---------------------------------- a window with less ----------------------+
//
// One of each loop. The first few hosts of a loop do without: each packet is theirs at once.
#pragma once

#include <asio/execution_context.hpp>
#include <asio/io_context.hpp>
#include <asio/ip/udp.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string_view>

#include "../file_descriptor.hpp"
#include "../operation_slot.hpp"

namespace r4 {

class UdpCrowd final : public asio::execution_context::service {
 public:
  using Endpoint = asio::ip::udp::endpoint;
  using key_type = UdpCrowd;
  static asio::execution_context::id id;
  static constexpr std::size_t few = 8;  // hosts that do without
  static constexpr std::chrono::microseconds pause{300};

  // Whose socket is read. It must leave before it goes, and before the loop does.
  class Member {
   public:
    // A packet, of which `bytes` is the beginning where it is longer than a datagram may be.
    virtual void on_packet(std::string_view bytes, const Endpoint& from) = 0;
    virtual void on_all_read() = 0;

   protected:
    ~Member() = default;

   private:
    friend UdpCrowd;
    int watched_ = -1;  // its socket
  };

  explicit UdpCrowd(asio::execution_context& context);
  ~UdpCrowd() override;

  static UdpCrowd& of(asio::io_context& io) { return asio::use_service<UdpCrowd>(io); }

  // A host opens a socket, or closes it. Is it one of many now?
  bool enter();
  void leave() { --hosts_; }

  // Reads that socket, which no reactor may watch, from now on. False: the system does not, as errno tells.
  bool read(int socket, Member& member);
  // No call of that member follows; before its socket is closed. Can be called twice.
  void stop(Member& member);

 private:
  struct Batch;

  void shutdown() noexcept override;
  void wait();
  void turn();
  bool drain(std::size_t event);
  void count_packets();

  asio::io_context& io_;
  std::size_t hosts_ = 0;
  std::size_t members_ = 0;
  FileDescriptor ready_;  // an epoll of the members' sockets
  std::unique_ptr<Batch> batch_;
  LoopDescriptor idle_;  // ready_, while each packet is waited for
  LoopTimer timer_;
  OperationSlot waiting_;
  bool busy_ = false;
  std::size_t packets_ = 0;  // in this window
  std::chrono::steady_clock::time_point since_;
};

}  // namespace r4
