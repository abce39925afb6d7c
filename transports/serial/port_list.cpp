// SPDX-License-Identifier: GPL-3.0-or-later
#include "port_list.hpp"

#include <libserialport.h>

#include <algorithm>

#include "r4link/discovery/url.hpp"

namespace r4 {

std::vector<SerialPort> list_serial_ports() {
  const auto text_of = [](const char* text) { return std::string(text == nullptr ? "" : text); };
  std::vector<SerialPort> ports;
  sp_port** found = nullptr;
  if (sp_list_ports(&found) != SP_OK) return ports;
  for (sp_port** at = found; *at != nullptr; ++at) {
    SerialPort port;
    port.path = text_of(sp_get_port_name(*at));
    port.description = text_of(sp_get_port_description(*at));
    int vid = 0;
    int pid = 0;
    if (sp_get_port_transport(*at) == SP_TRANSPORT_USB) {
      port.serial_number = text_of(sp_get_port_usb_serial(*at));
      if (sp_get_port_usb_vid_pid(*at, &vid, &pid) == SP_OK) {
        port.vid = static_cast<std::uint16_t>(vid);
        port.pid = static_cast<std::uint16_t>(pid);
      }
    }
    port.is_r4 = port.vid == 0x2341 && port.pid == 0x0266;
    ports.push_back(std::move(port));
  }
  sp_free_port_list(found);
  std::sort(ports.begin(), ports.end(),
            [](const SerialPort& a, const SerialPort& b) { return a.path < b.path; });
  return ports;
}

std::string url_of(const SerialPort& port) {
  if (port.serial_number.empty()) return "serial://" + port.path;
  return "serial:?sn=" + percent_encoded(port.serial_number);
}

}  // namespace r4
