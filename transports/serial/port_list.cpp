// SPDX-License-Identifier: GPL-3.0-or-later
#include "port_list.hpp"

#include <fcntl.h>
#include <libserialport.h>
#include <linux/serial.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <system_error>

#include "../file_descriptor.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {
namespace {

// The driver serial8250 lists a fixed number of ports, although the machine may have fewer.
bool is_there(const std::string& path) {
  const FileDescriptor port(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  serial_struct settings{};
  return port && ::ioctl(port.get(), TIOCGSERIAL, &settings) == 0 && settings.type != PORT_UNKNOWN;
}

}  // namespace

// sp_list_ports() of libserialport 0.1.1 crashes if a port is unplugged meanwhile.
std::vector<SerialPort> list_serial_ports(const std::string& folder) {
  namespace fs = std::filesystem;
  const auto text_of = [](const char* text) { return std::string(text == nullptr ? "" : text); };
  std::vector<SerialPort> ports;
  std::error_code error;
  for (fs::directory_iterator at(folder, error); !error && at != fs::directory_iterator();
       at.increment(error)) {
    std::error_code gone;
    const std::string device = fs::read_symlink(at->path(), gone).string();
    SerialPort port;
    port.path = "/dev/" + at->path().filename().string();
    if (gone || device.find("virtual") != std::string::npos) continue;
    if (device.find("serial8250") != std::string::npos && !is_there(port.path)) continue;
    sp_port* found = nullptr;
    if (sp_get_port_by_name(port.path.c_str(), &found) != SP_OK) continue;
    const std::unique_ptr<sp_port, void (*)(sp_port*)> owned(found, sp_free_port);
    port.description = text_of(sp_get_port_description(found));
    int vid = 0;
    int pid = 0;
    if (sp_get_port_transport(found) == SP_TRANSPORT_USB) {
      port.serial_number = text_of(sp_get_port_usb_serial(found));
      if (sp_get_port_usb_vid_pid(found, &vid, &pid) == SP_OK) {
        port.vid = static_cast<std::uint16_t>(vid);
        port.pid = static_cast<std::uint16_t>(pid);
      }
    }
    port.is_r4 = port.vid == 0x2341 && port.pid == 0x0266;
    ports.push_back(std::move(port));
  }
  std::sort(ports.begin(), ports.end(),
            [](const SerialPort& a, const SerialPort& b) { return a.path < b.path; });
  return ports;
}

std::string url_of(const SerialPort& port) {
  if (port.serial_number.empty()) return "serial://" + port.path;
  return "serial:?sn=" + percent_encoded(port.serial_number);
}

}  // namespace r4
