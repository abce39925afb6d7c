// SPDX-License-Identifier: GPL-3.0-or-later
// The MCP4728 by its data sheet (DS22187), without the change of the address. Write commands during
// a write of the EEPROM are ignored: the strictest reading of the data sheet.
#pragma once

#include <cstddef>
#include <cstdint>

#include "i2c_chip_model.hpp"

namespace r4 {
namespace sim {

class Mcp4728Model final : public I2cChipModel {
 public:
  static constexpr int channels = 4;
  static constexpr std::uint64_t eeprom_write_us = 50000;

  struct Setting {
    bool internal_reference = false;
    std::uint8_t power_down = 0;  // 0: normal, 1-3: 1k, 100k, 500k to ground
    bool gain_2 = false;
    std::uint16_t code = 0;
    bool operator==(const Setting& other) const {
      return internal_reference == other.internal_reference && power_down == other.power_down &&
             gain_2 == other.gain_2 && code == other.code;
    }
  };

  // Factory state: internal reference, code 0. `ldac_low`: how the LDAC pin is wired.
  explicit Mcp4728Model(std::uint8_t address, bool ldac_low = false);

  const Setting& output(int channel) const { return output_[channel]; }
  const Setting& input(int channel) const { return input_[channel]; }
  const Setting& eeprom(int channel) const { return eeprom_[channel]; }
  void set_eeprom(int channel, const Setting& setting) { eeprom_[channel] = setting; }
  // The voltage at the pin of a chip on 5 V; 0 if powered down.
  std::int32_t microvolts(int channel) const;
  double volts(int channel) const { return microvolts(channel) / 1e6; }
  bool busy() const { return now_ns() < busy_until_ns_; }
  int eeprom_writes() const { return eeprom_writes_; }
  // A worn-out EEPROM keeps its contents.
  void wear_out() { worn_out_ = true; }

  void power_on() override;
  bool start(std::uint8_t address, bool read) override;
  bool write(std::uint8_t byte) override;
  std::uint8_t read() override;
  void stop() override;

 private:
  bool general_call(std::uint8_t byte);
  bool command_complete();
  void store(int channel, bool update);
  void show(int channel) { output_[channel] = input_[channel]; }
  void write_eeprom(int first, int end);

  std::uint8_t address_;
  bool ldac_low_;
  Setting input_[channels];
  Setting output_[channels];
  Setting eeprom_[channels];
  bool has_command_ = false;
  std::uint8_t command_ = 0;    // the first byte of the transfer
  std::uint8_t bytes_[3] = {};  // bytes since the last channel was complete
  std::size_t size_ = 0;
  int channel_ = 0;        // next channel of a fast or sequential write
  int first_channel_ = 0;  // first channel of a sequential write
  bool general_ = false;
  bool ignoring_ = false;
  int read_at_ = 0;
  std::uint64_t busy_until_ns_ = 0;
  int eeprom_writes_ = 0;
  bool worn_out_ = false;
};

}  // namespace sim
}  // namespace r4
