// SPDX-License-Identifier: GPL-3.0-or-later
#include "fdcan.hpp"

namespace r4 {
namespace giga {

namespace {

constexpr std::uint32_t cccr_init = 1U << 0;
constexpr std::uint32_t cccr_change =
    1U << 1;  // CCE: settings may change; also discards waiting frames
constexpr std::uint32_t psr_passive = 1U << 5;
constexpr std::uint32_t psr_warning = 1U << 6;
constexpr std::uint32_t psr_bus_off = 1U << 7;
constexpr std::uint32_t ir_fifo0_new = 1U << 0;
constexpr std::uint32_t ir_fifo0_lost = 1U << 3;
constexpr std::uint32_t ir_fifo1_new = 1U << 4;
constexpr std::uint32_t ir_bus_off = 1U << 25;
constexpr std::uint32_t ir_all = 0x3FCFFFFF;
constexpr std::uint32_t gfc_reject_everything_else = 0x3F;  // unmatched ids and remote frames
constexpr std::uint32_t overwrite = 1U << 31;               // F1OM
constexpr std::uint32_t txfqs_full = 1U << 21;

// Message RAM in words. An element with 8 data bytes takes four.
constexpr std::uint32_t element_words = 4;
constexpr std::uint32_t filters = 2;
constexpr std::uint32_t extended_filters = 1;
constexpr std::uint32_t extended_filter_words = 2;
constexpr std::uint32_t fifo0_size = 64;
constexpr std::uint32_t fifo1_size = 8;
constexpr std::uint32_t transmit_size = 8;
constexpr std::uint32_t filter_word = 0;
constexpr std::uint32_t extended_word = filter_word + filters;
constexpr std::uint32_t fifo0_word = extended_word + extended_filters * extended_filter_words;
constexpr std::uint32_t fifo1_word = fifo0_word + fifo0_size * element_words;
constexpr std::uint32_t urgent_word = fifo1_word + fifo1_size * element_words;
constexpr std::uint32_t end_word = urgent_word + (1 + transmit_size) * element_words;
static_assert(end_word == Fdcan::words_used, "the layout of the message RAM");

// A standard message ID filter element: matches two ids, stores into FIFO 0 or 1.
constexpr std::uint32_t filter_element(std::uint32_t id, std::uint32_t other, std::uint32_t fifo) {
  return 1U << 30 | (fifo + 1) << 27 | id << 16 | other;
}

constexpr std::uint32_t extended_element(std::uint32_t id, std::uint32_t fifo) {
  return (fifo + 1) << 29 | id;
}
constexpr std::uint32_t extended_mask(std::uint32_t mask) { return 2U << 30 | mask; }

constexpr std::uint32_t element_extended = 1U << 30;
constexpr std::uint32_t element_remote = 1U << 29;
constexpr std::uint32_t element_id_shift = 18;
constexpr std::uint32_t element_size_shift = 16;

std::uint32_t word_of(const std::uint8_t* bytes) {
  return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 |
         std::uint32_t{bytes[3]} << 24;
}

void to_bytes(std::uint32_t word, std::uint8_t* bytes) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(word >> (8 * i));
}

}  // namespace

CanBitTiming can_bit_timing(std::uint32_t kernel_hz, std::uint32_t bit_rate) {
  CanBitTiming timing;
  const std::uint32_t quanta = kernel_hz / bit_rate;
  if (quanta * bit_rate != kernel_hz || quanta < 15 || quanta > 255) return timing;
  timing.after_sample = (quanta * 2 + 7) / 15;  // 2/15 of a bit, rounded
  timing.before_sample = quanta - 1 - timing.after_sample;
  timing.jump = timing.after_sample;
  timing.valid = true;
  return timing;
}

const char* to_text(CanState state) {
  switch (state) {
    case CanState::off:
      return "off";
    case CanState::active:
      return "active";
    case CanState::warning:
      return "warning";
    case CanState::passive:
      return "passive";
    case CanState::bus_off:
      return "bus-off";
  }
  return "unknown";
}

// Waits a few clock periods until the controller has copied INIT into its other clock domain.
bool Fdcan::set_init(bool wanted) {
  constexpr int patience = 1000;
  const std::uint32_t others = registers_.CCCR & ~cccr_init;
  registers_.CCCR = others | (wanted ? cccr_init : 0);
  for (int i = 0; i < patience; ++i) {
    if (((registers_.CCCR & cccr_init) != 0) == wanted) return true;
  }
  return false;
}

bool Fdcan::start(const CanBitTiming& timing, std::uint32_t stop_id, std::uint32_t command_id,
                  std::uint32_t watch_id) {
  started_ = false;
  if (!timing.valid || !set_init(true)) return false;
  registers_.CCCR =
      cccr_init | cccr_change;  // all other bits 0: classic frames, repeated until acknowledged
  registers_.NBTP = (timing.jump - 1) << 25 | (timing.prescaler - 1) << 16 |
                    (timing.before_sample - 1) << 8 | (timing.after_sample - 1);

  for (std::uint32_t i = 0; i < words_used; ++i) ram_[i] = 0;
  ram_[filter_word] = filter_element(stop_id, stop_id, 1);
  ram_[filter_word + 1] = filter_element(command_id, watch_id, 0);
  ram_[extended_word] = extended_element(stop_id << element_id_shift, 1);  // stops with a number
  ram_[extended_word + 1] = extended_mask(max_can_id << element_id_shift);
  registers_.GFC = gfc_reject_everything_else;
  registers_.SIDFC = filters << 16 | filter_word << 2;
  registers_.XIDFC = extended_filters << 16 | extended_word << 2;
  registers_.XIDAM = 0x1FFFFFFF;
  registers_.RXF0C = fifo0_size << 16 | fifo0_word << 2;
  registers_.RXF1C = overwrite | fifo1_size << 16 | fifo1_word << 2;
  registers_.RXESC = 0;  // 8 bytes
  registers_.TXESC = 0;
  registers_.TXEFC = 0;
  registers_.TXBC = transmit_size << 24 | 1U << 16 | urgent_word << 2;

  registers_.IR = ir_all;
  registers_.ILS = 0;
  registers_.IE = ir_fifo0_new | ir_fifo1_new | ir_bus_off;
  registers_.ILE = 1;
  bus_off_ = false;
  pending_before_ = 0;
  started_ = set_init(false);
  return started_;
}

void Fdcan::read_element(std::uint32_t word, CanFrame& frame) const {
  const std::uint32_t header = ram_[word];
  const std::uint32_t length = ram_[word + 1] >> element_size_shift & 0xF;
  frame = CanFrame{};
  frame.extended = (header & element_extended) != 0;
  frame.remote = (header & element_remote) != 0;
  frame.id = frame.extended ? header & 0x1FFFFFFF : header >> element_id_shift & max_can_id;
  frame.size = static_cast<std::uint8_t>(length < 8 ? length : 8);
  to_bytes(ram_[word + 2], frame.data);
  to_bytes(ram_[word + 3], frame.data + 4);
}

bool Fdcan::receive(CanFrame& frame) {
  if (!started_) return false;
  const std::uint32_t stops = registers_.RXF1S;
  if ((stops & 0x7F) != 0) {
    const std::uint32_t index = stops >> 8 & 0x3F;
    read_element(fifo1_word + index * element_words, frame);
    registers_.RXF1A = index;
  } else {
    const std::uint32_t commands = registers_.RXF0S;
    if ((commands & 0x7F) == 0) return false;
    const std::uint32_t index = commands >> 8 & 0x3F;
    read_element(fifo0_word + index * element_words, frame);
    registers_.RXF0A = index;
  }
  ++counters_.received;
  return true;
}

void Fdcan::write_element(std::uint32_t index, const CanFrame& frame) {
  const std::uint32_t word = urgent_word + index * element_words;
  ram_[word] = frame.id << element_id_shift;
  ram_[word + 1] = std::uint32_t{frame.size} << element_size_shift;
  ram_[word + 2] = word_of(frame.data);
  ram_[word + 3] = word_of(frame.data + 4);
  registers_.TXBAR = 1U << index;
  ++counters_.sent;
}

bool Fdcan::send(const CanFrame& frame) {
  if (!on_bus()) return false;
  const std::uint32_t status = registers_.TXFQS;
  if ((status & txfqs_full) != 0) return false;
  write_element(status >> 16 & 0x1F, frame);
  return true;
}

bool Fdcan::send_urgent(const CanFrame& frame) {
  if (!on_bus() || (registers_.TXBRP & 1U) != 0) return false;
  write_element(0, frame);
  return true;
}

void Fdcan::drop_pending() {
  registers_.TXBCR = registers_.TXBRP;
  pending_before_ = 0;
}

Fdcan::Event Fdcan::poll(std::uint32_t now_us) {
  if (!started_) return Event::none;
  if ((registers_.IR & ir_fifo0_lost) != 0) {
    registers_.IR = ir_fifo0_lost;
    ++counters_.lost;
  }
  if (bus_off_) {
    if (now_us - bus_off_since_us_ >= bus_off_us) {
      registers_.CCCR = registers_.CCCR | cccr_change;
      bus_off_ = !set_init(false);
      bus_off_since_us_ = now_us;
      moved_us_ = now_us;
      pending_before_ = 0;
    }
    return Event::none;
  }
  if ((registers_.PSR & psr_bus_off) != 0 && (registers_.CCCR & cccr_init) != 0) {
    bus_off_ = true;
    bus_off_since_us_ = now_us;
    ++counters_.bus_offs;
    return Event::bus_off;
  }
  const std::uint32_t pending = registers_.TXBRP;
  if (pending == 0 || pending != pending_before_ || counters_.sent != sent_before_) {
    pending_before_ = pending;
    sent_before_ = counters_.sent;
    moved_us_ = now_us;
  } else if (now_us - moved_us_ >= stale_us) {
    drop_pending();
    ++counters_.stale;
    return Event::stale;
  }
  return Event::none;
}

bool Fdcan::on_interrupt() {
  // Clears only what was seen, because a stop may arrive meanwhile.
  const std::uint32_t seen = registers_.IR & (ir_fifo0_new | ir_fifo1_new | ir_bus_off);
  registers_.IR = seen;
  return (seen & ir_fifo1_new) != 0;
}

CanState Fdcan::state() const {
  if (!started_) return CanState::off;
  const std::uint32_t status = registers_.PSR;
  if (bus_off_ || (status & psr_bus_off) != 0) return CanState::bus_off;
  if ((status & psr_passive) != 0) return CanState::passive;
  return (status & psr_warning) != 0 ? CanState::warning : CanState::active;
}

}  // namespace giga
}  // namespace r4
