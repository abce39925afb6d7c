// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>

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
  SocketAddress(const SocketAddress& other) { *this = other; }
  SocketAddress& operator=(const SocketAddress& other) {
    addr_ = other.addr_;
    port_ = other.port_;
    return *this;
  }
  const char* get_ip_address() const;
  nsapi_addr_t get_addr() const { return addr_; }
  std::uint16_t get_port() const { return port_; }

 private:
  nsapi_addr_t addr_ = {};
  std::uint16_t port_ = 0;
  mutable std::unique_ptr<char[]> ip_address_;  // made by get_ip_address()
};
