// SPDX-License-Identifier: GPL-3.0-or-later
#include "script.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

#include "../../../protocol/datagram/numbers.hpp"
#include "devices/optional_devices.hpp"
#include "devices/user_devices.hpp"
#include "r4link/error.hpp"
#include "r4link/state.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/vocabulary.hpp"
#include "r4link/wiring/wiring.hpp"
#include "robot/board_model.hpp"

namespace r4::sim {

namespace {

struct Line {
  std::string where;                    // FILE:LINE
  std::vector<std::string_view> words;  // without the time
  bool timed = true;
};

[[noreturn]] void fail(const Line& line, std::string_view what, const std::string& reason,
                       const std::string& fix) {
  throw Error(ErrorKind::data, line.where, "'" + std::string(what) + "' " + reason, fix);
}

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view blanks = " \t\r\n";
  line = line.substr(0, line.find('#'));
  std::vector<std::string_view> words;
  for (std::size_t at = line.find_first_not_of(blanks); at != std::string_view::npos;
       at = line.find_first_not_of(blanks, at)) {
    const std::size_t end = std::min(line.find_first_of(blanks, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

// Seconds with up to three decimals, as milliseconds.
std::uint32_t milliseconds_of(const Line& line, std::string_view word, const char* fix) {
  constexpr std::uint32_t max_s = 1000000;
  const std::size_t point = std::min(word.find('.'), word.size());
  std::string thousandths(word.substr(std::min(point + 1, word.size())));
  const bool has_point = point != word.size();
  std::uint32_t seconds = 0;
  std::uint32_t milliseconds = 0;
  const bool good_length = has_point ? !thousandths.empty() && thousandths.size() <= 3 : true;
  thousandths.resize(3, '0');
  if (!good_length || !parse_number(Text(word.substr(0, point)), seconds) || seconds > max_s ||
      !parse_number(Text(thousandths), milliseconds)) {
    fail(line, word, "is not a valid time", fix);
  }
  return seconds * 1000 + milliseconds;
}

int channel_of(const Line& line, int channels, const char* what) {
  std::uint32_t channel = 0;
  if (!parse_number(Text(line.words[1]), channel) || channel < 1 ||
      channel > static_cast<std::uint32_t>(channels)) {
    fail(line, line.words[1], std::string("is not a valid ") + what,
         "there are 1 to " + std::to_string(channels));
  }
  return static_cast<int>(channel);
}

void read_handle(const Line& line, ScriptStep& step) {
  if (line.words[1] != "held" && line.words[1] != "released") {
    fail(line, line.words[1], "is nothing a handle can be", "write held or released");
  }
  step.value = line.words[1] == "held" ? 1 : 0;
}

void read_ultrasonic(const Line& line, ScriptStep& step) {
  step.channel = channel_of(line, ultrasonic_channels, "ultrasonic sensor");
  if (line.words[2] == "off") {
    step.value = ScriptStep::off;
    return;
  }
  std::uint32_t cm = 0;
  if (!parse_number(Text(line.words[2]), cm) || cm > proximity_max_cm) {
    fail(line, line.words[2], "is not a distance", "write 0 (nothing) to 400 cm, or off");
  }
  step.value = static_cast<std::int32_t>(cm);
}

void read_encoder(const Line& line, ScriptStep& step) {
  step.channel = channel_of(line, encoder_channels, "encoder");
  if (!parse_number(Text(line.words[2]), step.value)) {
    fail(line, line.words[2], "is not a count", "write a whole number of 32 bits");
  }
}

void read_analog(const Line& line, ScriptStep& step) {
  const StateField field = state_field(Text(line.words[1]));
  if (field == StateField::count || row_of(field).kind != FieldKind::analog) {
    fail(line, line.words[1], "is not an analog input",
         "write AIN24, AIN12, AIN5, AINDMH, AINSTEER or AIN6");
  }
  step.channel = row_of(field).channel - 1;
  if (!parse_hundredths(Text(line.words[2]), step.value)) {
    fail(line, line.words[2], "is not a voltage", "write volts such as 21.5");
  }
}

void read_divider(const Line& line, ScriptStep& step) {
  constexpr std::int32_t most = 1000;  // ten times
  read_analog(line, step);
  if (step.value > most) {
    fail(line, line.words[2], "is not a factor", "write 0 to 10, such as 0.5");
  }
}

std::string name_of_defect(int index) {
  static constexpr std::string_view single[] = {"handle", "bypass", "servos", "store"};
  const auto numbered = [index](std::string_view word, int first) {
    return std::string(word) + std::to_string(index - first + 1);
  };
  if (index < defects::encoder_b) return numbered("enc", defects::encoder_a) + "a";
  if (index < defects::echo) return numbered("enc", defects::encoder_b) + "b";
  if (index < defects::relay) return numbered("echo", defects::echo);
  if (index < defects::handle) return numbered("relay", defects::relay);
  return std::string(single[index - defects::handle]);
}

void read_defect(const Line& line, ScriptStep& step) {
  while (step.channel < defects::count && name_of_defect(step.channel) != line.words[1]) {
    ++step.channel;
  }
  if (step.channel == defects::count) {
    fail(line, line.words[1], "is not a defect",
         "write enc1a … enc4b, echo1 …, relay1 …, handle, bypass, servos or store");
  }
  if (line.words[2] != "on" && line.words[2] != "off") {
    fail(line, line.words[2], "is not on or off", "write on or off");
  }
  step.value = line.words[2] == "on" ? 1 : 0;
}

void read_motor(const Line& line, ScriptStep& step) {
  step.channel = channel_of(line, osmc_channels, "motor");
  if (line.words[2] != "stalled" && line.words[2] != "free") {
    fail(line, line.words[2], "cannot happen to a motor", "write stalled or free");
  }
  step.value = line.words[2] == "stalled" ? 1 : 0;
}

std::int32_t supply_of(const Line& line, const char* what) {
  static constexpr std::string_view supplies[] = {"off", "on", "reset"};
  const auto* const supply = std::find(std::begin(supplies), std::end(supplies), line.words[2]);
  if (supply == std::end(supplies)) {
    fail(line, line.words[2], std::string("cannot happen to a ") + what, "write off, on or reset");
  }
  return static_cast<std::int32_t>(supply - std::begin(supplies));
}

void read_chip(const Line& line, ScriptStep& step) {
  static constexpr std::string_view chips[] = {"osmc", "dhb", "servo", "expander", "dac"};
  static_assert(std::size(chips) == chip_count);
  const auto* const chip = std::find(std::begin(chips), std::end(chips), line.words[1]);
  if (chip == std::end(chips)) {
    fail(line, line.words[1], "is not a chip", "write osmc, dhb, servo, expander or dac");
  }
  step.channel = static_cast<int>(chip - std::begin(chips));
  step.value = supply_of(line, "chip");
}

void read_i2c(const Line& line, ScriptStep& step) {
  if (line.words[1] != "held" && line.words[1] != "free") {
    fail(line, line.words[1], "is nothing a bus can be", "write held or free");
  }
  step.value = line.words[1] == "held" ? 1 : 0;
}

void read_user_bus(const Line& line, ScriptStep& step) {
  static constexpr std::string_view faults[] = {"free", "held", "cut", "stretched"};
  const auto* const fault = std::find(std::begin(faults), std::end(faults), line.words[1]);
  if (fault == std::end(faults)) {
    fail(line, line.words[1], "is nothing a bus can be", "write held, cut, stretched or free");
  }
  step.value = static_cast<std::int32_t>(fault - std::begin(faults));
}

void read_device(const Line& line, ScriptStep& step) {
  static constexpr std::string_view devices[user_device_count + optional_device_count] = {
      "mpu6050", "ina219", "icm20948", "bno055", "vl53l0x", "as5600"};
  const auto* const device = std::find(std::begin(devices), std::end(devices), line.words[1]);
  if (device == std::end(devices)) {
    fail(line, line.words[1], "is not a device on the user's bus",
         "write mpu6050, ina219, icm20948, bno055, vl53l0x or as5600");
  }
  step.channel = static_cast<int>(device - std::begin(devices));
  step.value = supply_of(line, "device");
}

void read_uart(const Line& line, ScriptStep& step) {
  static constexpr std::string_view peers[uart_peer_count] = {"off", "loop", "gnss", "lidar",
                                                              "noise"};
  step.channel = channel_of(line, uart_channels, "UART of the user's");
  const auto* const peer = std::find(std::begin(peers), std::end(peers), line.words[2]);
  if (peer == std::end(peers)) {
    fail(line, line.words[2], "is not a device at a UART", "write gnss, lidar, loop, noise or off");
  }
  step.value = static_cast<std::int32_t>(peer - std::begin(peers));
}

void read_gpio(const Line& line, ScriptStep& step) {
  step.channel = channel_of(line, gpio_channels, "spare input");
  if (line.words[2] != "low" && line.words[2] != "high") {
    fail(line, line.words[2], "is nothing an input can be", "write low or high");
  }
  step.value = line.words[2] == "high" ? 1 : 0;
}

void read_hang(const Line& line, ScriptStep& step) {
  step.value = static_cast<std::int32_t>(
      milliseconds_of(line, line.words[1], "write for how long, in seconds such as 0.3"));
}

struct Form {
  std::string_view word;
  std::size_t words;
  const char* usage;
  ScriptStep::Kind kind;
  void (*read)(const Line&, ScriptStep&);
};
constexpr Form forms[] = {
    {"handle", 2, "handle held|released", ScriptStep::Kind::handle, read_handle},
    {"us", 3, "us SENSOR CM|off", ScriptStep::Kind::ultrasonic, read_ultrasonic},
    {"enc", 3, "enc ENCODER COUNTS", ScriptStep::Kind::encoder, read_encoder},
    {"analog", 3, "analog NAME VOLTS", ScriptStep::Kind::analog, read_analog},
    {"divider", 3, "divider NAME FACTOR", ScriptStep::Kind::divider, read_divider},
    {"defect", 3, "defect NAME on|off", ScriptStep::Kind::defect, read_defect},
    {"motor", 3, "motor MOTOR stalled|free", ScriptStep::Kind::motor, read_motor},
    {"chip", 3, "chip NAME off|on|reset", ScriptStep::Kind::chip, read_chip},
    {"i2c", 2, "i2c held|free", ScriptStep::Kind::i2c, read_i2c},
    {"userbus", 2, "userbus held|cut|stretched|free", ScriptStep::Kind::user_bus, read_user_bus},
    {"device", 3, "device NAME off|on|reset", ScriptStep::Kind::device, read_device},
    {"uart", 3, "uart UART gnss|lidar|loop|noise|off", ScriptStep::Kind::uart, read_uart},
    {"gpio", 3, "gpio INPUT low|high", ScriptStep::Kind::gpio, read_gpio},
    {"hang", 2, "hang SECONDS", ScriptStep::Kind::hang, read_hang},
    {"fault", 1, "fault", ScriptStep::Kind::fault, nullptr},
    {"watchdog", 1, "watchdog", ScriptStep::Kind::watchdog, nullptr},
    {"reboot", 1, "reboot", ScriptStep::Kind::reboot, nullptr},
};

std::string words_of_forms() {
  std::string words;
  for (const Form& form : forms) {
    const bool last = &form == std::end(forms) - 1;
    words += (&form == std::begin(forms) ? "" : last ? " or " : ", ") + std::string(form.word);
  }
  return words;
}

std::string text_of(const Line& line) {
  std::string text;
  for (const std::string_view word : line.words) text.append(text.empty() ? "" : " ").append(word);
  return text;
}

ScriptStep step_of(const Line& line) {
  ScriptStep step;
  const auto* const form = std::find_if(std::begin(forms), std::end(forms),
                                        [&](const Form& f) { return f.word == line.words[0]; });
  if (form == std::end(forms)) {
    fail(line, line.words[0], "is nothing that can happen", "use " + words_of_forms());
  }
  if (line.words.size() != form->words) {
    fail(line, line.words[0], "has too few or too many words",
         std::string("write ") + (line.timed ? "TIME " : "") + form->usage);
  }
  step.kind = form->kind;
  step.text = text_of(line);
  if (form->read != nullptr) form->read(line, step);
  return step;
}

ScriptStep timed_step_of(Line line) {
  const std::string_view time = line.words[0];
  const std::uint32_t at_ms =
      milliseconds_of(line, time, "begin the line with seconds such as 1 or 0.125");
  line.words.erase(line.words.begin());
  if (line.words.empty()) {
    fail(line, time, "has nothing to do at that time", "follow the time with " + words_of_forms());
  }
  ScriptStep step = step_of(line);
  step.at_ms = at_ms;
  return step;
}

}  // namespace

std::optional<ScriptStep> Script::parse_now(std::string_view text, const std::string& name) {
  const Line line{name, words_of(text), false};
  if (line.words.empty()) return std::nullopt;
  return step_of(line);
}

Script Script::parse(std::string_view text, const std::string& name) {
  Script script;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    Line line{name + ":" + std::to_string(number), words_of(text.substr(0, end)), true};
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!line.words.empty()) script.steps_.push_back(timed_step_of(std::move(line)));
  }
  std::stable_sort(script.steps_.begin(), script.steps_.end(),
                   [](const ScriptStep& a, const ScriptStep& b) { return a.at_ms < b.at_ms; });
  return script;
}

Script Script::load(const std::string& path) {
  constexpr std::size_t max_size = 1'000'000;
  std::ifstream file(path, std::ios::binary);
  const bool opened = file.is_open();
  std::string text;
  char chunk[4096];
  while (file.read(chunk, sizeof chunk) || file.gcount() != 0) {
    text.append(chunk, static_cast<std::size_t>(file.gcount()));
    if (text.size() > max_size) {
      throw Error(ErrorKind::data, path, "the scenario is longer than 1 MB",
                  "give a file of lines such as: 0.5 handle released");
    }
  }
  if (!opened || file.bad()) {
    throw Error(ErrorKind::usage, path,
                std::string("the scenario cannot be read: ") + std::strerror(errno),
                "give the path of a readable scenario file");
  }
  return parse(text, path);
}

}  // namespace r4::sim
