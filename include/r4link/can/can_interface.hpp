// SPDX-License-Identifier: GPL-3.0-or-later
// The state of a CAN interface as the system reports it, and how to bring it up.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../discovery/url.hpp"

namespace r4 {

struct CanInterface {
  std::string name;
  std::string unknown;  // why the system reports nothing about it; empty: it reports the rest
  bool exists = false;
  bool is_can = false;
  bool up = false;
  bool fd = false;              // takes CAN FD frames
  bool has_controller = false;  // with a bit rate and an error state; not vcan, vxcan
  int index = 0;
  std::uint32_t tx_queue = 0;  // frames that the kernel keeps for it
  // The state of its controller, as far as the driver reports it.
  std::string state;           // "error-active", "error-warning", … "stopped"; empty: not known
  std::uint32_t bit_rate = 0;  // bit/s, of FD the nominal one; 0: not known
  std::uint32_t data_bit_rate = 0;  // bit/s of FD's data phase; 0: not known
  std::uint32_t restart_ms = 0;     // how long after a bus-off it restarts; 0: never
  std::uint16_t tx_errors = 0;      // its error counters, 0 without a controller
  std::uint16_t rx_errors = 0;
};

R4LINK_API CanInterface can_interface(const std::string& name);

// The interface of can://INTERFACE. Throws Error{usage} if the URL has another form.
R4LINK_API const std::string& can_interface_of(const Url& url);

// All CAN interfaces of this computer, by name; none if the system does not report them.
R4LINK_API std::vector<CanInterface> list_can_interfaces();

}  // namespace r4
