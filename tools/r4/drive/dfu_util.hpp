// SPDX-License-Identifier: GPL-3.0-or-later
// The program dfu-util: USB Device Firmware Upgrade 1.1, with ST's extension DfuSe.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace r4::tool {

struct BootLoaders {
  std::vector<std::string> usb_paths;  // boot loaders that this user may open: "1-2"
  bool denied = false;                 // this user may not open a boot loader
};
// Throws Error{unsupported} if dfu-util is not installed.
BootLoaders look_for_boot_loaders();

// Calls `on_percent` with 0 to 100, in order. The board then starts the sketch. If this program is
// interrupted, dfu-util writes the rest. Throws Error{open} with dfu-util's last line.
void write_by_dfu(const std::string& path, const std::string& usb_path,
                  const std::function<void(int)>& on_percent);

}  // namespace r4::tool
