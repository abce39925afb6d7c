// SPDX-License-Identifier: GPL-3.0-or-later
// Which boards are on the networks of this computer: `Q:ID` by IPv4 broadcast, which a board answers
// whoever controls it.
//
//     on each network:  socket at our address, any free port --- Q:ID, 3 times ---> broadcast:2018
//                                             <--- I:R4,…;NAME:…;BUSY:… --- each board, from its :2018
//
// One search takes half a second and sends three packets a network; nothing is sent but that. However
// much comes back, at most `most_boards` are kept. The answers are not signed: who is on the network can
// answer as any board. What may be commanded, the link and its keys decide, and not the search.
//
// Broadcast passes no router, and often no VPN, container network or WiFi with client isolation: there a
// board is reached by its address. On the loopback, which has no broadcast, each address is asked itself.
#pragma once

#include <asio/ip/address_v4.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "../../identity_answer.hpp"
#include "host_lookup.hpp"

namespace r4 {

// A board that has answered.
struct FoundBoard : IdentityAnswer {
  asio::ip::address_v4 address;
  asio::ip::address_v4 heard_at;  // ours, in its network
};

struct BoardSearch {
  // A network of this computer, by one of its addresses.
  struct Network {
    std::string interface;
    unsigned index = 0;         // of the interface; 0: as the system routes it
    asio::ip::address_v4 from;  // ours
    asio::ip::address_v4 to;    // everyone's there
    std::string trouble = {};   // why nothing could be asked
  };
  // Those that are up, 64 at most.
  static std::vector<Network> networks_of_this_computer();

  struct Result {
    std::vector<Network> networks;  // that were asked
    std::vector<FoundBoard> boards;
    std::size_t others = 0;  // that are not called so
    bool more = false;       // more than are kept have answered
  };
  // Blocks for `patience`. Throws nothing but for memory. `called`: keeps those of that board id or name
  // alone, however many others answer; empty: all.
  Result run(std::string_view called = {}) const;

  static constexpr std::size_t most_boards = 64;

  std::function<std::vector<Network>()> networks = networks_of_this_computer;
  std::uint16_t port = 2018;  // at which boards listen
  int questions = 3;
  std::chrono::milliseconds between{120};
  std::chrono::milliseconds patience{500};
};

// Which of them is meant.
struct WantedBoard {
  std::string called;    // its board id, or its name; empty: the only one there is
  std::string board_id;  // of the one that it has been; empty: none yet
};

// Which of `boards` is meant: those of that id, else those of that name.
std::vector<FoundBoard> called(const std::vector<FoundBoard>& boards, std::string_view id_or_name);

// The URL that finds one of `boards` wherever its address is: by name, by id, or by address if neither is
// its own. `port`: of the search.
std::string url_of(const FoundBoard& board, const std::vector<FoundBoard>& boards,
                   std::uint16_t port);

// Searches. Where the board is, or why none of those that have answered can be taken for it.
FoundHost find_board(const BoardSearch& search, const WantedBoard& wanted);

}  // namespace r4
