// SPDX-License-Identifier: GPL-3.0-or-later
// The URL of a board: the grammar for every transport (docs/reference/transports.md).
//     url    = scheme ":" ["//" authority] [path] ["?" key "=" value *("&" key "=" value)]
//     scheme = udp | serial | pty | sim | …        authority = HOST[:PORT] | [IPv6][:PORT]
//
// Percent-encoding is decoded in path and values.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "../config.hpp"
#include "../error.hpp"

namespace r4 {

class Url {
 public:
  // Throws Error{usage} with the URL and the fault.
  R4LINK_API static Url parse(std::string_view text);

  const std::string& text() const { return text_; }  // the text that was parsed
  const std::string& scheme() const { return scheme_; }
  const std::string& host() const { return host_; }  // without brackets
  std::optional<std::uint16_t> port() const { return port_; }
  const std::string& path() const { return path_; }  // "/dev/ttyACM0", "auto", "can0"

  R4LINK_API std::optional<std::string> get(std::string_view key) const;
  // Returns the value of a key and removes the key.
  R4LINK_API std::optional<std::string> take(std::string_view key);
  // The value as a whole number, or `fallback`. Throws Error{usage} unless it is within [min, max].
  R4LINK_API long get_number(std::string_view key, long min, long max, long fallback) const;
  // Throws Error{usage} naming the first key that is not in the space-separated `allowed`.
  R4LINK_API void allow_only(std::string_view allowed) const;

 private:
  std::string text_, scheme_, host_, path_;
  std::optional<std::uint16_t> port_;
  std::map<std::string, std::string, std::less<>> query_;
};

// The text as a value in a URL: characters with a meaning in a URL, shell or terminal become %NN.
R4LINK_API std::string percent_encoded(std::string_view text);

}  // namespace r4
