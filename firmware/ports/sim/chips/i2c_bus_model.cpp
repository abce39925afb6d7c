// SPDX-License-Identifier: GPL-3.0-or-later
#include "i2c_bus_model.hpp"

namespace r4 {
namespace sim {

using firmware::I2cResult;

// Keeps interrupts off while it exists. Then waits for the time that passed on the wire.
class I2cBusModel::Held {
 public:
  explicit Held(const I2cBusModel& bus) : bus_(bus) {
    if (bus_.processor_ == nullptr) return;
    before_ = bus_.processor_->hold_interrupts();
    began_ns_ = bus_.now_ns_;
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  ~Held() {
    if (bus_.processor_ == nullptr) return;
    const std::uint32_t passed_ns = static_cast<std::uint32_t>(bus_.now_ns_ - began_ns_);
    bus_.processor_->release_interrupts(before_);
    if (passed_ns != 0) bus_.processor_->wait(passed_ns);
  }

 private:
  const I2cBusModel& bus_;
  std::uint32_t before_ = 0;
  std::uint64_t began_ns_ = 0;
};

void I2cBusModel::connect(const I2cChipModel& chip, bool connected) {
  for (int i = 0; i < chip_count_; ++i) {
    if (chips_[i] != &chip) continue;
    const ChipSet bit = static_cast<ChipSet>(1U << i);
    disconnected_ = static_cast<ChipSet>(connected ? disconnected_ & ~bit : disconnected_ | bit);
  }
}

bool I2cBusModel::attach(I2cChipModel& chip) {
  if (chip_count_ == max_chips) return false;
  chips_[chip_count_++] = &chip;
  chip.follow(now_ns_);
  chip.power_on();
  return true;
}

I2cResult I2cBusModel::write(std::uint8_t address, const std::uint8_t* bytes, std::size_t size) {
  Transfer transfer;
  begin(transfer, I2cTransfer::Kind::write, address);
  I2cResult result = start(transfer, false);
  if (result == I2cResult::ok) result = send(transfer, bytes, size);
  return end(transfer, result);
}

I2cResult I2cBusModel::write_read(std::uint8_t address, const std::uint8_t* out,
                                  std::size_t out_size, std::uint8_t* in, std::size_t in_size) {
  Transfer transfer;
  begin(transfer, I2cTransfer::Kind::write_read, address);
  I2cResult result = I2cResult::ok;
  if (out_size != 0) {
    result = start(transfer, false);
    if (result == I2cResult::ok) result = send(transfer, out, out_size);
  }
  if (result == I2cResult::ok) result = start(transfer, true);
  transfer.read = in;
  for (std::size_t i = 0; i < in_size && result == I2cResult::ok; ++i) {
    result = fetch_byte(transfer, in[i]);
  }
  return end(transfer, result);
}

bool I2cBusModel::recover() {
  constexpr int nine_and_a_stop = 10;
  Transfer transfer;
  begin(transfer, I2cTransfer::Kind::recover, 0);
  bool free = false;
  {
    const Held held(*this);
    pass(nine_and_a_stop);
    if (held_ > 0) --held_;
    free = held_ == 0;
  }
  end(transfer, free ? I2cResult::ok : I2cResult::timeout);
  return free;
}

std::uint64_t I2cBusModel::now_ns() const {
  const Held held(*this);
  return now_ns_;
}

void I2cBusModel::advance(std::uint64_t us) {
  const std::uint32_t before = processor_ == nullptr ? 0 : processor_->hold_interrupts();
  now_ns_ += us * 1000;
  if (processor_ != nullptr) processor_->release_interrupts(before);
}

bool I2cBusModel::refuse(std::uint8_t address, std::size_t after_bytes, int times) {
  for (Refusal& place : refusals_) {
    if (place.times > 0) continue;
    place.address = address;
    place.after_bytes = after_bytes;
    place.times = times;
    return true;
  }
  return false;
}

void I2cBusModel::hold(int recoveries) { held_ = recoveries; }

void I2cBusModel::hold_after(std::size_t after_bytes, int recoveries) {
  hold_after_ = after_bytes;
  hold_recoveries_ = recoveries;
}

bool I2cBusModel::reset_after(I2cChipModel& chip, std::size_t after_bytes) {
  for (Reset& place : resets_) {
    if (place.after_bytes > 0) continue;
    place.chip = &chip;
    place.after_bytes = after_bytes;
    return true;
  }
  return false;
}

void I2cBusModel::clear_errors() {
  for (Refusal& refusal : refusals_) refusal = Refusal();
  for (Reset& reset : resets_) reset = Reset();
  hold_after_ = 0;
  held_ = 0;
}

void I2cBusModel::begin(Transfer& transfer, I2cTransfer::Kind kind, std::uint8_t address) {
  const Held held(*this);
  transfers_ = transfers_ + 1;
  transfer.number = transfers_;
  transfer.kind = kind;
  transfer.address = address;
  transfer.start_ns = now_ns_;
  addressed_ = 0;
  // The STOP of a recovery reaches all chips that were cut off.
  if (kind != I2cTransfer::Kind::recover) taking_part_ = 0;
}

I2cResult I2cBusModel::end(Transfer& transfer, I2cResult result) {
  {
    const Held held(*this);
    if (cut_short(transfer)) {
      result = I2cResult::timeout;
    } else {
      pass(1);
      if (result != I2cResult::timeout) {
        stop_chips();
      } else if (transfer.kind != I2cTransfer::Kind::recover) {
        // A chip cut off by a held line sees no STOP.
        now_ns_ += std::uint64_t{firmware::i2c_timeout_us} * 1000;
      }
    }
    transfer.result = result;
    transfer.duration_ns = now_ns_ - transfer.start_ns;
  }
  if (observer_ != nullptr) observer_->on_transfer(transfer);
  return result;
}

void I2cBusModel::stop_chips() {
  const ChipSet stopping = taking_part_;
  taking_part_ = 0;
  for (int i = 0; i < chip_count_; ++i) {
    if ((stopping >> i & 1) != 0) chips_[i]->stop();
  }
}

I2cResult I2cBusModel::start(Transfer& transfer, bool read) {
  const Held held(*this);
  if (cut_short(transfer) || held_ != 0) return I2cResult::timeout;
  pass(1);
  ChipSet answering = 0;
  if (Refusal* refusal = refusal_of(transfer.address, 0, 0)) {
    --refusal->times;
  } else {
    for (int i = 0; i < chip_count_; ++i) {
      if ((disconnected_ >> i & 1) != 0) continue;
      const bool answers = chips_[i]->start(transfer.address, read);
      if (cut_short(transfer)) return I2cResult::timeout;
      if (answers) answering |= static_cast<ChipSet>(1U << i);
    }
  }
  addressed_ = answering;
  taking_part_ |= answering;
  byte_sent(transfer);
  if (answering == 0) return I2cResult::no_acknowledge;
  return held_ != 0 ? I2cResult::timeout : I2cResult::ok;
}

I2cResult I2cBusModel::send(Transfer& transfer, const std::uint8_t* bytes, std::size_t size) {
  transfer.written = bytes;
  Refusal* refusal = size > 1 ? refusal_of(transfer.address, 1, size - 1) : nullptr;
  std::size_t accepted = size;
  if (refusal != nullptr) {
    --refusal->times;
    accepted = refusal->after_bytes;
  }
  for (std::size_t i = 0; i < size; ++i) {
    const I2cResult result = send_byte(transfer, bytes[i], i >= accepted);
    if (result != I2cResult::ok) return result;
    ++transfer.written_size;
  }
  return I2cResult::ok;
}

I2cResult I2cBusModel::send_byte(Transfer& transfer, std::uint8_t byte, bool refused) {
  const Held held(*this);
  bool acknowledged = false;
  for (int i = 0; i < chip_count_ && !refused; ++i) {
    if (cut_short(transfer)) return I2cResult::timeout;
    if ((addressed_ >> i & 1) != 0 && chips_[i]->write(byte)) acknowledged = true;
  }
  if (cut_short(transfer)) return I2cResult::timeout;
  byte_sent(transfer);
  if (held_ != 0) return I2cResult::timeout;
  return acknowledged ? I2cResult::ok : I2cResult::no_acknowledge;
}

I2cResult I2cBusModel::fetch_byte(Transfer& transfer, std::uint8_t& byte) {
  const Held held(*this);
  if (held_ != 0) return I2cResult::timeout;
  byte = 0xFF;  // no chip pulls SDA low
  for (int i = 0; i < chip_count_; ++i) {
    if (cut_short(transfer)) return I2cResult::timeout;
    if ((addressed_ >> i & 1) != 0) byte &= chips_[i]->read();
  }
  if (cut_short(transfer)) return I2cResult::timeout;
  ++transfer.read_size;
  byte_sent(transfer);
  return I2cResult::ok;
}

I2cBusModel::Refusal* I2cBusModel::refusal_of(std::uint8_t address, std::size_t first,
                                              std::size_t last) {
  for (Refusal& refusal : refusals_) {
    if (refusal.times > 0 && refusal.address == address && refusal.after_bytes >= first &&
        refusal.after_bytes <= last) {
      return &refusal;
    }
  }
  return nullptr;
}

void I2cBusModel::byte_sent(Transfer& transfer) {
  ++transfer.bytes;
  pass(9);
  for (Reset& reset : resets_) {
    if (reset.after_bytes == 0 || --reset.after_bytes != 0) continue;
    reset.chip->power_on();
    for (int i = 0; i < chip_count_; ++i) {
      if (chips_[i] != reset.chip) continue;
      addressed_ &= static_cast<ChipSet>(~(1U << i));
      taking_part_ &= static_cast<ChipSet>(~(1U << i));
    }
  }
  if (hold_after_ != 0 && --hold_after_ == 0) held_ = hold_recoveries_;
}

}  // namespace sim
}  // namespace r4
