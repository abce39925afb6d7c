// SPDX-License-Identifier: GPL-3.0-or-later
#include <utility>

#include "../transports/own/own_carriers.hpp"
#include "r4link/async_board.hpp"

namespace r4 {

CarrierMaker carrier_on(std::shared_ptr<OwnTransport> transport) {
  return
      [transport = std::move(transport)](Loop& loop) { return make_own_carrier(loop, transport); };
}

CarrierMaker carrier_on(std::shared_ptr<OwnCanBus> bus, const OwnCanNode& node) {
  return [bus = std::move(bus), node](Loop& loop) {
    return make_own_can_carrier(context_of(loop), bus, node, Role::host);
  };
}

}  // namespace r4
