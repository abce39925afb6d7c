// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the boards on this computer's networks by IPv4 broadcast. A board answers every host.
//     on each network:  socket at our address, any free port --- Q:ID, 3 times ---> broadcast:2018
//                                     <--- I:R4,…;NAME:…;BUSY:… --- each board, from its :2018
// One search takes half a second, sends three packets a network, and keeps at most `most_boards`
// answers. The answers are not signed, so any program on the network can answer as any board. The
// link and its keys decide which commands are accepted, not the search. Broadcast does not pass a
// router, and often not a VPN, container network or WiFi with client isolation. A board there is
// reached by its address. The loopback has no broadcast, so the search asks each of its addresses.
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
#include "r4link/discovery/discover.hpp"

namespace r4 {

struct AnsweredBoard : IdentityAnswer {
  asio::ip::address_v4 address;
  asio::ip::address_v4 heard_at;  // the address of this computer in its network
};

struct BoardSearch {
  struct Network {
    std::string interface;
    unsigned index = 0;  // index of the interface; 0: as the system routes
    asio::ip::address_v4 from;
    asio::ip::address_v4 to;   // the broadcast address
    std::string trouble = {};  // why the question could not be sent
  };
  // The networks whose interface is up, 64 at most.
  static std::vector<Network> networks_of_this_computer();

  struct Result {
    std::vector<Network> networks;
    std::vector<AnsweredBoard> boards;
    std::size_t others = 0;  // boards of another id and name
    bool more = false;       // more boards have answered than are kept
  };
  // Blocks for `patience`. Throws only if memory is used up. `called`: an id or name; empty: all.
  Result run(std::string_view called = {}) const;

  static constexpr std::size_t most_boards = Discovery::most_answers;

  std::function<std::vector<Network>()> networks = networks_of_this_computer;
  std::uint16_t port = DiscoveryOptions().udp_port;  // port at which boards listen
  int questions = 3;
  std::chrono::milliseconds between{120};
  std::chrono::milliseconds patience{500};
};

struct WantedBoard {
  std::string called;    // the board's id or name; empty: the only board
  std::string board_id;  // id of the board that was found before; empty: none
};

// The boards with that id; if there is none, the boards with that name.
std::vector<AnsweredBoard> called(const std::vector<AnsweredBoard>& boards,
                                  std::string_view id_or_name);

// The URL that finds `board` again: by name or id if unique, else by address. `port`: of boards.
std::string url_of(const AnsweredBoard& board, const std::vector<AnsweredBoard>& boards,
                   std::uint16_t port);

FoundHost find_board(const BoardSearch& search, const WantedBoard& wanted);

}  // namespace r4
