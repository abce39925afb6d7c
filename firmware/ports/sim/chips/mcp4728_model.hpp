// SPDX-License-Identifier: GPL-3.0-or-later
// The MCP4728 by its data sheet (DS22187): input and output registers, EEPROM and its write time,
// every write command but the change of the address, reading, general calls.
//
// While the EEPROM is being written, write commands are taken for ignored, the most careful reading
// of the data sheet.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "i2c_chip_model.hpp"

namespace r4::sim {

class Mcp4728Model final : public I2cChipModel {
 public:
  static constexpr int channels = 4;
  static constexpr std::uint64_t eeprom_write_us = 50'000;

  // What a channel is set to.
  struct Setting {
    bool internal_reference = false;
    std::uint8_t power_down = 0;  // 0: normal, 1-3: 1k, 100k, 500k to ground
    bool gain_2 = false;
    std::uint16_t code = 0;
    bool operator==(const Setting&) const = default;
  };

  // As from the factory: internal reference, code 0. The LDAC pin is wired as said.
  explicit Mcp4728Model(std::uint8_t address, bool ldac_low = false);

  // What the outputs do.
  const Setting& output(int channel) const { return output_[static_cast<std::size_t>(channel)]; }
  const Setting& input(int channel) const { return input_[static_cast<std::size_t>(channel)]; }
  const Setting& eeprom(int channel) const { return eeprom_[static_cast<std::size_t>(channel)]; }
  void set_eeprom(int channel, const Setting& setting) {
    eeprom_[static_cast<std::size_t>(channel)] = setting;
  }
  // Volts at the pin with a supply of `supply` volts; 0 if powered down.
  double volts(int channel, double supply = 5.0) const;
  bool busy() const { return now_us_ < busy_until_us_; }
  int eeprom_writes() const { return eeprom_writes_; }
  // The EEPROM is worn out: it keeps what it has.
  void wear_out() { worn_out_ = true; }

  void power_on() override;
  bool start(std::uint8_t address, bool read) override;
  bool write(std::uint8_t byte) override;
  std::uint8_t read() override;
  void stop() override;
  void set_time(std::uint64_t now_us) override { now_us_ = now_us; }

 private:
  using Settings = std::array<Setting, channels>;

  bool general_call(std::uint8_t byte);
  bool command_complete();
  void store(std::size_t channel, bool update);
  void show(std::size_t channel) { output_[channel] = input_[channel]; }
  void write_eeprom(std::size_t first, std::size_t end);

  std::uint8_t address_;
  bool ldac_low_;
  Settings input_{};
  Settings output_{};
  Settings eeprom_{};
  std::optional<std::uint8_t> command_;  // the first byte of the transfer
  std::vector<std::uint8_t> bytes_;      // since the last channel was complete
  std::size_t channel_ = 0;              // the next of a fast or sequential write
  std::size_t first_channel_ = 0;        // of a sequential write
  bool general_ = false;
  bool ignoring_ = false;
  std::size_t read_at_ = 0;
  std::uint64_t busy_until_us_ = 0;
  std::uint64_t now_us_ = 0;
  int eeprom_writes_ = 0;
  bool worn_out_ = false;
};

}  // namespace r4::sim
