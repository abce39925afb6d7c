// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/discovery/discover.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <iterator>
#include <set>
#include <string_view>
#include <utility>

#include "r4link/board.hpp"
#include "searches.hpp"

namespace r4 {
namespace {

constexpr std::size_t most_listed = 8;  // boards in an error

template <class Each>
void append(std::vector<Each>& to, std::vector<Each> more) {
  std::move(more.begin(), more.end(), std::back_inserter(to));
}

std::string_view scheme_of(const FoundBoard& board) {
  return std::string_view(board.url).substr(0, board.url.find(':'));
}

// True if all entries are the same board, and no two entries have the same transport.
bool are_one(const std::vector<FoundBoard>& boards) {
  std::set<std::string_view> schemes;
  return std::all_of(boards.begin(), boards.end(), [&](const FoundBoard& each) {
    const bool same =
        boards.size() == 1 || (each.identity && boards.front().identity &&
                               each.identity->board_id == boards.front().identity->board_id);
    return schemes.insert(scheme_of(each)).second && same;
  });
}

// The searched places: "/dev/ttyACM0, can0 (the interface is down), lo".
std::string searched(const Discovery& all) {
  std::vector<std::string> places;
  const auto add = [&](const std::string& name, const std::optional<Problem>& trouble) {
    std::string place = trouble ? fmt::format("{} ({})", name, trouble->reason) : name;
    if (std::find(places.begin(), places.end(), place) == places.end()) {
      places.push_back(std::move(place));
    }
  };
  for (const SearchedPort& port : all.ports) {
    if (port.asked) add(port.path, port.trouble);
  }
  for (const SearchedBus& bus : all.buses) add(bus.interface, bus.trouble);
  for (const SearchedNetwork& network : all.networks) add(network.interface, network.trouble);
  return places.empty() ? "nothing to search" : fmt::format("searched {}", fmt::join(places, ", "));
}

}  // namespace

FoundBoard Discovery::only() const {
  if (boards.empty()) {
    throw Error(ErrorKind::open, "the only board",
                fmt::format("no R4 board was found ({})", searched(*this)),
                "switch the board on and connect it; r4 doctor checks this computer");
  }
  if (are_one(boards)) return boards.front();
  std::vector<std::string> urls;
  for (const FoundBoard& board : boards) urls.push_back(board.url);
  if (urls.size() > most_listed) {
    urls.resize(most_listed);
    urls.emplace_back("…; r4 list shows more");
  }
  throw Error(ErrorKind::usage, "the only board", "several boards were found",
              fmt::format("open one of {}", fmt::join(urls, ", ")));
}

Discovery discover(const DiscoveryOptions& options) {
  if (options.udp_port == 0) {
    throw Error(ErrorKind::usage, "UDP port 0", "0 is not a valid port of a board", "give 1-65535");
  }
  std::vector<std::future<Discovery>> searches;
  const auto begin = [&](bool wanted, auto search) {
    if (wanted) searches.push_back(std::async(std::launch::async, search));
  };
  begin(options.serial, [&] { return search_serial_ports(options.serial_ports); });
  begin(options.can, search_can_interfaces);
  begin(options.udp, [&] { return search_networks(options.udp_port); });
  Discovery all;
  for (std::future<Discovery>& search : searches) {
    Discovery found = search.get();
    append(all.boards, std::move(found.boards));
    append(all.ports, std::move(found.ports));
    append(all.buses, std::move(found.buses));
    append(all.networks, std::move(found.networks));
    all.more = all.more || found.more;
  }
  return all;
}

Board Board::first(BoardOptions options, const DiscoveryOptions& where) {
  return Board(discover(where).only().url, std::move(options));
}

}  // namespace r4
