// SPDX-License-Identifier: GPL-3.0-or-later
#include "bridge_urls.hpp"

#include <utility>

#include "../../transports/can/can_carrier.hpp"
#include "../../transports/serial/serial_device.hpp"
#include "../../transports/udp/network/udp_route.hpp"
#include "../../transports/udp/udp_url.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/error.hpp"

namespace r4 {
namespace {

constexpr const char* other_side = "name the board's own transport as the second one";

// True for an address of this computer. Other addresses cannot be bound.
bool is_ours(const std::string& host) {
  asio::error_code error;
  const auto address = asio::ip::make_address(host == "localhost" ? "127.0.0.1" : host, error);
  return !error && probe_route({address, UdpUrl::board_port}, address, {}) == 0;
}

void require_two_ports(const Url& hosts, const Url& board) {
  const UdpUrl a(hosts, Role::board);
  const UdpUrl b(board, Role::host);
  if (a.port == 0) return;
  if (!b.search && b.port == a.port && is_ours(b.host)) {
    throw Error(ErrorKind::usage, b.text, "the bridge itself listens for hosts at this address",
                other_side);
  }
  if (b.listen == a.port) {
    throw Error(ErrorKind::usage, b.text,
                "both sides would use the same port: one for the board, one for hosts",
                "use ?listen=0 to receive from the board on any free port");
  }
}

void require_two_sides(const Url& hosts, const Url& board) {
  const std::string& scheme = hosts.scheme();
  bool same = hosts.text() == board.text();
  if (scheme == "can" && board.scheme() == "can") {
    same = can_share_name(hosts).text == can_share_name(board).text;
  } else if ((scheme == "serial" || scheme == "pty") && board.scheme() == "serial") {
    same = same || (!hosts.path().empty() && hosts.path() != "auto" &&
                    resolve_links(hosts.path()) == resolve_links(board.path()));
  }
  if (same) {
    throw Error(ErrorKind::usage, board.text(), "both sides of the bridge are the same",
                other_side);
  }
  if (scheme == "udp" && board.scheme() == "udp") require_two_ports(hosts, board);
}

void require_board(const Url& board) {
  if (board.scheme() == "replay") {
    throw Error(ErrorKind::usage, board.text(), "a recording is not a board that can be driven",
                "play the recording to programs with r4 replay");
  }
  if (board.scheme() == "pty") {
    throw Error(ErrorKind::usage, board.text(),
                "pty: is only for the side of the hosts, which open the other end",
                "give the board's URL as serial:///dev/NAME");
  }
}

void require_one_path(std::string_view side) {
  if (split_paths(side).size() == 1) return;
  throw Error(ErrorKind::usage, std::string(side),
              "this gives several paths, and each side of a bridge has one path",
              "start a bridge for each path of the board, and join the paths at the host, as in "
              "udp://ROBOT:2018+udp://ROBOT:2019");
}

}  // namespace

bool is_of_this_computer(const std::string& hosts) {
  const Url url = Url::parse(hosts);
  if (url.scheme() != "udp") return url.scheme() == "pty" || url.scheme() == "serial";
  const std::string host = UdpUrl(url, Role::board).host;
  asio::error_code error;
  return host == "localhost" || (asio::ip::make_address(host, error).is_loopback() && !error);
}

std::vector<BridgedUrls> pair_urls(std::string_view hosts, std::string_view board) {
  require_one_path(hosts);
  require_one_path(board);
  std::vector<PatternUrl> a = expand_urls(std::vector{std::string(hosts)});
  std::vector<PatternUrl> b = expand_urls(std::vector{std::string(board)});
  if (a.size() != b.size()) {
    throw Error(ErrorKind::usage, std::string(hosts) + " " + std::string(board),
                "the two sides give " + std::to_string(a.size()) + " and " +
                    std::to_string(b.size()) + " transports",
                "give each board one transport on each side, as in udp://0.0.0.0:2100-2107 "
                "'can://can0?node=0-7'");
  }
  std::vector<BridgedUrls> pairs;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Url at_board = Url::parse(b[i].url);
    require_board(at_board);
    require_two_sides(Url::parse(a[i].url), at_board);
    pairs.push_back({std::move(a[i].url), std::move(b[i].url)});
  }
  return pairs;
}

}  // namespace r4
