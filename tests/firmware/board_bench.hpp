// SPDX-License-Identifier: GPL-3.0-or-later
// The board's hardware on models of its chips and pins. A test can place an interrupt inside a
// transfer.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "drivers/pin_models.hpp"

namespace r4::test {

using firmware::BoardHardware;
using firmware::I2cBus;
using firmware::I2cResult;
using firmware::Outputs;

// A bus between the hardware and its model: `what` runs in the middle of a chosen transfer.
struct InterruptedBus final : I2cBus {
  explicit InterruptedBus(I2cBus& below) : bus(below) {}
  I2cResult write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) override {
    const bool cut = interrupt();
    return cut ? I2cResult::timeout : bus.write(address, bytes, size);
  }
  I2cResult write_read(std::uint8_t address, const std::uint8_t* out, std::size_t out_size,
                       std::uint8_t* in, std::size_t in_size) override {
    const bool cut = interrupt();
    return cut ? I2cResult::timeout : bus.write_read(address, out, out_size, in, in_size);
  }
  bool recover() override {
    ++recoveries;
    return bus.recover();
  }
  bool interrupt() {
    if (after < 0 || after-- != 0) return false;
    what();
    return cuts;
  }
  I2cBus& bus;
  int after = -1;  // transfers until `what` runs; -1: never
  bool cuts = true;
  std::function<void()> what;
  int recoveries = 0;
};

struct BoardBench {
  explicit BoardBench(const BoardHardware::Config& config = {})
      : hardware(line, board.microcontroller_pins(), config) {}
  std::uint32_t now() const { return static_cast<std::uint32_t>(board.bus.now_us()); }
  void run(int ms) {
    for (int i = 0; i < ms; ++i) {
      const std::uint64_t began = board.bus.now_us();
      hardware.poll(now());
      longest_poll_us = std::max(longest_poll_us, board.bus.now_us() - began);
      board.bus.advance(1000);
    }
  }
  void boot() {
    hardware.power_up(now());
    run(20);
    ASSERT_TRUE(hardware.ready());
    ASSERT_FALSE(hardware.fault().any());
    log.clear();
    longest_poll_us = 0;
  }
  void apply(const Outputs& outputs, int polls = 8) {
    hardware.apply(outputs);
    run(polls);
  }
  BoardParts board;
  BusLog log{board.bus};
  InterruptedBus line{board.bus};
  BoardHardware hardware;
  std::uint64_t longest_poll_us = 0;
};

// Outputs that all differ from their safe values.
inline Outputs full() {
  Outputs outputs;
  for (int i = 0; i < 4; ++i) {
    outputs.osmc[i] = {4095, Direction::forward};
    outputs.dhb12[i] = {2000, Direction::forward};
    outputs.bldc[i] = {3000, Direction::forward, false};
    outputs.stepper[i] = {1000000, 20000, true};
  }
  for (std::uint16_t& us : outputs.servo_us) us = 1500;
  outputs.relays = 0xFF;
  return outputs;
}

}  // namespace r4::test
