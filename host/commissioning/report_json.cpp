// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "../text_file.hpp"
#include "r4link/commissioning/report.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"
#include "things.hpp"

namespace r4::commissioning {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view learnt_words[] = {"serves", "option", "place", "full scale"};

// Keeps the line feeds of foreign text, and makes each line printable().
std::string clean(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    out += printable(text.substr(0, end));
    if (end < text.size()) out += '\n';
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

// Six digits. JSON has no infinity and no NaN: they become null.
Json rounded(double value) {
  return std::isfinite(value) ? Json(std::stod(fmt::format("{:.6g}", value))) : Json();
}

template <class Elements, class Write>
Json list(const Elements& elements, Write write) {
  Json out = Json::array();
  for (const auto& each : elements) out.push_back(write(each));
  return out;
}

Json json_of(const Measured& each) {
  return {{"what", clean(each.what)}, {"value", rounded(each.value)}, {"unit", clean(each.unit)}};
}

Json json_of(const Found& each) {
  const FindingText& text = text_of(each.finding);
  return {{"thing", clean(each.thing)},
          {"finding", text.name},
          {"detail", clean(each.detail)},
          {"wrong", text.wrong},
          {"fix", text.fix}};
}

Json json_of(const Learnt& each) {
  Json out{{"what", learnt_words[static_cast<std::size_t>(each.what)]},
           {"signal", signal_name(each.signal)}};
  switch (each.what) {
    case Learnt::What::serves:
      out["other"] = signal_name(each.other);
      break;
    case Learnt::What::place:
      out["place"] = place_name(each.signal, each.place);
      break;
    case Learnt::What::full_scale:
      out["factor"] = rounded(each.factor);
      break;
    case Learnt::What::option:
      break;
  }
  return out;
}

constexpr auto json_of_each = [](const auto& each) { return json_of(each); };

Json json_of_check(const CheckResult& each) {
  return {{"id", clean(each.id)},
          {"status", to_text(each.status)},
          {"note", clean(each.note)},
          {"measured", list(each.measured, json_of_each)},
          {"found", list(each.found, json_of_each)},
          {"learnt", list(each.learnt, json_of_each)}};
}

double number(const Json& json) { return json.is_null() ? 0 : json.get<double>(); }

std::string text(const Json& json, const char* key) { return json.value(key, std::string()); }

[[noreturn]] void fail(const std::string& name, const std::string& reason) {
  throw Error(ErrorKind::data, name, reason, "give a file that r4 commission has written");
}

Learnt learnt_in(const Json& json, const std::string& name) {
  const auto* const word =
      std::find(std::begin(learnt_words), std::end(learnt_words), text(json, "what"));
  if (word == std::end(learnt_words)) fail(name, "a learnt value is unknown");
  Learnt learnt;
  learnt.what = static_cast<Learnt::What>(word - std::begin(learnt_words));
  learnt.signal = signal_named(text(json, "signal"));
  if (learnt.what == Learnt::What::serves) {
    learnt.other = signal_named(text(json, "other"));
    const std::vector<Thing> things = alike(thing_of(learnt.signal).first);
    for (const int each : {learnt.signal, learnt.other}) {
      if (std::find(things.begin(), things.end(), thing_of(each)) == things.end()) {
        fail(name, "an exchange names things of different kinds");
      }
    }
  } else if (learnt.what == Learnt::What::place) {
    learnt.place = place_named(learnt.signal, text(json, "place"));
  } else if (learnt.what == Learnt::What::full_scale) {
    learnt.factor = number(json.at("factor"));
    if (thing_of(learnt.signal).first != SignalKind::analog ||
        !(learnt.factor > 0 && learnt.factor <= 1000)) {
      fail(name, "a full scale is not valid");
    }
  }
  return learnt;
}

CheckResult check_in(const Json& json, const std::string& name) {
  CheckResult check{text(json, "id")};
  bool known = false;
  for (int i = 0; i <= static_cast<int>(Status::unsupported); ++i) {
    if (text(json, "status") != to_text(static_cast<Status>(i))) continue;
    check.status = static_cast<Status>(i);
    known = true;
  }
  if (check.id.empty() || !known) fail(name, "a check has no id or no status");
  check.note = text(json, "note");
  for (const Json& each : json.at("measured")) {
    check.measured.push_back({text(each, "what"), number(each.at("value")), text(each, "unit")});
  }
  for (const Json& each : json.at("found")) {
    const Finding finding = finding_named(text(each, "finding"));
    if (finding == Finding::count) fail(name, "a finding is unknown");
    check.found.push_back({finding, text(each, "thing"), text(each, "detail")});
  }
  for (const Json& each : json.at("learnt")) {
    check.learnt.push_back(learnt_in(each, name));
  }
  return check;
}

Report report_in(const Json& all, const std::string& name) {
  if (all.value("r4_commissioning", 0) != 1) fail(name, "this is not a commissioning report");
  const Json& board = all.at("board");
  Report report;
  report.begun = text(all, "begun");
  report.software = text(all, "software");
  report.url = text(all, "url");
  report.board_id = text(board, "id");
  report.board_name = text(board, "name");
  report.firmware = text(board, "firmware");
  report.capabilities = text(board, "capabilities");
  report.wiring_source = text(all, "wiring_source");
  report.wiring = read_wiring(text(all, "wiring"), name + ": wiring");
  for (const Json& each : all.at("checks")) report.checks.push_back(check_in(each, name));
  return report;
}

}  // namespace

std::string write_json(const Report& report) {
  const Json all{{"r4_commissioning", 1},
                 {"begun", clean(report.begun)},
                 {"software", clean(report.software)},
                 {"url", clean(report.url)},
                 {"board",
                  {{"id", clean(report.board_id)},
                   {"name", clean(report.board_name)},
                   {"firmware", clean(report.firmware)},
                   {"capabilities", clean(report.capabilities)}}},
                 {"wiring_source", clean(report.wiring_source)},
                 {"wiring", clean(write_wiring(report.wiring))},
                 {"learnt_wiring", clean(write_wiring(learnt_wiring(report)))},
                 {"checks", list(report.checks, json_of_check)}};
  return all.dump(1) + '\n';
}

Report read_report(std::string_view json, const std::string& name) {
  if (json.size() > max_report_text) fail(name, "the report is longer than 1 MB");
  try {
    return report_in(Json::parse(json), name);
  } catch (const Json::parse_error& error) {
    const auto line =
        1 + std::count(json.begin(), json.begin() + std::min(error.byte, json.size()), '\n');
    fail(fmt::format("{}:{}", name, line), "this is not JSON");
  } catch (const Json::exception&) {
    fail(name, "a value is missing or has another type");
  }
}

Report load_report(const std::string& path) {
  return read_report(
      read_text_file(path, max_report_text, "give a report of r4 commission, NAME.json"), path);
}

}  // namespace r4::commissioning
