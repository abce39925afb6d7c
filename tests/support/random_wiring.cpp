// SPDX-License-Identifier: GPL-3.0-or-later
#include "random_wiring.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <vector>

#include "protocol/wiring/giga_pins.hpp"

namespace r4::test {

namespace {

class RandomWiring {
 public:
  explicit RandomWiring(std::uint64_t seed) : random_(seed) {}

  Wiring make() {
    wiring_.at(SignalKind::chip_bus).byte = static_cast<std::uint8_t>(below(2));
    choose_addresses();
    choose_pins();
    choose_lines();
    deal({SignalKind::servo}, numbers(2 * pca9685_lines, 3 * pca9685_lines));
    deal({SignalKind::bldc_speed}, numbers(0, 4));
    deal({SignalKind::bldc_direction, SignalKind::bldc_brake, SignalKind::relay}, numbers(0, 16));
    choose_options();
    leave_some_out();
    return wiring_;
  }

 private:
  int below(int end) { return std::uniform_int_distribution<int>(0, end - 1)(random_); }

  std::vector<int> numbers(int first, int end) {
    std::vector<int> all;
    for (int i = first; i < end; ++i) all.push_back(i);
    std::shuffle(all.begin(), all.end(), random_);
    return all;
  }

  void put(int signal, int number) {
    wiring_.places[signal].byte = static_cast<std::uint8_t>(number);
  }

  // Gives each signal of these kinds one of the places.
  void deal(const std::vector<SignalKind>& kinds, std::vector<int> places) {
    for (const SignalKind kind : kinds) {
      for (int i = 0; i < row_of(kind).channels; ++i) {
        put(row_of(kind).first + i, places.back());
        places.pop_back();
      }
    }
  }

  void choose_addresses() {
    std::set<int> used{0x70};
    const auto choose = [&](int signal, int first, int end) {
      int address = first + below(end - first);
      while (!used.insert(address).second) address = first + below(end - first);
      put(signal, address);
    };
    choose(signals::dac_chip, 0x61, 0x68);
    choose(signals::expander_chip, 0x20, 0x28);
    for (const int chip : {signals::osmc_chip, signals::dhb12_chip, signals::servo_chip}) {
      choose(chip, 0x40, 0x78);
    }
  }

  void choose_pins() {
    std::vector<int> free;
    for (const int pin : numbers(0, giga_pin_count)) {
      if (giga_pins[pin].user == PinUser::none) free.push_back(pin);
    }
    const auto take = [&free](auto may) {
      const auto at = std::find_if(free.begin(), free.end(), may);
      if (at == free.end()) return -1;
      const int pin = *at;
      free.erase(at);
      return pin;
    };
    for (int i = signals::analog; i <= signals::analog_last; ++i) {
      put(i, take([](int pin) {
            return pin >= first_analog_pin && pin < first_analog_pin + analog_pin_count;
          }));
    }
    std::set<int> lines{wifi_interrupt_line};
    for (int i = signals::handle; i <= signals::gpio_last; ++i) {
      if (row_of(signal_kind(i)).terminal != Terminal::interrupt_pin) continue;
      const int pin = take([&](int p) { return lines.count(giga_pins[p].number) == 0; });
      lines.insert(giga_pins[pin].number);
      put(i, pin);
    }
    for (int i = signals::handle; i <= signals::gpio_last; ++i) {
      if (row_of(signal_kind(i)).terminal != Terminal::pin) continue;
      put(i, take([](int) { return true; }));
    }
  }

  // Gives each motor two lines of a chip, not too far from each other.
  void choose_lines() {
    std::vector<int> free = numbers(0, 2 * pca9685_lines);
    for (const auto& [pwm, direction] :
         {std::pair(SignalKind::osmc_pwm, SignalKind::osmc_direction),
          std::pair(SignalKind::dhb12_pwm, SignalKind::dhb12_direction)}) {
      for (int channel = 1; channel <= row_of(pwm).channels; ++channel) {
        const int first = free.back();
        free.pop_back();
        const auto near = std::find_if(free.begin(), free.end(), [first](int line) {
          return line / pca9685_lines == first / pca9685_lines &&
                 std::abs(line - first) < partner_lines;
        });
        ASSERT_NE(near, free.end());
        put(signal_index(pwm, channel), first);
        put(signal_index(direction, channel), *near);
        free.erase(near);
      }
    }
  }

  void choose_options() {
    for (int i = 0; i < signal_count; ++i) {
      if (row_of(signal_kind(i)).has_option && below(2) == 0) {
        wiring_.places[i].byte |= Place::option_bit;
      }
    }
  }

  void leave_some_out() {
    constexpr int one_of = 12;
    for (int i = signals::osmc_chip; i < signal_count; ++i) {
      if (below(one_of) != 0) continue;
      const SignalRow& row = row_of(signal_kind(i));
      wiring_.places[i] = {};
      wiring_.places[row_of(row.partner).first + i - row.first] = {};
    }
    // In a pair, the second signal may be left out without the first.
    for (int i = 0; i < signal_count; ++i) {
      const SignalRow& row = row_of(signal_kind(i));
      const int partner = row_of(row.partner).first + i - row.first;
      if (!wiring_.places[partner].connected()) wiring_.places[i] = {};
    }
  }

  std::mt19937_64 random_;
  Wiring wiring_;
};

}  // namespace

Wiring random_wiring(std::uint64_t seed) {
  const Wiring wiring = RandomWiring(seed).make();
  const WiringCheck found = check(wiring);
  EXPECT_EQ(found.fault, WiringFault::none) << "seed " << seed << ", signal " << int{found.signal};
  return wiring;
}

}  // namespace r4::test
