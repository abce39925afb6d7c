// SPDX-License-Identifier: GPL-3.0-or-later
// The state of a CAN interface as the system reports it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "../config.hpp"
#include "../discovery/url.hpp"

namespace r4 {

struct CanInterface {
  std::string name;
  std::string unknown;  // why the system reports nothing; empty: the members below are valid
  bool exists = false;
  bool is_can = false;
  bool up = false;
  bool fd = false;              // accepts CAN FD frames
  bool has_controller = false;  // has a bit rate and an error state; false for vcan and vxcan
  int index = 0;
  std::uint32_t tx_queue = 0;  // size of the kernel's queue, in frames
  std::string state;           // "error-active", "error-warning", … "stopped"; empty: not known
  std::uint32_t bit_rate = 0;  // bit/s, nominal for FD; 0: not known
  std::uint32_t data_bit_rate = 0;  // bit/s of FD's data phase; 0: not known
  std::uint32_t restart_ms = 0;     // time from bus-off to the restart; 0: never
  std::uint16_t tx_errors = 0;      // error counters; 0 without a controller
  std::uint16_t rx_errors = 0;
};

R4LINK_API CanInterface can_interface(const std::string& name);

// The interface of can://INTERFACE. Throws Error{usage} for a URL with another form.
R4LINK_API const std::string& can_interface_of(const Url& url);

// All CAN interfaces of this computer, by name; none if the system does not report them.
R4LINK_API std::vector<CanInterface> list_can_interfaces();

}  // namespace r4
