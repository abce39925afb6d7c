// SPDX-License-Identifier: GPL-3.0-or-later
// Access control of the HTTP server, by the name typed by the user (Host) and the requesting page
// (Origin): keeps out pages of other sites, also with DNS rebinding. A token, if set, is required.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace r4::tool::web {

// ADDRESS:PORT of --listen, also "[::1]:8080". Throws Error{usage}.
struct ListenAddress {
  std::string host;  // without brackets
  std::uint16_t port = 0;
  std::string text() const;
};
ListenAddress listen_address(const std::string& text);

// NAME or NAME:PORT of --host. Throws Error{usage}.
std::string host_name(const std::string& text);

bool is_loopback(std::string_view host);

// 128 random bits in hexadecimal.
std::string random_token();

// Compares in constant time.
bool same_secret(std::string_view a, std::string_view b);

enum class Verdict : std::uint8_t { allowed, wrong_host, wrong_origin, wrong_token };
const char* to_text(Verdict verdict);

class Access {
 public:
  // `hosts`: NAME or NAME:PORT accepted besides `host`, names of this computer or of a proxy. Empty
  // `token`: not required. `origins`: foreign pages that may read by the Foxglove protocol.
  Access(std::string host, std::vector<std::string> hosts, std::string token,
         std::vector<std::string> origins)
      : host_(std::move(host)),
        hosts_(std::move(hosts)),
        token_(std::move(token)),
        origins_(std::move(origins)) {}

  // For every request. An empty origin is allowed: browsers always send a foreign page's origin.
  Verdict check(std::string_view host, std::string_view origin) const;
  // Like check(), for read-only clients of the Foxglove protocol.
  Verdict check_reader(std::string_view host, std::string_view origin) const;
  // For requests about the robot. The token is in `authorization`, `target`'s query or `protocols`.
  Verdict check_token(std::string_view authorization, std::string_view target,
                      const std::vector<std::string>& protocols) const;

 private:
  bool is_ours(std::string_view host) const;

  bool is_our_page(std::string_view origin) const;

  const std::string host_;
  const std::vector<std::string> hosts_;
  const std::string token_;
  const std::vector<std::string> origins_;
};

}  // namespace r4::tool::web
