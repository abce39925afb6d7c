// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

#include "../text_file.hpp"
#include "json_value.hpp"
#include "r4link/commissioning/report.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "things.hpp"

namespace r4::commissioning {
namespace {

constexpr std::string_view learnt_words[] = {"serves", "option", "place", "full scale"};

std::string quoted(std::string_view text) {
  std::string out = "\"";
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    for (const char c : printable(text.substr(0, end))) {
      if (c == '"' || c == '\\') out += '\\';
      out += c;
    }
    if (end < text.size()) out += "\\n";
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out + '"';
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.6g}", value) : "null";
}

template <class Elements, class Write>
std::string list(const Elements& elements, Write write) {
  std::string out = "[";
  for (const auto& each : elements) out += (out.size() == 1 ? "\n" : ",\n") + write(each);
  return out + "]";
}

std::string json_of(const Measured& each) {
  return fmt::format(R"(  {{"what": {}, "value": {}, "unit": {}}})", quoted(each.what),
                     number(each.value), quoted(each.unit));
}

std::string json_of(const Found& each) {
  const FindingText& text = text_of(each.finding);
  return fmt::format(R"(  {{"thing": {}, "finding": {}, "detail": {}, "wrong": {}, "fix": {}}})",
                     quoted(each.thing), quoted(text.name), quoted(each.detail), quoted(text.wrong),
                     quoted(text.fix));
}

std::string json_of(const Learnt& each) {
  std::string out = fmt::format(R"(  {{"what": {}, "signal": {})",
                                quoted(learnt_words[static_cast<std::size_t>(each.what)]),
                                quoted(signal_name(each.signal)));
  switch (each.what) {
    case Learnt::What::serves:
      out += fmt::format(R"(, "other": {})", quoted(signal_name(each.other)));
      break;
    case Learnt::What::place:
      out += fmt::format(R"(, "place": {})", quoted(place_name(each.signal, each.place)));
      break;
    case Learnt::What::full_scale:
      out += fmt::format(R"(, "factor": {})", number(each.factor));
      break;
    case Learnt::What::option:
      break;
  }
  return out + "}";
}

constexpr auto json_of_each = [](const auto& each) { return json_of(each); };

std::string json_of_check(const CheckResult& each) {
  return fmt::format(
      R"( {{"id": {}, "status": {}, "note": {}, "measured": {}, "found": {}, "learnt": {}}})",
      quoted(each.id), quoted(to_text(each.status)), quoted(each.note),
      list(each.measured, json_of_each), list(each.found, json_of_each),
      list(each.learnt, json_of_each));
}

[[noreturn]] void fail(const std::string& name, const std::string& reason) {
  throw Error(ErrorKind::data, name, reason, "give a file that r4 commission has written");
}

Learnt learnt_in(const JsonValue& json, const std::string& name) {
  const auto* const word =
      std::find(std::begin(learnt_words), std::end(learnt_words), json["what"].text());
  if (word == std::end(learnt_words)) fail(name, "it learnt something unknown");
  Learnt learnt;
  learnt.what = static_cast<Learnt::What>(word - std::begin(learnt_words));
  learnt.signal = signal_named(json["signal"].text());
  if (learnt.what == Learnt::What::serves) {
    learnt.other = signal_named(json["other"].text());
    const std::vector<Thing> things = alike(thing_of(learnt.signal).first);
    for (const int each : {learnt.signal, learnt.other}) {
      if (std::find(things.begin(), things.end(), thing_of(each)) == things.end()) {
        fail(name, "it exchanges things of different kinds");
      }
    }
  } else if (learnt.what == Learnt::What::place) {
    learnt.place = place_named(learnt.signal, json["place"].text());
  } else if (learnt.what == Learnt::What::full_scale) {
    learnt.factor = json["factor"].number();
    if (thing_of(learnt.signal).first != SignalKind::analog ||
        !(learnt.factor > 0 && learnt.factor <= 1000)) {
      fail(name, "a full scale is not possible");
    }
  }
  return learnt;
}

CheckResult check_in(const JsonValue& json, const std::string& name) {
  CheckResult check{json["id"].text()};
  bool known = false;
  for (int i = 0; i <= static_cast<int>(Status::unsupported); ++i) {
    if (json["status"].text() != to_text(static_cast<Status>(i))) continue;
    check.status = static_cast<Status>(i);
    known = true;
  }
  if (check.id.empty() || !known) fail(name, "a check has no id or no status");
  check.note = json["note"].text();
  for (const JsonValue& each : json["measured"].elements()) {
    check.measured.push_back({each["what"].text(), each["value"].number(), each["unit"].text()});
  }
  for (const JsonValue& each : json["found"].elements()) {
    const Finding finding = finding_named(each["finding"].text());
    if (finding == Finding::count) fail(name, "a finding is unknown");
    check.found.push_back({finding, each["thing"].text(), each["detail"].text()});
  }
  for (const JsonValue& each : json["learnt"].elements()) {
    check.learnt.push_back(learnt_in(each, name));
  }
  return check;
}

}  // namespace

std::string write_json(const Report& report) {
  return fmt::format(
      R"({{"r4_commissioning": 1,
 "begun": {},
 "software": {},
 "url": {},
 "board": {{"id": {}, "name": {}, "firmware": {}, "capabilities": {}}},
 "wiring_source": {},
 "wiring": {},
 "learnt_wiring": {},
 "checks": {}
}}
)",
      quoted(report.begun), quoted(report.software), quoted(report.url), quoted(report.board_id),
      quoted(report.board_name), quoted(report.firmware), quoted(report.capabilities),
      quoted(report.wiring_source), quoted(write_wiring(report.wiring)),
      quoted(write_wiring(learnt_wiring(report))), list(report.checks, json_of_check));
}

Report read_report(std::string_view json, const std::string& name) {
  if (json.size() > max_report_text) fail(name, "it is longer than 1 MB");
  const JsonValue all = JsonValue::read(json, name);
  if (all["r4_commissioning"].number() != 1) fail(name, "it is not a report of a commissioning");
  Report report;
  report.begun = all["begun"].text();
  report.software = all["software"].text();
  report.url = all["url"].text();
  report.board_id = all["board"]["id"].text();
  report.board_name = all["board"]["name"].text();
  report.firmware = all["board"]["firmware"].text();
  report.capabilities = all["board"]["capabilities"].text();
  report.wiring_source = all["wiring_source"].text();
  report.wiring = read_wiring(all["wiring"].text(), name + ": wiring");
  for (const JsonValue& each : all["checks"].elements()) {
    report.checks.push_back(check_in(each, name));
  }
  return report;
}

Report load_report(const std::string& path) {
  return read_report(
      read_text_file(path, max_report_text, "give a report of r4 commission, NAME.json"), path);
}

}  // namespace r4::commissioning
