// SPDX-License-Identifier: GPL-3.0-or-later
#include "../../transports/udp/search/board_search.hpp"
#include "searches.hpp"

namespace r4 {

Discovery search_networks(std::uint16_t port) {
  BoardSearch search;
  search.port = port;
  const BoardSearch::Result result = search.run();
  Discovery found;
  found.more = result.more;
  for (const BoardSearch::Network& network : result.networks) {
    SearchedNetwork& place =
        found.networks.emplace_back(SearchedNetwork{network.interface, network.from.to_string()});
    if (!network.trouble.empty()) {
      place.trouble = Problem{ErrorKind::open, network.interface, network.trouble,
                              "check the network and the firewall"};
    }
  }
  for (const AnsweredBoard& board : result.boards) {
    FoundBoard& each = found.boards.emplace_back();
    each.url = url_of(board, result.boards, port);
    each.place = board.heard_at.to_string();
    each.address = board.address.to_string();
    each.identity = board;
    each.busy = board.busy;
  }
  return found;
}

}  // namespace r4
