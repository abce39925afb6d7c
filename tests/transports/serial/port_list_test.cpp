// SPDX-License-Identifier: GPL-3.0-or-later
#include "transports/serial/port_list.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "r4link/discovery/url.hpp"

namespace r4 {
namespace {

TEST(PortList, NamesEachPortOnceWithItsDevice) {
  const auto ports = list_serial_ports();
  for (const SerialPort& port : ports) {
    EXPECT_EQ(port.path.find("/dev/"), 0U);
    EXPECT_EQ(port.is_r4, port.vid == 0x2341 && port.pid == 0x0266);
  }
  EXPECT_TRUE(std::is_sorted(ports.begin(), ports.end(),
                             [](const auto& a, const auto& b) { return a.path < b.path; }));
}

TEST(PortList, LeavesOutAPortThatIsUnpluggedMeanwhile) {
  const std::filesystem::path folder =
      testing::TempDir() + "r4-ports-" + std::to_string(::getpid());
  std::filesystem::create_directory(folder);
  // Both ports have been removed from the kernel.
  for (const char* const port : {"ttyUSB998", "ttyUSB999"}) {
    std::filesystem::create_symlink("../../devices/usb1/1-1/ttyUSB/tty", folder / port);
  }
  EXPECT_TRUE(list_serial_ports(folder).empty());
  std::filesystem::remove_all(folder);
  EXPECT_TRUE(list_serial_ports(folder).empty()) << "without the folder";
}

TEST(PortList, GivesTheUrlThatFindsAPortAgain) {
  SerialPort port;
  port.path = "/dev/ttyS0";
  EXPECT_EQ(url_of(port), "serial:///dev/ttyS0");
  port.serial_number = "0042";
  EXPECT_EQ(url_of(port), "serial:?sn=0042");
  port.serial_number = "00:4 2&\x1b[2J;$(x)\xff";
  EXPECT_EQ(url_of(port), "serial:?sn=00:4%202%26%1B%5B2J%3B%24%28x%29%FF");
  EXPECT_EQ(Url::parse(url_of(port)).get("sn"), port.serial_number);
}

}  // namespace
}  // namespace r4
