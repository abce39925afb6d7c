// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "../text_file.hpp"
#include "names.hpp"
#include "r4link/error.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4 {

namespace {

constexpr std::string_view first_line = "r4-wiring 1";

constexpr std::string_view introduction =
    "# Which pin of the Giga, or which line of a chip, serves each signal of an R4 board.\n"
    "# Compare each line with the board's schematic (docs/reference/wiring.md).\n"
    "#     SIGNAL = PLACE [OPTION]     'none' as the place: not connected, or not fitted\n";

constexpr std::pair<std::string_view, std::string_view> remarks[] = {
    {"chip", "I2C bus of the chips, D20/D21 or SDA1/SCL1, and the addresses of the chips."},
    {"handle", "Dead-man's handle: 'low' if its input is low while it is held."},
    {"stepper", "Stepper motors. Direction 'inverted': low is forward."},
    {"encoder", "Encoders. The pins of a and b have interrupt lines of their own."},
    {"ultrasonic", "Ultrasonic sensors. The echo pins have interrupt lines of their own."},
    {"analog", "Analog inputs: A0 to A7."},
    {"input", "Spare inputs, pulled up."},
    {"osmc",
     "OSMC drivers: lines 0 to 15 of the chip osmc or dhb12. pwm 'two-pwm': the line pwm drives\n"
     "# forward, the line direction in reverse. Direction 'inverted': the other way round."},
    {"dhb12", "DHB12 drivers, likewise."},
    {"servo", "Servos: lines 0 to 15 of the chip servo."},
    {"bldc",
     "BLDC drivers: outputs VOUTA to VOUTD of the chip dac, lines GPA0 to GPB7 of the expander.\n"
     "# Direction 'inverted': low is forward. Brake 'inverted': low is on."},
    {"relay",
     "Relays. 1 is in the circuit of the dead-man's handle. 'inverted': low closes the relay."},
};

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::string single_spaced(std::string_view text) {
  std::string words;
  for (const char c : trimmed(text)) {
    const bool blank = c == ' ' || c == '\t';
    if (!blank) {
      words += c;
    } else if (words.back() != ' ') {
      words += ' ';
    }
  }
  return words;
}

class Reader {
 public:
  explicit Reader(const std::string& name) : name_(name) { lines_.fill(0); }

  Wiring read(std::string_view text) {
    if (text.size() > max_wiring_text) {
      throw Error(ErrorKind::data, name_, fmt::format("is longer than {} bytes", max_wiring_text),
                  "give a file as r4 wiring template writes it");
    }
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      ++line_;
      take(text.substr(0, end));
      text.remove_prefix(std::min(end + 1, text.size()));
    }
    require_whole();
    const WiringCheck found = check(wiring_);
    if (found.fault != WiringFault::none) {
      Problem problem = problem_of(wiring_, found);
      problem.thing = place(lines_[found.signal]) + ": " + problem.thing;
      throw Error(std::move(problem));
    }
    return wiring_;
  }

 private:
  std::string place(int line) const { return fmt::format("{}:{}", name_, line); }
  [[noreturn]] void fail(const std::string& reason, const std::string& fix) const {
    throw Error(ErrorKind::data, place(line_), reason, fix);
  }

  void take(std::string_view line) {
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) return;
    if (!begun_) {
      begun_ = single_spaced(line) == first_line;
      if (begun_) return;
      fail(fmt::format("'{}' is not a valid first line: expected '{}'", shown_word(line),
                       first_line),
           "give a file as r4 wiring template writes it");
    }
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) {
      fail(fmt::format("'{}' is not a valid line: expected SIGNAL = PLACE", shown_word(line)),
           "write a line such as: stepper 1 step = D2");
    }
    try {
      const int signal = signal_named(single_spaced(line.substr(0, equals)));
      int& defined = lines_[static_cast<std::size_t>(signal)];
      if (defined != 0) {
        fail(fmt::format("{} already has a place in line {}", signal_name(signal), defined),
             "delete one of the lines");
      }
      defined = line_;
      wiring_.places[signal] = place_named(signal, single_spaced(line.substr(equals + 1)));
    } catch (const Error& error) {
      Problem problem = error.problem();
      if (problem.thing != place(line_)) problem.thing = place(line_) + ": " + problem.thing;
      throw Error(std::move(problem));
    }
  }

  void require_whole() const {
    if (!begun_) {
      throw Error(ErrorKind::data, name_, "has no lines",
                  "give a file as r4 wiring template writes it");
    }
    for (int i = 0; i < signal_count; ++i) {
      if (lines_[static_cast<std::size_t>(i)] != 0) continue;
      throw Error(ErrorKind::data, name_, fmt::format("the signal '{}' is missing", signal_name(i)),
                  fmt::format("add a line such as: {} = {}", signal_name(i),
                              place_name(i, plan_wiring().places[i])));
    }
  }

  const std::string& name_;
  int line_ = 0;
  bool begun_ = false;
  Wiring wiring_;
  std::array<int, signal_count> lines_;  // the line of each signal; 0: not read yet
};

// A comment with the state field, if the field's name differs from the signal's.
std::string field_of(int signal) {
  const SignalKind kind = signal_kind(signal);
  const int channel = signal - row_of(kind).first + 1;
  StateField field = StateField::count;
  if (kind == SignalKind::analog) field = state_field(FieldKind::analog, channel);
  if (kind == SignalKind::dhb12_pwm) field = state_field(FieldKind::dhb12, channel);
  if (field == StateField::count) return "";
  const Text name = name_of(field);
  return "  # " + std::string(name.data(), name.size());
}

}  // namespace

std::string write_wiring(const Wiring& wiring) {
  std::string text(first_line);
  text.append("\n").append(introduction);
  for (int kind = 0; kind < signal_kind_count;) {
    const std::string_view name = words_of(signal_rows[kind].first).name;
    const auto* const remark = std::find_if(std::begin(remarks), std::end(remarks),
                                            [&](const auto& each) { return each.first == name; });
    if (remark != std::end(remarks)) text += fmt::format("\n# {}\n", remark->second);
    int end = kind;  // of the kinds with this name
    while (end < signal_kind_count && words_of(signal_rows[end].first).name == name) ++end;
    for (int channel = 0; channel < signal_rows[kind].channels; ++channel) {
      for (int each = kind; each < end; ++each) {
        const int signal = signal_rows[each].first + channel;
        text += fmt::format("{} = {}{}\n", signal_name(signal),
                            place_name(signal, wiring.places[signal]), field_of(signal));
      }
    }
    kind = end;
  }
  return text;
}

Wiring read_wiring(std::string_view text, const std::string& name) {
  return Reader(name).read(text);
}

Wiring load_wiring(const std::string& path) {
  return read_wiring(read_text_file(path, max_wiring_text, "name a wiring file"), path);
}

}  // namespace r4
