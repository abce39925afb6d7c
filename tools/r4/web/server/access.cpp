// SPDX-License-Identifier: GPL-3.0-or-later
#include "access.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "r4link/error.hpp"

namespace r4::tool::web {
namespace {

constexpr std::string_view token_protocol = "r4.token.";
constexpr std::string_view bearer = "Bearer ";

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

bool is_number(std::string_view text) {
  return !text.empty() && text.size() <= 5 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_ip(const std::string& host) {
  in6_addr address{};
  return ::inet_pton(AF_INET, host.c_str(), &address) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

// "[::1]:8080" gives "::1"; empty if not HOST or HOST:PORT.
std::string name_in(std::string_view authority) {
  if (authority.starts_with('[')) {
    const std::size_t end = authority.find(']');
    if (end == std::string_view::npos) return {};
    const std::string_view rest = authority.substr(end + 1);
    if (!rest.empty() && !(rest.front() == ':' && is_number(rest.substr(1)))) return {};
    return lower(authority.substr(1, end - 1));
  }
  const std::size_t colon = authority.find(':');
  if (colon != std::string_view::npos && !is_number(authority.substr(colon + 1))) return {};
  return lower(authority.substr(0, colon));
}

}  // namespace

std::string ListenAddress::text() const {
  return host.find(':') == std::string::npos ? fmt::format("{}:{}", host, port)
                                             : fmt::format("[{}]:{}", host, port);
}

ListenAddress listen_address(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  ListenAddress address;
  const std::string port = colon == std::string::npos ? "" : text.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (colon != std::string::npos && is_number(port) && error == std::errc() &&
      end == port.data() + port.size()) {
    address.host = name_in(text);
  }
  if (address.host.empty() ||
      (text.front() != '[' && address.host.find(':') != std::string::npos)) {
    throw Error(ErrorKind::usage, "--listen " + text, "is not ADDRESS:PORT",
                "write an address such as 127.0.0.1:8080, or 0.0.0.0:8080 for other computers");
  }
  return address;
}

std::string host_name(const std::string& text) {
  const std::string name = name_in(text);
  if (name.empty() || name.find_first_of("/@? ") != std::string::npos) {
    throw Error(ErrorKind::usage, "--host " + text, "is not a valid name",
                "write a name such as robot.example, or robot.example:8443");
  }
  return lower(text);
}

bool is_loopback(std::string_view host) {
  in_addr four{};
  return host == "localhost" || host == "::1" ||
         (::inet_pton(AF_INET, std::string(host).c_str(), &four) == 1 &&
          (ntohl(four.s_addr) >> 24) == 127);
}

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw Error(ErrorKind::unsupported, "getrandom()", "does not give random bytes",
                "listen at 127.0.0.1, where no token is needed");
  }
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

bool same_secret(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned char difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference = static_cast<unsigned char>(difference | (a[i] ^ b[i]));
  }
  return difference == 0;
}

const char* to_text(Verdict verdict) {
  switch (verdict) {
    case Verdict::allowed:
      return "allowed";
    case Verdict::wrong_host:
      return "this server does not know that name; use the printed address, or start r4 web with "
             "--host";
    case Verdict::wrong_origin:
      return "the request comes from a page of another site; open the page of this server";
    default:
      return "the token is missing or wrong; use the complete printed address";
  }
}

// Unlike a name, an IP address cannot be redirected to another computer.
bool Access::is_ours(std::string_view host) const {
  const std::string name = name_in(host);
  if (name.empty()) return false;
  if (is_loopback(name) || name == lower(host_)) return true;
  if ((host_ == "0.0.0.0" || host_ == "::") && is_ip(name)) return true;
  return std::any_of(hosts_.begin(), hosts_.end(),
                     [&name](const std::string& each) { return name == name_in(each); });
}

// A proxy in front may use another name, and serve its pages encrypted.
bool Access::is_our_page(std::string_view origin) const {
  return std::any_of(hosts_.begin(), hosts_.end(), [&origin](const std::string& each) {
    return origin == "http://" + each || origin == "https://" + each;
  });
}

Verdict Access::check(std::string_view host, std::string_view origin) const {
  if (!is_ours(host)) return Verdict::wrong_host;
  if (origin.empty()) return Verdict::allowed;
  const std::string page = lower(origin);
  return page == "http://" + lower(host) || is_our_page(page) ? Verdict::allowed
                                                              : Verdict::wrong_origin;
}

Verdict Access::check_reader(std::string_view host, std::string_view origin) const {
  const Verdict verdict = check(host, origin);
  const bool allowed = std::find(origins_.begin(), origins_.end(), origin) != origins_.end();
  return verdict == Verdict::wrong_origin && allowed ? Verdict::allowed : verdict;
}

Verdict Access::check_token(std::string_view authorization, std::string_view target,
                            const std::vector<std::string>& protocols) const {
  if (token_.empty()) return Verdict::allowed;
  const auto is_it = [this](std::string_view text) { return same_secret(text, token_); };
  if (authorization.starts_with(bearer) && is_it(authorization.substr(bearer.size()))) {
    return Verdict::allowed;
  }
  constexpr std::string_view query = "?token=";
  const std::size_t at = target.find(query);
  if (at != std::string_view::npos && is_it(target.substr(at + query.size()))) {
    return Verdict::allowed;
  }
  const bool asked =
      std::any_of(protocols.begin(), protocols.end(), [&is_it](const std::string& each) {
        return std::string_view(each).starts_with(token_protocol) &&
               is_it(std::string_view(each).substr(token_protocol.size()));
      });
  return asked ? Verdict::allowed : Verdict::wrong_token;
}

}  // namespace r4::tool::web
