// SPDX-License-Identifier: GPL-3.0-or-later
#include "sim_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <string_view>
#include <tuple>

#include "r4link/commands/command_text.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/state.hpp"
#include "r4link/tables/state_fields.hpp"
#include "r4link/vocabulary.hpp"

namespace r4::tool {
namespace {

constexpr std::size_t room = std::size_t{1} << 20;  // bytes that wait for a reader

bool drives(const sim::Pins& pins) {
  const auto has_duty = [](const Drive& drive) { return drive.pwm != 0; };
  const auto has_speed = [](const Bldc& bldc) { return bldc.speed != 0; };
  const auto steps = [](const sim::Pins::Stepper& stepper) { return stepper.stepping != 0; };
  return std::any_of(std::begin(pins.osmc), std::end(pins.osmc), has_duty) ||
         std::any_of(std::begin(pins.dhb12), std::end(pins.dhb12), has_duty) ||
         std::any_of(std::begin(pins.bldc), std::end(pins.bldc), has_speed) ||
         std::any_of(std::begin(pins.stepper), std::end(pins.stepper), steps);
}

int number_of(Direction direction) { return static_cast<int>(direction); }

std::string missing_lines(bool json, std::uint64_t count) {
  if (json) return line_of({{"type", "lost"}, {"lines", count}});
  return fmt::format("({} lines are missing: the reader of this output was too slow)\n", count);
}

}  // namespace

SimOutput::SimOutput(bool json)
    : json_(json),
      writer_(room, [json](std::uint64_t count) { return missing_lines(json, count); }) {}

Json pins_json(const sim::Pins& pins) {
  Json json{{"osmc", Json::array()}, {"dhb", Json::array()},  {"servo", pins.servo_us},
            {"relays", pins.relays}, {"bldc", Json::array()}, {"stepper", Json::array()}};
  for (const Drive& drive : pins.osmc) {
    json["osmc"].push_back({drive.pwm, number_of(drive.direction)});
  }
  for (const Drive& drive : pins.dhb12) {
    json["dhb"].push_back({drive.pwm, number_of(drive.direction)});
  }
  for (const Bldc& bldc : pins.bldc) {
    json["bldc"].push_back({bldc.speed, number_of(bldc.direction), bldc.brake ? 1 : 0});
  }
  for (const sim::Pins::Stepper& stepper : pins.stepper) {
    json["stepper"].push_back({stepper.position, stepper.stepping});
  }
  return json;
}

std::string pins_text(const sim::Pins& pins) {
  static constexpr const char* dhb12_names[dhb12_channels] = {"DHB1A", "DHB1B", "DHB2A", "DHB2B"};
  std::string text;
  const auto add = [&text](const std::string& output) {
    text += text.empty() ? output : ' ' + output;
  };
  const auto add_drive = [&add](const std::string& name, const Drive& drive) {
    if (drive == Drive()) return;
    add(fmt::format("{}:{},{}", name, drive.pwm, number_of(drive.direction)));
  };
  for (int i = 0; i < osmc_channels; ++i) add_drive(fmt::format("OSMC{}", i + 1), pins.osmc[i]);
  for (int i = 0; i < dhb12_channels; ++i) add_drive(dhb12_names[i], pins.dhb12[i]);
  for (int i = 0; i < servo_channels; ++i) {
    if (pins.servo_us[i] != 0) add(fmt::format("SERVO{}:{}", i + 1, pins.servo_us[i]));
  }
  for (int i = 0; i < bldc_channels; ++i) {
    const Bldc& bldc = pins.bldc[i];
    if (bldc == Bldc{0, Direction::reverse, true}) continue;
    add(fmt::format("BLDC{}:{},{},{}", i + 1, bldc.speed, number_of(bldc.direction),
                    bldc.brake ? 1 : 0));
  }
  for (int i = 0; i < stepper_channels; ++i) {
    const sim::Pins::Stepper& stepper = pins.stepper[i];
    if (stepper.stepping == 0) continue;
    add(fmt::format("STEP{}:{} and {}", i + 1, stepper.position,
                    stepper.stepping > 0 ? "rising" : "falling"));
  }
  for (int i = 0; i < relay_channels; ++i) {
    if ((pins.relays >> i & 1) != 0) add(fmt::format("RELAY{}:On", i + 1));
  }
  return text.empty() ? "all off" : text;
}

Json sensors_json(const sim::BoardModel& model) {
  Json json{{"supply", model.motors_have_supply()},
            {"handle", model.handle_held() ? "held" : "released"},
            {"enc", Json::array()},
            {"stepper", Json::array()},
            {"us", Json::array()},
            {"analog", Json::object()}};
  for (int i = 1; i <= encoder_channels; ++i) json["enc"].push_back(model.shaft_count(i));
  for (int i = 1; i <= stepper_channels; ++i) json["stepper"].push_back(model.stepper_shaft(i));
  for (int i = 1; i <= ultrasonic_channels; ++i) {
    const sim::UltrasonicModel& sensor = model.ultrasonic(i);
    json["us"].push_back(sensor.connected() ? Json(sensor.distance()) : Json("off"));
  }
  for (int i = 0; i < analog_channels; ++i) {
    const Text name = name_of(state_field(FieldKind::analog, i + 1));
    json["analog"][std::string(name.data(), name.size())] =
        model.analog_cv(static_cast<Analog>(i)) / 100.0;
  }
  return json;
}

sim::SimulatedBoard::Events SimLog::events() {
  sim::SimulatedBoard::Events events;
  if (quiet_) return events;
  events.on_state = [this](auto... a) { on_state(a...); };
  events.on_pins = [this](std::uint32_t t_ms, const sim::Pins& pins) { on_pins(t_ms, pins); };
  events.on_step = [this](std::uint32_t t_ms, const sim::ScriptStep& s) { on_step(t_ms, s); };
  events.on_fault = [this](std::uint32_t t_ms, ChipFault fault) { on_fault(t_ms, fault); };
  events.on_executed = [this](auto... a) { on_executed(a...); };
  events.on_refused = [this](auto... a) { on_refused(a...); };
  events.on_rejected = [this](std::uint32_t t_ms, Verdict verdict) { on_rejected(t_ms, verdict); };
  events.on_path = [this](std::uint32_t t_ms, const Carrier& c, bool joined) {
    on_path(t_ms, c, joined);
  };
  events.on_carrier = [this](std::uint32_t t_ms, const Carrier& carrier, const CarrierEvent& e) {
    on_carrier(t_ms, carrier, e);
  };
  return events;
}

void SimOutput::listening(const std::vector<std::string>& urls) {
  started_ = true;
  for (const std::string& url : urls) {
    if (json_) {
      print(line_of({{"type", "listening"}, {"url", url}, {"host_url", host_url(url)}}));
    } else {
      print(fmt::format("listening at {}; a host opens {}\n", url, host_url(url)));
    }
  }
  for (std::string& line : held_) print(std::move(line));
  held_.clear();
}

std::string host_url(const std::string& board_url) {
  const Url url = Url::parse(board_url);
  if (url.scheme() == "pty") return "serial://" + url.path();
  if (url.scheme() == "can") return board_url;
  const bool any = url.host() == "0.0.0.0" || url.host() == "::";
  // count(), because GCC 12 has a false warning for find() here.
  const bool v6 = std::count(url.host().begin(), url.host().end(), ':') != 0;
  const std::string host = any ? (v6 ? "::1" : "127.0.0.1") : url.host();
  return fmt::format("{}://{}:{}", url.scheme(), v6 ? "[" + host + "]" : host,
                     url.port().value_or(0));
}

void SimLog::print(std::uint32_t t_ms, std::string_view text) {
  output_.print(fmt::format("{:>10} ms  {}{}{}\n", t_ms, name_, name_.empty() ? "" : ": ", text));
}

void SimOutput::print(std::string line) {
  if (started_) {
    writer_.write(line);
  } else {
    held_.push_back(std::move(line));
  }
}

void SimOutput::problem(const Problem& problem) {
  print(json_ ? line_of(problem_json(problem)) : problem.text() + "\n");
}

Json SimLog::event(std::uint32_t t_ms) const {
  Json object{{"type", "event"}};
  if (!name_.empty()) object["board"] = name_;
  object["t"] = t_ms;
  object["state"] = to_text(board_->application().state());
  object["reason"] = to_text(board_->application().reason());
  return object;
}

void SimLog::tell_sensors() {
  Json object{{"type", "sensors"}};
  if (!name_.empty()) object["board"] = name_;
  object["t"] = board_->now_ms();
  object.update(sensors_json(board_->model()));
  print(object);
}

void SimLog::on_end(const Carrier& carrier) {
  if (quiet_) return;
  const CarrierCounters& counters = carrier.counters();
  if (output_.json()) {
    Json object{{"type", "counters"}};
    if (!name_.empty()) object["board"] = name_;
    object["transport"] = carrier.name();
    object.update(counters_json(counters));
    return print(object);
  }
  output_.print(fmt::format("{}{}{}: {} datagrams received, {} sent, {} dropped\n", name_,
                            name_.empty() ? "" : ": ", carrier.name(), counters.rx_datagrams,
                            counters.tx_datagrams, counters.tx_dropped));
}

void SimLog::on_impairment(const ImpairedCarrier& link) {
  if (quiet_) return;
  const auto json = [](const ImpairmentCounters& counters) {
    return Json{{"passed", counters.passed},
                {"lost", counters.lost},
                {"duplicated", counters.duplicated},
                {"corrupted", counters.corrupted},
                {"cut", counters.cut},
                {"overflow", counters.overflow}};
  };
  if (output_.json()) {
    Json object{{"type", "impairment"}};
    if (!name_.empty()) object["board"] = name_;
    object["transport"] = link.name();
    object["received"] = json(link.received());
    object["sent"] = json(link.sent());
    return print(object);
  }
  for (const auto& [way, counters] : {std::pair("in", link.received()), {"out", link.sent()}}) {
    output_.print(fmt::format("{}: {} passed {}, {} lost, {} duplicated, {} damaged, {} cut\n",
                              link.name(), counters.passed, way, counters.lost, counters.duplicated,
                              counters.corrupted, counters.cut));
  }
}

void SimLog::on_state(std::uint32_t t_ms, firmware::BoardState state, SafeReason reason) {
  const bool silent = state == firmware::BoardState::safe && reason == SafeReason::link;
  const std::uint32_t silence_ms = silent ? t_ms - board_->application().link().fed_ms() : 0;
  if (output_.json()) {
    Json object = event(t_ms);
    if (silent) object["silence"] = silence_ms;
    print(object);
    return;
  }
  std::string text = to_text(state);
  const bool shown = reason != SafeReason::none && (reason != SafeReason::link || silent);
  if (shown) text += fmt::format(" ({})", to_text(reason));
  if (silent) text += fmt::format(", the last heartbeat of the host was {} ms ago", silence_ms);
  print(t_ms, text);
}

void SimLog::on_pins(std::uint32_t t_ms, const sim::Pins& pins) {
  const bool supply = board_->model().motors_have_supply();
  if (!output_.json()) {
    const char* const idle =
        supply || !drives(pins) ? "" : " (the motors have no supply: relay 1 is open)";
    return print(t_ms, "outputs: " + pins_text(pins) + idle);
  }
  Json object = event(t_ms);
  object["outputs"] = pins_json(pins);
  object["supply"] = supply;
  print(object);
}

void SimLog::on_step(std::uint32_t t_ms, const sim::ScriptStep& step) {
  if (!output_.json()) return print(t_ms, "happens: " + step.text);
  Json object = event(t_ms);
  object["happened"] = step.text;
  print(object);
}

void SimLog::on_fault(std::uint32_t t_ms, ChipFault fault) {
  const std::string chip = chip_name(fault.address);
  const std::string trouble = to_text(fault.trouble);
  if (!output_.json()) return print(t_ms, fmt::format("{}: {}", chip, trouble));
  Json object = event(t_ms);
  object["fault"] = {{"chip", chip}, {"trouble", trouble}};
  print(object);
}

void SimLog::on_executed(std::uint32_t t_ms, std::uint32_t pnum, const Command& command) {
  const std::string text = shown(command);
  if (!output_.json()) return print(t_ms, fmt::format("executed {} (PNum {})", text, pnum));
  Json object = event(t_ms);
  object["executed"] = {{"pnum", pnum}, {"command", text}};
  print(object);
}

void SimLog::on_refused(std::uint32_t t_ms, std::uint32_t pnum, Refusal code) {
  const Text name = name_of(code);
  const std::string_view code_text(name.data(), name.size());
  if (!output_.json()) {
    return print(t_ms, fmt::format("refused PNum {}: {}, {}", pnum, code_text, meaning_of(code)));
  }
  Json object = event(t_ms);
  object["refused"] = {{"pnum", pnum}, {"code", code_text}};
  print(object);
}

void SimLog::on_rejected(std::uint32_t t_ms, Verdict verdict) {
  const char* const why = to_text(verdict);
  if (!output_.json()) return print(t_ms, fmt::format("dropped: signature {}", why));
  Json object = event(t_ms);
  object["rejected"] = why;
  print(object);
}

void SimLog::on_path(std::uint32_t t_ms, const Carrier& carrier, bool joined) {
  const SessionPaths& paths = board_->application().paths();
  const char* const what = joined ? "joined" : "left";
  if (!output_.json()) {
    return print(
        t_ms, fmt::format("{} {} the session: {} paths, {} joined, {} lost so far", carrier.name(),
                          what, paths.size(), paths.joins(), paths.losses()));
  }
  Json object = event(t_ms);
  object["path"] = {{"url", carrier.name()},
                    {"event", what},
                    {"paths", paths.size()},
                    {"joins", paths.joins()},
                    {"losses", paths.losses()}};
  print(object);
}

void SimLog::on_carrier(std::uint32_t t_ms, const Carrier& carrier,
                        const CarrierEvent& carrier_event) {
  const std::string_view kind = to_text(carrier_event.kind);
  const auto& [reason, fix] = std::tie(carrier_event.problem.reason, carrier_event.problem.fix);
  if (!output_.json()) {
    return print(
        t_ms, fmt::format("{} {}{}{}{}{}", carrier.name(), kind, reason.empty() ? "" : ": ", reason,
                          fix.empty() ? "" : "; ", fix));
  }
  Json object = event(t_ms);
  object["transport"] = {
      {"url", carrier.name()}, {"event", kind}, {"reason", reason}, {"fix", fix}};
  print(object);
}

}  // namespace r4::tool
