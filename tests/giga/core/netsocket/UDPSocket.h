// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <netsocket/SocketAddress.h>

#include <cstdint>

class NetworkInterface;

using nsapi_error_t = int;
using nsapi_size_or_error_t = int;
enum { NSAPI_ERROR_OK = 0, NSAPI_ERROR_WOULD_BLOCK = -3001, NSAPI_ERROR_NO_SOCKET = -3005 };

class UDPSocket {
 public:
  UDPSocket() = default;
  virtual ~UDPSocket();
  UDPSocket(const UDPSocket&) = delete;
  UDPSocket& operator=(const UDPSocket&) = delete;
  nsapi_error_t open(NetworkInterface* stack);
  nsapi_error_t bind(std::uint16_t port);
  void set_blocking(bool blocking);
  nsapi_error_t close();
  nsapi_size_or_error_t sendto(const SocketAddress& address, const void* data, unsigned int size);
  nsapi_size_or_error_t recvfrom(SocketAddress* address, void* data, unsigned int size);

 private:
  bool blocking_ = true;
};
