// SPDX-License-Identifier: GPL-3.0-or-later
// The program dfu-util, which writes a sketch by the Giga's boot loader (USB Device Firmware
// Upgrade 1.1, with ST's extension DfuSe).
#pragma once

#include <functional>
#include <string>

namespace r4::tool {

// The boot loaders that this computer sees.
enum class BootLoaders { none, one, several, not_permitted };
// Throws Error{unsupported} if dfu-util is not installed.
BootLoaders look_for_boot_loader();

// Writes the image at `path`. Calls `on_percent` with 0 to 100, in order. The board then starts the
// sketch. Throws Error{open} with the last line of dfu-util if it fails.
void write_by_dfu(const std::string& path, const std::function<void(int)>& on_percent);

}  // namespace r4::tool
