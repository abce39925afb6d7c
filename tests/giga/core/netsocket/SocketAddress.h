// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

enum nsapi_version_t { NSAPI_UNSPEC, NSAPI_IPv4, NSAPI_IPv6 };
struct nsapi_addr_t {
  nsapi_version_t version;
  std::uint8_t bytes[16];
};

class SocketAddress {
 public:
  SocketAddress() = default;
  SocketAddress(const nsapi_addr_t& addr, std::uint16_t port = 0)  // NOLINT
      : addr_(addr), port_(port) {}
  SocketAddress(const char* addr, std::uint16_t port = 0);  // NOLINT
  SocketAddress(const void* bytes, nsapi_version_t version, std::uint16_t port = 0);
  nsapi_addr_t get_addr() const { return addr_; }
  std::uint16_t get_port() const { return port_; }

 private:
  nsapi_addr_t addr_ = {};
  std::uint16_t port_ = 0;
};
