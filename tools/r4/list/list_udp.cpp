// SPDX-License-Identifier: GPL-3.0-or-later
#include "list_udp.hpp"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "listed_board.hpp"

namespace r4::tool {
namespace {

using Network = BoardSearch::Network;

constexpr const char* network_fix = "check the network and the firewall";

std::vector<FoundBoard> boards_on(const Network& network, const BoardSearch::Result& found) {
  std::vector<FoundBoard> boards;
  for (const FoundBoard& board : found.boards) {
    if (board.heard_at == network.from) boards.push_back(board);
  }
  return boards;
}

ListedBoard heard(const FoundBoard& board) {
  ListedBoard heard;
  heard.identity = static_cast<const IdentityAnswer&>(board);
  return heard;
}

}  // namespace

void print_text(const BoardSearch::Result& found, std::uint16_t port) {
  fmt::print("\nNetworks (UDP):\n");
  if (found.networks.empty()) fmt::print("  none\n");
  for (const Network& network : found.networks) {
    const std::vector<FoundBoard> boards = boards_on(network, found);
    fmt::print("  {:<14} {:<19}{}\n", printable(network.interface), network.from.to_string(),
               boards.empty() && network.trouble.empty() ? "no board answered" : "");
    for (const FoundBoard& board : boards) {
      fmt::print("    R4 board: {}  at {}, {}\n", url_of(board, found.boards, port),
                 board.address.to_string(), text_of(heard(board)));
    }
    if (!network.trouble.empty()) {
      fmt::print("    {}; {}\n", printable(network.trouble), network_fix);
    }
  }
  if (found.more) fmt::print("  more than {} answered\n", BoardSearch::most_boards);
}

void print_json(const BoardSearch::Result& found, std::uint16_t port) {
  for (const Network& network : found.networks) {
    Json boards = Json::array();
    for (const FoundBoard& board : boards_on(network, found)) {
      Json object{{"address", board.address.to_string()}};
      describe(heard(board), object);
      object["url"] = url_of(board, found.boards, port);
      boards.push_back(std::move(object));
    }
    print_line({{"type", "udp"},
                {"interface", network.interface},
                {"address", network.from.to_string()},
                {"boards", std::move(boards)},
                {"reason", network.trouble},
                {"fix", network.trouble.empty() ? "" : network_fix}});
  }
}

}  // namespace r4::tool
