// SPDX-License-Identifier: GPL-3.0-or-later
// The one place where the host knows the simulated board.
#include "standard_registry.hpp"

#include "../firmware/ports/sim/sim_carrier.hpp"
#include "../transports/udp/udp_url.hpp"

namespace r4 {

namespace {

Registry with_simulated_board() {
  Registry registry = Registry::standard();
  registry.add({"sim", "sim:[?node=1]", "a simulated board in this process",
                [](asio::io_context& io, const Url& url, Role role) {
                  if (role == Role::board) {
                    throw Error(ErrorKind::usage, url.text(), "sim: is a board, it cannot listen",
                                "give the board a transport to listen on, such as udp://:2018");
                  }
                  return sim::make_sim_carrier(io, url);
                }});
  return registry;
}

}  // namespace

const Registry& standard_registry() {
  static const Registry registry = with_simulated_board();
  return registry;
}

std::unique_ptr<Carrier> make_host_carrier(asio::io_context& io, std::string_view url,
                                           BoardRole role) {
  const std::string text(url);
  return standard_registry().make(io, role == BoardRole::watch ? with_own_port(text) : text,
                                  Role::host);
}

}  // namespace r4
