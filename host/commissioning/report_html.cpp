// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "r4link/commissioning/commissioning.hpp"
#include "r4link/error.hpp"
#include "r4link/wiring/wiring_file.hpp"

namespace r4::commissioning {
namespace {

// Makes foreign text printable, and escapes it for HTML.
std::string shown(std::string_view text) {
  std::string out;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

constexpr std::string_view head = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Commissioning of an R4 board</title>
<style>
body { font: 15px/1.45 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; width: 100%; margin: 1em 0; }
th, td { border-bottom: 1px solid #ccc; padding: .3em .6em; text-align: left; vertical-align: top; }
.found { color: #a00; font-weight: bold; } .passed { color: #070; }
.skipped, .not-done, .unsupported { color: #777; }
</style></head><body>
<h1>Commissioning of an R4 board</h1>
)";

void add_row(std::string& html, std::string_view name, std::string_view value) {
  html += fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", name, shown(value));
}

std::string counts_of(const Report& report) {
  int of[static_cast<int>(Status::unsupported) + 1] = {};
  for (const CheckResult& each : report.checks) ++of[static_cast<int>(each.status)];
  std::string text;
  for (int i = 0; i <= static_cast<int>(Status::unsupported); ++i) {
    if (of[i] == 0) continue;
    text +=
        fmt::format("{}{} {}", text.empty() ? "" : ", ", of[i], to_text(static_cast<Status>(i)));
  }
  const auto missing = std::count_if(checks().begin(), checks().end(), [&](const Check& check) {
    return std::none_of(report.checks.begin(), report.checks.end(),
                        [&](const CheckResult& each) { return each.id == check.id; });
  });
  if (missing != 0) text += fmt::format(", {} not reached", missing);
  return text;
}

void add_findings(std::string& html, const Report& report) {
  html += "<h2>Findings</h2>\n";
  const auto found = report.found();
  if (found.empty()) {
    html += "<p>The checks that were done found no faults.</p>\n";
    return;
  }
  html += "<table><tr><th>what</th><th>finding</th><th>what to do</th></tr>\n";
  for (const Found& each : found) {
    const FindingText& text = text_of(each.finding);
    html += fmt::format("<tr><td>{}</td><td class=\"found\">{}{}{}</td><td>{}</td></tr>\n",
                        shown(each.thing), shown(text.wrong), each.detail.empty() ? "" : "<br>",
                        shown(each.detail), shown(text.fix));
  }
  html += "</table>\n";
}

void add_checks(std::string& html, const Report& report) {
  html += "<h2>Checks</h2>\n<table><tr><th>check</th><th>result</th><th>measured</th></tr>\n";
  for (const CheckResult& each : report.checks) {
    std::string measured;
    for (const Measured& value : each.measured) {
      measured +=
          fmt::format("{}: {:.4g} {}<br>", shown(value.what), value.value, shown(value.unit));
    }
    std::string status = to_text(each.status);
    std::string style = status;
    std::replace(style.begin(), style.end(), ' ', '-');
    html += fmt::format("<tr><td>{}</td><td><span class=\"{}\">{}</span> {}</td><td>{}</td></tr>\n",
                        shown(each.id), style, status, shown(each.note), measured);
  }
  html += "</table>\n";
}

void add_wiring(std::string& html, const Report& report) {
  const Wiring learnt = learnt_wiring(report);
  const Wiring plan = plan_wiring();
  html +=
      "<h2>Wiring</h2>\n<table><tr><th>signal</th><th>plan</th><th>board</th><th>learnt</th></"
      "tr>\n";
  bool any = false;
  for (int i = 0; i < signal_count; ++i) {
    if (plan.places[i] == report.wiring.places[i] && plan.places[i] == learnt.places[i]) continue;
    any = true;
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                        shown(signal_name(i)), shown(place_name(i, plan.places[i])),
                        shown(place_name(i, report.wiring.places[i])),
                        shown(place_name(i, learnt.places[i])));
  }
  html += "</table>\n";
  if (!any) html += "<p>The same as the plan.</p>\n";
}

}  // namespace

std::string write_html(const Report& report) {
  std::string html(head);
  html += "<table>\n";
  add_row(html, "Begun", report.begun);
  add_row(html, "Board",
          report.board_id + (report.board_name.empty() ? "" : ", ") + report.board_name);
  add_row(html, "Firmware", report.firmware + ", " + report.capabilities);
  add_row(html, "Transport", report.url);
  add_row(html, "R4 link", report.software);
  add_row(html, "Wiring", report.wiring_source.empty() ? "unknown" : report.wiring_source);
  add_row(html, "Checks", counts_of(report));
  html += "</table>\n";
  add_findings(html, report);
  add_checks(html, report);
  add_wiring(html, report);
  html += "</body></html>\n";
  return html;
}

}  // namespace r4::commissioning
