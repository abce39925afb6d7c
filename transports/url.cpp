// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/url.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "../protocol/datagram/numbers.hpp"

namespace r4 {
namespace {

constexpr char example[] = "write a URL such as udp://192.168.1.77 or serial:///dev/ttyACM0";

[[noreturn]] void refuse(std::string_view url, std::string reason, std::string fix = example) {
  throw Error(ErrorKind::usage, std::string(url), std::move(reason), std::move(fix));
}

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
char to_lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::pair<std::string_view, std::string_view> split(std::string_view text, char mark) {
  const std::size_t at = text.find(mark);
  if (at == std::string_view::npos) return {text, {}};
  return {text.substr(0, at), text.substr(at + 1)};
}

std::string decode_percent(std::string_view url, std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    std::uint32_t code = 0;
    const std::string_view digits = text.substr(i + 1, 2);
    if (digits.size() != 2 || !parse_hex(digits, code) || code == 0) {
      refuse(url, "'%" + std::string(digits) + "' is not a percent-encoded character",
             "write a percent sign as %25");
    }
    out += static_cast<char>(code);
    i += 2;
  }
  return out;
}

std::uint16_t parse_port(std::string_view url, std::string_view text) {
  std::uint32_t port = 0;
  if (!parse_number(text, port) || port > 65535) {
    refuse(url, "'" + std::string(text) + "' is not a port", "give a number from 0 to 65535");
  }
  return static_cast<std::uint16_t>(port);
}

std::string parse_host(std::string_view url, std::string_view host, bool brackets) {
  const auto allowed = [brackets](char c) {
    return is_letter(c) || is_digit(c) || c == '.' || c == '-' || c == '_' ||
           (brackets && (c == ':' || c == '%'));
  };
  if (!std::all_of(host.begin(), host.end(), allowed) || (brackets && host.empty())) {
    refuse(url, "'" + std::string(host) + "' is not a host name or address");
  }
  return std::string(host);
}

}  // namespace

Url Url::parse(std::string_view text) {
  if (printable(text) != text) refuse(text, "the URL contains control characters");
  const std::size_t colon = text.find(':');
  std::string_view scheme = text.substr(0, colon);
  const auto in_scheme = [](char c) { return is_letter(c) || is_digit(c); };
  if (colon == std::string_view::npos || scheme.empty() || !is_letter(scheme.front()) ||
      !std::all_of(scheme.begin(), scheme.end(), in_scheme)) {
    if (text.starts_with("/dev/")) {
      refuse(text, "this is a device, not a URL", "write serial://" + std::string(text));
    }
    refuse(text.empty() ? "''" : text, "the URL does not begin with a transport and a colon");
  }

  Url url;
  url.text_ = text;
  std::transform(scheme.begin(), scheme.end(), std::back_inserter(url.scheme_), to_lower);

  const std::string_view rest = text.substr(colon + 1);
  const bool has_query = rest.find('?') != std::string_view::npos;
  auto [location, query] = split(rest, '?');
  if (location.starts_with("//")) {
    location.remove_prefix(2);
    const std::size_t slash = std::min(location.find('/'), location.size());
    const std::string_view authority = location.substr(0, slash);
    location.remove_prefix(slash);
    const bool brackets = authority.starts_with('[');
    const std::size_t end = brackets ? authority.find(']') : authority.find(':');
    if (brackets && end == std::string_view::npos) refuse(text, "'[' is not closed");
    const std::string_view host =
        brackets ? authority.substr(1, end - 1) : authority.substr(0, end);
    const std::string_view tail =
        end == std::string_view::npos ? std::string_view{} : authority.substr(end + brackets);
    if (!tail.empty() && (tail.front() != ':' || tail.find(':', 1) != std::string_view::npos)) {
      refuse(text, "'" + std::string(authority) + "' is not HOST or HOST:PORT",
             "put an IPv6 address in brackets, as in udp://[fe80::1]:2018");
    }
    url.host_ = parse_host(text, host, brackets);
    if (!tail.empty()) url.port_ = parse_port(text, tail.substr(1));
  }
  url.path_ = decode_percent(text, location);

  for (bool more = has_query; more;) {
    more = query.find('&') != std::string_view::npos;
    const auto [pair, after] = split(query, '&');
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos || equals == 0) {
      refuse(text, "'" + std::string(pair) + "' is not KEY=VALUE",
             "write options as in can://can0?node=1&fd=1");
    }
    const std::string key(pair.substr(0, equals));
    if (!url.query_.emplace(key, decode_percent(text, pair.substr(equals + 1))).second) {
      refuse(text, "'" + key + "' is given twice", "give it once");
    }
    query = after;
  }
  return url;
}

std::optional<std::string> Url::get(std::string_view key) const {
  const auto found = query_.find(key);
  if (found == query_.end()) return std::nullopt;
  return found->second;
}

std::optional<std::string> Url::take(std::string_view key) {
  const auto found = query_.find(key);
  if (found == query_.end()) return std::nullopt;
  return std::move(query_.extract(found).mapped());
}

long Url::get_number(std::string_view key, long min, long max, long fallback) const {
  const std::optional<std::string> value = get(key);
  if (!value) return fallback;
  std::int32_t number = 0;
  if (!parse_number(*value, number) || number < min || number > max) {
    refuse(text_,
           "'" + std::string(key) + "=" + *value +
               (is_whole_number(*value) ? "' is out of range" : "' is not a whole number"),
           "give a whole number from " + std::to_string(min) + " to " + std::to_string(max));
  }
  return number;
}

void Url::allow_only(std::string_view allowed) const {
  for (const auto& [key, value] : query_) {
    bool known = false;
    for (std::string_view list = allowed; !list.empty() && !known;) {
      const auto [name, after] = split(list, ' ');
      known = name == key;
      list = after;
    }
    if (!known) {
      refuse(text_, scheme_ + " has no option '" + key + "'",
             allowed.empty() ? "leave it out" : "its options: " + std::string(allowed));
    }
  }
}

std::string percent_encoded(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (is_letter(c) || is_digit(c) || std::string_view("_-.:").find(c) != std::string_view::npos) {
      out += c;
    } else {
      out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  return out;
}

}  // namespace r4
