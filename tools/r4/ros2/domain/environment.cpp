// SPDX-License-Identifier: GPL-3.0-or-later
#include "environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "r4link/error.hpp"
#include "this_computer.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr std::uint32_t last_domain = 232;  // higher domains have no valid ports

enum class Range { localhost, subnet, off, system };

Error wrong(const char* variable, const std::string& value, const std::string& fix) {
  return {ErrorKind::usage, fmt::format("{}={}", variable, value), "cannot be", fix};
}

std::uint32_t domain_id(const Environment& environment) {
  const std::string text = environment("ROS_DOMAIN_ID");
  if (text.empty()) return 0;
  std::uint32_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc() || end != text.data() + text.size() || id > last_domain) {
    throw wrong("ROS_DOMAIN_ID", text, fmt::format("set it to a number from 0 to {}", last_domain));
  }
  return id;
}

Range range_of(const Environment& environment) {
  const std::string only = environment("ROS_LOCALHOST_ONLY");
  if (only == "1") return Range::localhost;
  if (!only.empty() && only != "0") {
    throw wrong("ROS_LOCALHOST_ONLY", only, "set it to 1 or 0");
  }
  const std::string range = environment("ROS_AUTOMATIC_DISCOVERY_RANGE");
  if (range == "SUBNET") return Range::subnet;
  if (range == "OFF") return Range::off;
  if (range == "SYSTEM_DEFAULT") return Range::system;
  if (!range.empty() && range != "LOCALHOST") {
    throw wrong("ROS_AUTOMATIC_DISCOVERY_RANGE", range,
                "set it to LOCALHOST, SUBNET, OFF or SYSTEM_DEFAULT");
  }
  return range.empty() && only == "0" ? Range::subnet : Range::localhost;
}

bool is_address_character(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
         c == ':' || c == '-' || c == '_' || c == '%';
}

std::vector<std::string> static_peers(const Environment& environment) {
  const std::string text = environment("ROS_STATIC_PEERS");
  std::vector<std::string> peers;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t end = std::min(rest.find(';'), rest.size());
    const std::string peer(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (peer.empty()) continue;
    if (!std::all_of(peer.begin(), peer.end(), is_address_character)) {
      throw wrong("ROS_STATIC_PEERS", text, "write addresses, separated by semicolons");
    }
    peers.push_back(peer);
  }
  return peers;
}

std::string configuration(const std::string& general, const std::vector<std::string>& peers) {
  std::string list;
  for (const std::string& peer : peers) list += fmt::format("<Peer Address=\"{}\"/>", peer);
  if (!list.empty()) list = "<Peers>" + list + "</Peers>";
  // Participants on one computer use successive ports; without multicast each port must be tried.
  constexpr std::string_view index =
      "<ParticipantIndex>auto</ParticipantIndex>"
      "<MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>";
  // Fast DDS needs the key hash to notice that our participants leave before their lease ends.
  constexpr std::string_view internal =
      "<Internal><GenerateKeyhash>true</GenerateKeyhash></Internal>";
  return fmt::format(
      "<CycloneDDS><Domain><General>{}</General><Discovery>{}{}</Discovery>{}</Domain></"
      "CycloneDDS>",
      general, index, list, internal);
}

std::string elements(const std::vector<std::string>& interfaces) {
  std::string list;
  for (const std::string& name : interfaces) {
    list += fmt::format("<NetworkInterface name=\"{}\" multicast=\"{}\"/>", name, name == "lo");
  }
  return list;
}

}  // namespace

std::string process_environment(const char* name) {
  const char* const value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): r4 sets none
  return value == nullptr ? "" : value;
}

Domain domain_of(const Environment& environment) {
  Domain domain;
  domain.id = domain_id(environment);
  if (!environment("CYCLONEDDS_URI").empty()) {
    domain.reach = "as CYCLONEDDS_URI says";
    return domain;
  }
  const Range range = range_of(environment);
  std::vector<std::string> peers =
      range == Range::off ? std::vector<std::string>() : static_peers(environment);
  const std::string named = fmt::format("this computer and {}", fmt::join(peers, ", "));
  switch (range) {
    case Range::localhost:
      if (peers.empty()) {
        domain.reach = "this computer";
        domain.one_computer = true;
        domain.configuration = configuration(
            fmt::format("<Interfaces>{}</Interfaces><AllowMulticast>spdp</AllowMulticast>",
                        elements(interfaces_of_this_computer())),
            {"127.0.0.1"});
      } else {
        domain.reach = named;
        peers.insert(peers.begin(), "127.0.0.1");
        domain.configuration = configuration("<AllowMulticast>false</AllowMulticast>", peers);
      }
      break;
    case Range::subnet:
      domain.reach = "the network";
      domain.configuration = configuration("", peers);
      break;
    case Range::off:
      domain.reach = "nobody";
      domain.configuration = configuration("<AllowMulticast>false</AllowMulticast>", {});
      break;
    case Range::system:
      domain.reach = "as Cyclone DDS is set up";
      if (!peers.empty()) domain.configuration = configuration("", peers);
      break;
  }
  return domain;
}

}  // namespace r4::tool::ros2
