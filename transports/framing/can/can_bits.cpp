// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/can/can_bits.hpp"

namespace r4 {
namespace {

// The parts of a frame, in bits (ISO 11898-1:2015, 10.4.2 and 10.4.3).
constexpr std::uint32_t length_code_bits = 4;
constexpr std::uint32_t crc_delimiter_bits = 1;
constexpr std::uint32_t acknowledge_slot_bits = 1;
constexpr std::uint32_t tail_bits = acknowledge_slot_bits + can_acknowledge_delimiter_bits +
                                    can_end_of_frame_bits + can_intermission_bits;

constexpr std::uint32_t classic_crc_bits = 15;
constexpr std::uint32_t classic_crc_polynomial = 0x4599;  // x^15+x^14+x^10+x^8+x^7+x^4+x^3+1

// Before the length code of a classic frame: SOF, id, RTR, IDE, r0; 29-bit ids add SRR and r1.
constexpr std::uint32_t classic_header_bits(bool extended) { return extended ? 35 : 15; }

// Before FDF, res and BRS of an FD frame: SOF, id, RRS, IDE; 29-bit ids add SRR.
constexpr std::uint32_t fd_arbitration_bits(bool extended) { return extended ? 33 : 14; }
constexpr std::uint32_t fd_format_bits = 3;
constexpr std::uint32_t error_state_bits = 1;

// Stuff count and CRC with fixed stuff bits: one before the count, one after every fourth bit.
constexpr std::uint32_t stuff_count_bits = 4;
constexpr std::uint8_t max_crc17_size = 16;  // bytes; CRC-21 for longer frames
constexpr std::uint32_t fd_crc_field_bits(std::uint8_t size) {
  return size <= max_crc17_size ? (stuff_count_bits + 17) + 1 + (stuff_count_bits + 17) / 4
                                : (stuff_count_bits + 21) + 1 + (stuff_count_bits + 21) / 4;
}

class StuffedBits {
 public:
  void bit(std::uint32_t value) {
    settle();
    const std::uint32_t out = (crc_ >> (classic_crc_bits - 1) & 1U) ^ value;
    crc_ = (crc_ << 1 & 0x7FFFU) ^ (out != 0 ? classic_crc_polynomial : 0U);
    ++count_;
    run_ = value == last_ ? run_ + 1 : 1;
    last_ = value;
  }
  void bits(std::uint32_t value, std::uint32_t width) {
    while (width-- != 0) bit(value >> width & 1U);
  }
  void data(const CanFrame& frame) {
    for (std::uint32_t i = 0; i < frame.size; ++i) bits(frame.data[i], 8);
  }
  // Counts a stuff bit that is due after the last bit; otherwise only the next bit counts it.
  void settle() {
    if (run_ < 5) return;
    ++count_;
    last_ ^= 1U;
    run_ = 1;
  }
  std::uint32_t count() const { return count_; }
  std::uint32_t crc() const { return crc_; }

 private:
  std::uint32_t count_ = 0;
  std::uint32_t crc_ = 0;
  std::uint32_t run_ = 0;
  std::uint32_t last_ = 2;  // neither 0 nor 1
};

void write_arbitration(StuffedBits& out, const CanFrame& frame, std::uint32_t request) {
  out.bit(0);
  if (frame.extended) {
    out.bits(frame.id >> 18 & max_can_id, 11);
    out.bits(3, 2);  // SRR, IDE
    out.bits(frame.id & 0x3FFFFU, 18);
    out.bit(request);
  } else {
    out.bits(frame.id & max_can_id, 11);
    out.bit(request);
    out.bit(0);  // IDE
  }
}

std::uint32_t length_code(std::uint8_t size) {
  return size <= 8    ? size
         : size <= 24 ? 9U + (size - 12U) / 4U
         : size == 32 ? 13U
         : size == 48 ? 14U
                      : 15U;
}

// A remote frame has a length code but no data.
CanBits classic_bits(const CanFrame& frame) {
  StuffedBits out;
  write_arbitration(out, frame, frame.remote ? 1 : 0);
  out.bits(0, frame.extended ? 2 : 1);  // r1, r0
  out.bits(frame.size, length_code_bits);
  if (!frame.remote) out.data(frame);
  out.bits(out.crc(), classic_crc_bits);
  out.settle();
  return {out.count() + crc_delimiter_bits + tail_bits, 0};
}

CanBits split(std::uint32_t before_switch, std::uint32_t after, bool switches_rate) {
  return switches_rate ? CanBits{before_switch + tail_bits, after}
                       : CanBits{before_switch + after + tail_bits, 0};
}

// The first fixed stuff bit of the CRC field replaces a stuff bit that is due after the data.
CanBits fd_bits(const CanFrame& frame, bool switches_rate) {
  StuffedBits out;
  write_arbitration(out, frame, 0);
  out.bit(1);  // FDF
  out.bit(0);  // res
  out.bit(switches_rate ? 1 : 0);
  const std::uint32_t before_switch = out.count();
  out.bit(0);  // ESI
  out.bits(length_code(frame.size), length_code_bits);
  out.data(frame);
  const std::uint32_t after =
      out.count() - before_switch + fd_crc_field_bits(frame.size) + crc_delimiter_bits;
  return split(before_switch, after, switches_rate);
}

// One stuff bit after five bits, then one after every four, because it counts as one of five.
constexpr std::uint32_t most_stuff_bits(std::uint32_t bits) { return (bits - 1) / 4; }

constexpr std::uint64_t part_ns(std::uint32_t bits, std::uint32_t rate) {
  return rate == 0 ? 0 : (std::uint64_t{bits} * 1000000000U + rate - 1) / rate;
}

CanBits bits_of_length(std::uint8_t size, bool fd, bool extended, bool switches_rate, bool worst) {
  const std::uint32_t data = 8U * size;
  if (!fd) {
    const std::uint32_t stuffed =
        classic_header_bits(extended) + length_code_bits + data + classic_crc_bits;
    const std::uint32_t stuff = worst ? most_stuff_bits(stuffed) : 0;
    return {stuffed + stuff + crc_delimiter_bits + tail_bits, 0};
  }
  // FDF is 1 and res 0, so no bit is stuffed from FDF to BRS. BRS, possibly with res, begins the
  // five bits before the next stuff bit. A fixed stuff bit follows the data.
  const std::uint32_t arbitration = fd_arbitration_bits(extended);
  const std::uint32_t behind = error_state_bits + length_code_bits + data;
  const std::uint32_t before_switch =
      arbitration + fd_format_bits + (worst ? most_stuff_bits(arbitration) : 0);
  const std::uint32_t after =
      behind + (worst ? most_stuff_bits(behind) : 0) + fd_crc_field_bits(size) + crc_delimiter_bits;
  return split(before_switch, after, switches_rate);
}

}  // namespace

CanBits can_bits(const CanFrame& frame, bool switches_rate) {
  return frame.fd ? fd_bits(frame, switches_rate) : classic_bits(frame);
}

CanBits worst_can_bits(std::uint8_t size, bool fd, bool extended, bool switches_rate) {
  return bits_of_length(size, fd, extended, switches_rate, true);
}

CanBits least_can_bits(std::uint8_t size, bool fd, bool extended, bool switches_rate) {
  return bits_of_length(size, fd, extended, switches_rate, false);
}

std::uint64_t time_ns(CanBits bits, CanBitRate rate) {
  return part_ns(bits.nominal, rate.nominal) + part_ns(bits.data, rate.data);
}

std::uint64_t time_ns(const CanFrame& frame, CanBitRate rate) {
  return time_ns(can_bits(frame, rate.data != 0), rate);
}

}  // namespace r4
