// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/registers.hpp"
#include "fake_giga.hpp"

namespace r4::fake {

namespace {

constexpr std::uint64_t frame_ns = 100000;
constexpr std::uint64_t recovery_ns = 1408000;  // 128 times 11 bits of 1 Mbit/s

FDCAN_GlobalTypeDef& can = r4_fake_fdcan2;

bool in_init() { return (can.CCCR.value & 1U) != 0; }
std::uint32_t start_word(const Register& field) { return field.value >> 2 & 0x3FFF; }
std::uint32_t fifo_size(const Register& field) { return field.value >> 16 & 0x7F; }

void interrupt(std::uint32_t bits) {
  can.IR.value |= bits;
  Giga& chip = giga();
  if ((can.IE.value & bits) == 0 || (can.ILE.value & 1U) == 0) return;
  if (chip.vectors.count(FDCAN2_IT0_IRQn) == 0 || chip.in_interrupt) return;
  chip.in_interrupt = true;
  chip.isr_queue = 0;
  chip.vectors[FDCAN2_IT0_IRQn]();
  chip.in_interrupt = false;
}

}  // namespace

void CanPeripheral::connect() {
  pending_ = 0;
  put_ = get_ = 1;
  fifo0_get_ = fifo0_fill_ = fifo1_get_ = fifo1_fill_ = 0;
  bus_off_ = false;
  can.CCCR.value = 1;
  can.CCCR.on_write = [this](std::uint32_t value) {
    if ((value & 1U) == 0) value &= ~2U;
    if ((value & 3U) == 3U) pending_ = 0, put_ = get_ = 1;
    if ((can.CCCR.value & 1U) != 0 && (value & 1U) == 0 && bus_off_) {
      back_at_ns_ = giga().now_ns() + recovery_ns;
    }
    can.CCCR.value = value;
  };
  can.IR.on_write = [](std::uint32_t value) { can.IR.value &= ~value; };
  can.PSR.on_read = [this] { return can.PSR.value | (bus_off_ ? 1U << 7 : 0U); };
  can.TXBRP.on_read = [this] { return pending_; };
  can.TXBAR.on_write = [this](std::uint32_t value) {
    pending_ |= value;
    if ((value & ~1U) != 0) put_ = put_ == 8 ? 1 : put_ + 1;
  };
  can.TXBCR.on_write = [this](std::uint32_t value) {
    pending_ &= ~value;
    if ((value & ~1U) != 0) put_ = get_ = 1;
  };
  can.TXFQS.on_read = [this] {
    const bool full = (pending_ & 1U << put_) != 0;
    return (full ? 1U << 21 : 0U) | put_ << 16 | get_ << 8;
  };
  can.RXF0S.on_read = [this] { return fifo0_fill_ | fifo0_get_ << 8; };
  can.RXF1S.on_read = [this] { return fifo1_fill_ | fifo1_get_ << 8; };
  can.RXF0A.on_write = [this](std::uint32_t) {
    fifo0_get_ = (fifo0_get_ + 1) % fifo_size(can.RXF0C);
    --fifo0_fill_;
  };
  can.RXF1A.on_write = [this](std::uint32_t) {
    fifo1_get_ = (fifo1_get_ + 1) % fifo_size(can.RXF1C);
    --fifo1_fill_;
  };
}

CanFrame CanPeripheral::element(std::uint32_t word) const {
  CanFrame frame{};
  frame.id = r4_fake_message_ram[word] >> 18 & max_can_id;
  frame.size = static_cast<std::uint8_t>(r4_fake_message_ram[word + 1] >> 16 & 0xF);
  for (int i = 0; i < 8; ++i) {
    frame.data[i] = static_cast<std::uint8_t>(
        r4_fake_message_ram[word + 2 + static_cast<unsigned>(i) / 4] >> (8 * (i % 4)));
  }
  return frame;
}

void CanPeripheral::store(std::uint32_t base, std::uint32_t index, const CanFrame& frame) {
  std::uint32_t* const word = &r4_fake_message_ram[base + index * 4];
  word[0] = frame.extended ? 1U << 30 | frame.id : frame.id << 18;
  word[1] = std::uint32_t{frame.size} << 16;
  for (int half = 0; half < 2; ++half) {
    word[2 + half] = 0;
    for (int i = 0; i < 4; ++i)
      word[2 + half] |= std::uint32_t{frame.data[4 * half + i]} << (8 * i);
  }
}

// The filters' decision about a frame: 1 and 2 are FIFO 0 and 1; 0: no filter matches.
std::uint32_t CanPeripheral::filter_result(const CanFrame& frame) const {
  if (frame.extended) {
    const std::uint32_t filters = can.XIDFC.value >> 16 & 0x7F;
    for (std::uint32_t i = 0; i < filters; ++i) {
      const std::uint32_t* const filter = &r4_fake_message_ram[start_word(can.XIDFC) + 2 * i];
      if (filter[1] >> 30 != 2) continue;  // identifier and mask: the kind that this firmware uses
      const std::uint32_t mask = filter[1] & 0x1FFFFFFF & can.XIDAM.value;
      if ((frame.id & mask) == (filter[0] & mask)) return filter[0] >> 29 & 7U;
    }
    return 0;
  }
  const std::uint32_t filters = can.SIDFC.value >> 16 & 0xFF;
  for (std::uint32_t i = 0; i < filters; ++i) {
    const std::uint32_t filter = r4_fake_message_ram[start_word(can.SIDFC) + i];
    if (frame.id == (filter >> 16 & 0x7FF) || frame.id == (filter & 0x7FF))
      return filter >> 27 & 7U;
  }
  return 0;
}

bool CanPeripheral::deliver(const CanFrame& frame) {
  if (in_init() || bus_off_) return false;
  const std::uint32_t to = filter_result(frame);
  if (to != 0) {
    if (to == 1) {
      if (fifo0_fill_ == fifo_size(can.RXF0C)) {
        interrupt(1U << 3);
        return true;
      }
      store(start_word(can.RXF0C), (fifo0_get_ + fifo0_fill_) % fifo_size(can.RXF0C), frame);
      ++fifo0_fill_;
      interrupt(1U << 0);
    } else {
      if (fifo1_fill_ == fifo_size(can.RXF1C)) {
        fifo1_get_ = (fifo1_get_ + 1) % fifo_size(can.RXF1C);
        --fifo1_fill_;
      }
      store(start_word(can.RXF1C), (fifo1_get_ + fifo1_fill_) % fifo_size(can.RXF1C), frame);
      ++fifo1_fill_;
      interrupt(1U << 4);
    }
    return true;
  }
  // The setting after a reset: frames without a match go to FIFO 0.
  if ((can.GFC.value >> 4 & 3U) == 0) {
    store(start_word(can.RXF0C), (fifo0_get_ + fifo0_fill_) % fifo_size(can.RXF0C), frame);
    ++fifo0_fill_;
    return true;
  }
  return false;
}

void CanPeripheral::go_bus_off() {
  bus_off_ = true;
  back_at_ns_ = ~0ULL;
  can.CCCR.value |= 1;
  interrupt(1U << 25);
}

void CanPeripheral::pass(std::uint64_t now_ns) {
  if (bus_off_ && quiet && !in_init() && now_ns >= back_at_ns_) bus_off_ = false;
  if (pending_ == 0 || free_at_ns_ > now_ns) {
    if (pending_ == 0) free_at_ns_ = now_ns + frame_ns;
    return;
  }
  if (!acknowledged || bus_off_ || in_init()) return;
  const std::uint32_t base = start_word(can.TXBC);
  const CanFrame head = element(base + get_ * 4);
  const bool queued = (pending_ & 1U << get_) != 0;
  const CanFrame urgent = element(base);
  CanFrame out;
  if ((pending_ & 1U) != 0 && (!queued || urgent.id <= head.id)) {
    out = urgent;
    pending_ &= ~1U;
    if (queued) ++overtaken;
  } else {
    out = head;
    pending_ &= ~(1U << get_);
    get_ = get_ == 8 ? 1 : get_ + 1;
  }
  free_at_ns_ = now_ns + frame_ns;
  sent.push_back(out);
  if (on_sent) on_sent(out);
}

}  // namespace r4::fake
