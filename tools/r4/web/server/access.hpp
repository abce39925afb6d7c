// SPDX-License-Identifier: GPL-3.0-or-later
// Who may ask the HTTP server. A browser tells which name its user typed (Host) and which page asks (Origin); that keeps
// away pages of other sites, also those whose name was made to point here (DNS rebinding). Where there is a token, it is
// needed as well.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace r4::tool::web {

// ADDRESS:PORT as --listen has it, "[::1]:8080" too. Throws Error{usage}.
struct ListenAddress {
  std::string host;  // without brackets
  std::uint16_t port = 0;
  std::string text() const;
};
ListenAddress listen_address(const std::string& text);

// NAME or NAME:PORT as --host has it. Throws Error{usage}.
std::string host_name(const std::string& text);

// 127.0.0.1, ::1, localhost: nobody on another computer gets there.
bool is_loopback(std::string_view host);

// 128 random bits as hexadecimal digits.
std::string random_token();

// In a time that does not tell where they differ.
bool same_secret(std::string_view a, std::string_view b);

enum class Verdict : std::uint8_t { allowed, wrong_host, wrong_origin, wrong_token };
const char* to_text(Verdict verdict);

class Access {
 public:
  // `hosts`: NAME or NAME:PORT by which the server is asked besides the address that it listens at, `host`: names of
  // this computer, and that of a proxy in front. An empty token: none is needed. `origins`: pages of others that may
  // read by the Foxglove protocol.
  Access(std::string host, std::vector<std::string> hosts, std::string token,
         std::vector<std::string> origins)
      : host_(std::move(host)),
        hosts_(std::move(hosts)),
        token_(std::move(token)),
        origins_(std::move(origins)) {}

  // Of any request. An empty origin: there is none, for no browser sends a foreign page's request without it.
  Verdict check(std::string_view host, std::string_view origin) const;
  // The same for who only reads, by the Foxglove protocol.
  Verdict check_reader(std::string_view host, std::string_view origin) const;
  // Of what tells something of the robot: `authorization` is that header, `target` the path with its query,
  // `protocols` the subprotocols that a WebSocket asks for. One of them has the token.
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
