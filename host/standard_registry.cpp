// SPDX-License-Identifier: GPL-3.0-or-later
// The one place where the host knows the simulated board, and recordings as boards.
#include "standard_registry.hpp"

#include "../firmware/ports/sim/sim_carrier.hpp"
#include "replay/replay_carrier.hpp"

namespace r4 {

namespace {

Registry with_all() {
  Registry registry = Registry::standard();
  registry.add({"sim", "sim:[?node=1]", "a simulated board in this process",
                [](asio::io_context& io, const Url& url, Role role) {
                  if (role == Role::board) {
                    throw Error(ErrorKind::usage, url.text(), "sim: is a board, it cannot listen",
                                "give the board a transport to listen on, such as udp://:2018");
                  }
                  return sim::make_sim_carrier(io, url);
                }});
  registry.add({"replay", "replay:FILE[?speed=1&wire=1&from=0]", "what a board said in a recording",
                make_replay_carrier});
  return registry;
}

}  // namespace

const Registry& standard_registry() {
  static const Registry registry = with_all();
  return registry;
}

std::unique_ptr<Carrier> make_host_carrier(asio::io_context& io, std::string_view url,
                                           BoardRole role) {
  return standard_registry().make_shared(io, url, role);
}

}  // namespace r4
