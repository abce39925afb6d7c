// SPDX-License-Identifier: GPL-3.0-or-later
#include "port_list.hpp"

#include <fmt/format.h>
#include <libserialport.h>

#include <algorithm>

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
    port.is_r4 = port.vid == board_vid && port.pid == board_pid;
    ports.push_back(std::move(port));
  }
  sp_free_port_list(found);
  std::sort(ports.begin(), ports.end(),
            [](const SerialPort& a, const SerialPort& b) { return a.path < b.path; });
  return ports;
}

std::string url_of(const SerialPort& port) {
  if (port.serial_number.empty()) return "serial://" + port.path;
  // Any text may be a serial number: what a URL, a shell or a terminal would take for its own is
  // percent-encoded.
  std::string url = "serial:?sn=";
  for (const char c : port.serial_number) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '_' || c == '-' || c == '.' || c == ':';
    url += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return url;
}

}  // namespace r4
