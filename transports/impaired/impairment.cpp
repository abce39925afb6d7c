// SPDX-License-Identifier: GPL-3.0-or-later
#include "impairment.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "r4link/error.hpp"

namespace r4 {
namespace {

[[noreturn]] void refuse(std::string_view part, std::string_view reason) {
  throw Error(
      ErrorKind::usage, std::string(part), std::string(reason),
      "write a link as in loss=5%,delay=20ms±10,duplicate=1%,corrupt=0.1%,cut=10s+2s,seed=7");
}

double number(std::string_view part, std::string_view& text, double most) {
  double value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed);
  if (error != std::errc() || !(value >= 0 && value <= most)) {
    refuse(part, "is not a number from 0 to " + std::to_string(static_cast<long>(most)));
  }
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

bool take(std::string_view& text, std::string_view beginning) {
  if (!text.starts_with(beginning)) return false;
  text.remove_prefix(beginning.size());
  return true;
}

double share(std::string_view part, std::string_view text) {
  const double percent = number(part, text, 100);
  if (text != "%") refuse(part, "is not a valid share: expected percent, such as 5%");
  return percent / 100;
}

// A time of at most an hour. If the text has no unit, `unit` is used.
Time duration(std::string_view part, std::string_view& text, std::string_view unit) {
  const double value = number(part, text, 3'600'000);
  const bool ms = take(text, "ms");
  const bool s = !ms && take(text, "s");
  const bool seconds = s || (!ms && unit == "s");
  const double us = value * (seconds ? 1e6 : 1e3);
  if (us > 3.6e9) refuse(part, "is longer than an hour");
  return Time(static_cast<std::int64_t>(us));
}

}  // namespace

Impairment Impairment::parse(std::string_view text) {
  Impairment result;
  while (true) {
    const std::string_view part = text.substr(0, text.find(','));
    std::string_view value = part.substr(std::min(part.size(), part.find('=') + 1));
    const std::string_view key = part.substr(0, part.find('='));
    if (key == "loss") {
      result.loss = share(part, value);
    } else if (key == "duplicate") {
      result.duplicate = share(part, value);
    } else if (key == "corrupt") {
      result.corrupt = share(part, value);
    } else if (key == "delay") {
      result.delay = duration(part, value, "ms");
      if (take(value, "±") || take(value, "+-")) result.jitter = duration(part, value, "ms");
      if (!value.empty()) refuse(part, "is not a valid delay");
      if (result.jitter > result.delay)
        refuse(part, "is not a valid delay: the variation is larger than the delay");
    } else if (key == "cut") {
      result.cut_at = duration(part, value, "s");
      if (!take(value, "+")) refuse(part, "is not a valid cut: the duration is missing");
      result.cut_for = duration(part, value, "s");
      if (!value.empty()) refuse(part, "is not a valid cut");
    } else if (key == "seed") {
      const auto [end, error] =
          std::from_chars(value.data(), value.data() + value.size(), result.seed);
      if (error != std::errc() || end != value.data() + value.size()) {
        refuse(part, "is not a whole number");
      }
    } else {
      refuse(part.empty() ? "''" : part, "is not a property of a link");
    }
    if (part.size() == text.size()) return result;
    text.remove_prefix(part.size() + 1);
  }
}

ImpairedDirection::ImpairedDirection(const Impairment& impairment, std::uint64_t stream,
                                     Time opened)
    : impairment_(impairment),
      opened_(opened),
      random_(impairment.seed * 0x9E3779B97F4A7C15U + stream) {}

// Always draws a number, so that a change of one impairment leaves the other effects unchanged.
bool ImpairedDirection::happens(double chance) {
  return static_cast<double>(random_() >> 11) * 0x1p-53 < chance;
}

void ImpairedDirection::put(Time now, Item item) {
  const bool lost = happens(impairment_.loss);
  const bool twice = happens(impairment_.duplicate);
  const bool corrupted = happens(impairment_.corrupt);
  const std::uint64_t where = random_();
  const Time since = now - opened_;
  if (impairment_.cut_for > Time(0) && since >= impairment_.cut_at &&
      since < impairment_.cut_at + impairment_.cut_for) {
    ++counters_.cut;
    return;
  }
  if (lost) {
    ++counters_.lost;
    return;
  }
  if (corrupted && !item.bytes.empty()) {
    char& byte = item.bytes[static_cast<std::size_t>(where / 8 % item.bytes.size())];
    byte = static_cast<char>(static_cast<unsigned char>(byte) ^ (1U << where % 8));
    ++counters_.corrupted;
  }
  if (twice) {
    ++counters_.duplicated;
    send_off(now, item);
  }
  send_off(now, std::move(item));
}

void ImpairedDirection::send_off(Time now, Item item) {
  const double way = static_cast<double>(random_() >> 11) * 0x1p-53 * 2 - 1;
  const Time jitter(
      static_cast<std::int64_t>(way * static_cast<double>(impairment_.jitter.count())));
  if (on_their_way_.size() == most_on_their_way) {
    ++counters_.overflow;
    return;
  }
  on_their_way_.emplace(now + impairment_.delay + jitter, std::move(item));
}

std::optional<Time> ImpairedDirection::due() const {
  if (on_their_way_.empty()) return std::nullopt;
  return on_their_way_.begin()->first;
}

std::optional<ImpairedDirection::Item> ImpairedDirection::take(Time now) {
  if (on_their_way_.empty() || on_their_way_.begin()->first > now) return std::nullopt;
  Item item = std::move(on_their_way_.begin()->second);
  on_their_way_.erase(on_their_way_.begin());
  ++counters_.passed;
  return item;
}

}  // namespace r4
