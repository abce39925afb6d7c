// SPDX-License-Identifier: GPL-3.0-or-later
#include "user_uart_model.hpp"

#include <initializer_list>

namespace r4 {
namespace sim {

namespace {

constexpr std::uint32_t epoch_ms = 100;  // period of the GNSS receiver
constexpr std::uint32_t period_ms = 10;  // period of the lidar
constexpr int sentences = 5;
constexpr std::uint32_t thousand = 1000;

UartMode mode_of_peers() {
  UartMode mode;
  mode.baud = 115200;
  return mode;
}

char hex_digit(unsigned value) { return "0123456789ABCDEF"[value & 0xF]; }

}  // namespace

void UserUartModel::connect(UartPeer peer) {
  peer_ = peer;
  size_ = at_ = 0;
  sentence_ = sentences;
}

void UserUartModel::set_up(const UartMode& mode) {
  mode_ = mode;
  drop();
  received_.cut(0);
  lost_ = out_bits_ = in_bits_ = 0;
}

std::uint32_t UserUartModel::bits_of_byte() const {
  return 1 + 8 + (mode_.parity == 'N' ? 0U : 1U) + mode_.stop_bits;
}

void UserUartModel::pass_millisecond() {
  ++now_ms_;
  if (now_ms_ % epoch_ms == 0) sentence_ = 0;
  const bool talks = peer_ == UartPeer::gnss || peer_ == UartPeer::lidar;
  if (talks && !has_byte()) say_more();
  if (!mode_.on()) {
    at_ = size_ = 0;
    return;
  }
  const std::uint32_t byte = bits_of_byte() * thousand;
  out_bits_ += mode_.baud;
  for (; out_bits_ >= byte; out_bits_ -= byte) {
    char sent = 0;
    if (!waiting_.take(sent)) {
      out_bits_ = 0;
      break;
    }
    ++sent_;
    if (peer_ == UartPeer::loop) arrive(static_cast<std::uint8_t>(sent), false);
  }
  in_bits_ += talks ? mode_of_peers().baud : mode_.baud;
  for (; in_bits_ >= byte; in_bits_ -= byte) {
    if (peer_ == UartPeer::noise) {
      chance_ = chance_ * 1664525U + 1013904223U;
      ++said_;
      arrive(static_cast<std::uint8_t>(chance_ >> 24), (chance_ >> 22 & 3) == 0);
      continue;
    }
    if (!has_byte() && talks) say_more();
    if (!has_byte()) {
      in_bits_ = 0;
      break;
    }
    ++said_;
    arrive(static_cast<std::uint8_t>(text_[at_++]), mode_ != mode_of_peers());
  }
}

void UserUartModel::arrive(std::uint8_t byte, bool damaged) {
  if (damaged || !received_.put(static_cast<char>(byte))) ++lost_;
}

std::size_t UserUartModel::receive(std::uint8_t* out, std::size_t size) {
  return received_.take(reinterpret_cast<char*>(out), static_cast<std::uint32_t>(size));
}

std::uint32_t UserUartModel::take_lost() {
  const std::uint32_t lost = lost_;
  lost_ = 0;
  return lost;
}

bool UserUartModel::send(const std::uint8_t* bytes, std::size_t size) {
  return waiting_.put(reinterpret_cast<const char*>(bytes), static_cast<std::uint32_t>(size));
}

void UserUartModel::drop() { waiting_.cut(0); }

void UserUartModel::say_more() {
  if (peer_ == UartPeer::gnss && sentence_ < sentences) {
    say_sentence();
  } else if (peer_ == UartPeer::lidar && now_ms_ % period_ms == 0) {
    say_distance();
  }
}

void UserUartModel::put(const char* text) {
  while (*text != '\0') text_[size_++] = *text++;
}

void UserUartModel::put_number(std::uint32_t value, int digits) {
  for (int i = digits - 1; i >= 0; --i) {
    text_[size_ + static_cast<std::size_t>(i)] = static_cast<char>('0' + value % 10);
    value /= 10;
  }
  size_ += static_cast<std::size_t>(digits);
}

// NMEA 0183 sentences of a receiver that does not move.
void UserUartModel::say_sentence() {
  at_ = size_ = 0;
  const std::uint32_t epoch = now_ms_ / epoch_ms;
  const std::uint32_t s = epoch / 10;
  const bool timed = sentence_ < 2;
  put(sentence_ == 0 ? "$GPRMC," : sentence_ == 1 ? "$GPGGA," : "");
  if (timed) {
    put_number(s / 3600 % 24, 2);
    put_number(s / 60 % 60, 2);
    put_number(s % 60, 2);
    put(".");
    put_number(epoch % 10 * 10, 2);
  }
  switch (sentence_++) {
    case 0:
      put(",A,5313.6240,N,00032.5160,W,0.02,31.66,251126,,,A");
      break;
    case 1:
      put(",5313.6240,N,00032.5160,W,1,08,1.01,63.9,M,47.0,M,,");
      break;
    case 2:
      put("$GPGSA,A,3,02,05,07,13,15,20,29,30,,,,,1.84,1.01,1.54");
      break;
    case 3:
      put("$GPGSV,2,1,08,02,71,216,45,05,38,304,42,07,11,327,33,13,52,259,44");
      break;
    default:
      put("$GPGSV,2,2,08,15,24,201,39,20,08,352,28,29,19,078,36,30,62,085,46");
      break;
  }
  unsigned sum = 0;
  for (std::size_t i = 1; i < size_; ++i) sum ^= static_cast<unsigned char>(text_[i]);
  put("*");
  text_[size_++] = hex_digit(sum >> 4);
  text_[size_++] = hex_digit(sum);
  put("\r\n");
}

// A target approaches from 3 m to 1 m, repeatedly.
void UserUartModel::say_distance() {
  const std::uint32_t cm = 300 - now_ms_ / period_ms % 200;
  constexpr std::uint32_t strength = 1200;
  constexpr std::uint32_t temperature = (25 + 256) * 8;
  at_ = size_ = 0;
  text_[size_++] = 0x59;
  text_[size_++] = 0x59;
  for (const std::uint32_t value : {cm, strength, temperature}) {
    text_[size_++] = static_cast<char>(value & 0xFF);
    text_[size_++] = static_cast<char>(value >> 8);
  }
  unsigned sum = 0;
  for (std::size_t i = 0; i < size_; ++i) sum += static_cast<unsigned char>(text_[i]);
  text_[size_++] = static_cast<char>(sum & 0xFF);
}

}  // namespace sim
}  // namespace r4
