// SPDX-License-Identifier: GPL-3.0-or-later
#include <asio/io_context.hpp>
#include <string>

#include "../transports/impaired/impaired_carrier.hpp"
#include "r4link/async_board.hpp"
#include "r4link/simulation.hpp"
#include "standard_registry.hpp"

namespace r4::sim {

CarrierMaker with_link(std::string_view url, std::string_view link) {
  return [url = std::string(url), impairment = Impairment::parse(link)](Loop& loop) {
    asio::io_context& io = r4::context_of(loop);
    return make_impaired_carrier(io, make_host_carrier(io, url, BoardRole::control), impairment);
  };
}

}  // namespace r4::sim
