// SPDX-License-Identifier: GPL-3.0-or-later
#include "usb_sender.hpp"

#include <cstdint>

// clang-format off
#include "../chip/chip.hpp"
#include <USB/PluggableUSBSerial.h>
// clang-format on

namespace r4 {
namespace giga {

namespace {

constexpr std::uint32_t packet_size = 64;
constexpr std::uint32_t diepctl_active = 1U << 15;  // USBAEP
constexpr std::uint32_t diepctl_bulk = 2U << 18;
constexpr std::uint32_t diepctl_first_data = 1U << 28;  // SD0PID
constexpr std::uint32_t diepint_all = 0xFB7F;           // a write of 1 clears
constexpr std::uint32_t grstctl_flush = 1U << 5;        // TXFFLSH
constexpr int flush_turns = 1000;  // the flush takes some clocks of the controller

// Gives access to protected members of the core's class.
class Inside final : public arduino::USBSerial {
 public:
  static std::uint32_t endpoint() { return _SerialUSB.*(&Inside::_bulk_in) & 0xFU; }
  static bool sending() { return _SerialUSB.*(&Inside::_tx_in_progress); }
  static void set_connected(bool connected) {
    (_SerialUSB.*(&Inside::_change_terminal_connected))(connected);
  }
};

template <class Registers>
Registers& at(std::uintptr_t offset) {
  // NOLINTNEXTLINE(performance-no-int-to-ptr): an address of the chip
  return *reinterpret_cast<Registers*>(USB_OTG_FS_PERIPH_BASE + offset);
}

USB_OTG_INEndpointTypeDef& in_endpoint(std::uint32_t number) {
  return at<USB_OTG_INEndpointTypeDef>(USB_OTG_IN_ENDPOINT_BASE + number * USB_OTG_EP_REG_SIZE);
}

// The interrupted packet is in the FIFO: the next packet must not follow it.
void forget_packet(std::uint32_t number) {
  at<USB_OTG_DeviceTypeDef>(USB_OTG_DEVICE_BASE).DIEPEMPMSK &= ~(1U << number);
  in_endpoint(number).DIEPINT = diepint_all;
  USB_OTG_GlobalTypeDef& controller = at<USB_OTG_GlobalTypeDef>(0);
  controller.GRSTCTL = grstctl_flush | number << 6;
  for (int i = 0; i < flush_turns && (controller.GRSTCTL & grstctl_flush) != 0; ++i) {
  }
}

void open(std::uint32_t number) {
  in_endpoint(number).DIEPCTL |=
      packet_size | diepctl_active | diepctl_bulk | number << 22 | diepctl_first_data;
  at<USB_OTG_DeviceTypeDef>(USB_OTG_DEVICE_BASE).DAINTMSK |= 1U << number;
}

}  // namespace

bool keep_usb_sending() {
  const std::uint32_t number = Inside::endpoint();
  if ((in_endpoint(number).DIEPCTL & diepctl_active) != 0) return false;
  if (!PluggableUSBD().configured()) return false;
  PluggableUSBD().lock();
  if (Inside::sending()) {  // the port was reopened, and the closed endpoint got a packet
    Inside::set_connected(false);
    Inside::set_connected(true);
  }
  forget_packet(number);
  open(number);
  PluggableUSBD().unlock();
  return true;
}

}  // namespace giga
}  // namespace r4
