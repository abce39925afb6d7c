// SPDX-License-Identifier: GPL-3.0-or-later
#include "usb_port.hpp"

#include "usb_sender.hpp"

// clang-format off
#include "../chip/chip.hpp"
#include <USB/PluggableUSBSerial.h>
// clang-format on

namespace r4 {
namespace giga {

void UsbPort::start() { _SerialUSB.attach(&UsbPort::listen); }

void UsbPort::listen() { NVIC_SetPendingIRQ(SWPMI1_IRQn); }

bool UsbPort::take_in() {
  const bool open = _SerialUSB.connected();
  if (open != heard_open_) detector_.reset();
  heard_open_ = open;
  bool stop = false;
  while (received_.room() != 0) {
    const int byte = _SerialUSB.read();
    if (byte < 0) break;
    received_.put(static_cast<char>(byte));
    if (detector_.push(static_cast<char>(byte))) stop = true;
  }
  return stop;
}

void UsbPort::fill_packet() {
  packet_sent_ = 0;
  packet_used_ = 0;
  char byte = 0;
  while (packet_used_ < packet_size && lines_.take(byte)) {
    packet_[packet_used_++] = static_cast<std::uint8_t>(byte);
  }
}

void UsbPort::send_packet() {
  if (packet_sent_ == packet_used_) fill_packet();
  std::uint32_t size = packet_used_ - packet_sent_;
  if (size == 0) return;
  // A packet that is not full makes the host's driver deliver the data.
  if (size == packet_size && lines_.empty()) --size;
  std::uint32_t taken = 0;
  _SerialUSB.send_nb(packet_ + packet_sent_, size, &taken, true);
  packet_sent_ += taken;
}

void UsbPort::forget_lines() {
  framing_.reset();
  lines_.clear();
  packet_sent_ = packet_used_;
}

bool UsbPort::begin_turn() {
  const bool reopened = keep_usb_sending();
  connected_ = _SerialUSB.connected();
  const bool next_program = reopened && open_ && connected_;
  if (next_program) forget_lines();
  return next_program;
}

bool UsbPort::poll(std::uint32_t now_ms) {
  const bool closed = open_ && !connected_;
  if (connected_ != open_) forget_lines();  // old data is not for the next program
  open_ = connected_;
  lines_.poll(now_ms);
  send_packet();
  return closed;
}

void UsbPort::send(Text datagram, Priority priority, std::uint32_t) {
  if (!open_) return;
  if (priority == Priority::state) {
    lines_.put_state(datagram);
  } else {
    lines_.put(datagram);
  }
  send_packet();
}

bool UsbPort::upload_asked() {
  constexpr std::uint32_t upload_baud = 1200;
  if (_SerialUSB.baud() == upload_baud) upload_asked_ = true;
  return upload_asked_;
}

bool UsbPort::say(Text line) {
  const std::uint32_t before = lines_.dropped();
  lines_.put(line);
  return lines_.dropped() == before;
}

}  // namespace giga
}  // namespace r4
