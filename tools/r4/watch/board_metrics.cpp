// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_metrics.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "r4link/error.hpp"
#include "r4link/link.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::tool {
namespace {

MetricLabels with(MetricLabels labels, const char* name, std::string value) {
  labels.emplace_back(name, std::move(value));
  return labels;
}

// A Prometheus counter must not decrease, but `lost` does when a datagram arrives late.
std::uint64_t lost_in_turn(const PacketCounters& packets) {
  return std::uint64_t{packets.lost} + packets.late;
}

void describe_paths(const SetBoard& each, const MetricLabels& one, MetricFamilies& out) {
  const std::vector<std::string> urls = split_paths(each.url);
  const std::vector<PathStatus> paths = each.board.paths();
  if (paths.size() < 2) return;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const PathStatus& path = paths[i];
    const MetricLabels labels = with(one, "path", urls[i]);
    out.gauge("r4_path_carrying", "1 if this path to the board carries datagrams, else 0.", labels,
              path.state == PathState::carrying ? 1 : 0);
    out.count("r4_path_received_total", "Datagrams of the board on this path.", labels,
              path.packets.received);
    out.count("r4_path_lost_total", "Datagrams of the board that this path did not bring in order.",
              labels, lost_in_turn(path.packets));
    out.count("r4_path_late_total", "Missing datagrams that this path brought later.", labels,
              path.packets.late);
    out.count("r4_path_copies_total", "Datagrams that another path brought before this path.",
              labels, path.copies);
    if (path.round_trip_us > 0) {
      out.gauge("r4_path_round_trip_seconds",
                "Time from the newest question on this path to its answer.", labels,
                path.round_trip_us / 1e6);
    }
    if (path.age_us > 0) {
      out.gauge("r4_path_age_seconds", "Time since the newest datagram on this path.", labels,
                path.age_us / 1e6);
    }
  }
}

// A label's value may come from a board: make it printable, escape backslashes and quotes.
std::string label_text(const std::string& value) {
  std::string text;
  for (const char c : printable(value)) {
    if (c == '\\' || c == '"') text += '\\';
    text += c;
  }
  return text;
}

}  // namespace

void MetricFamilies::add(const char* name, const char* help, const char* type,
                         const MetricLabels& labels, double value) {
  std::string& text = families_[name];
  if (text.empty()) text = fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", name, help, type);
  text += name;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    text += fmt::format("{}{}=\"{}\"", i == 0 ? '{' : ',', labels[i].first,
                        label_text(labels[i].second));
  }
  text += fmt::format("{} {}\n", labels.empty() ? "" : "}", value);
}

std::string MetricFamilies::text() const {
  std::string all;
  for (const auto& [name, text] : families_) all += text;
  return all;
}

void describe(const SetBoard& each, MetricFamilies& out) {
  const AsyncBoard& board = each.board;
  const BoardIdentity& who = board.identity();
  const LinkStatus& link = board.link();
  const Statistics statistics = board.statistics();
  const ReceivedState& state = board.state();
  const CarrierCounters& carrier = board.carrier_counters();
  const bool up = link.state == HostLinkState::active || link.state == HostLinkState::safe;
  const MetricLabels one{{"url", each.url}};

  out.gauge("r4_up", "1 if datagrams of the board arrive, else 0.", one, up ? 1 : 0);
  if (!who.board_id.empty()) {
    MetricLabels info = with(with(one, "board", who.name), "hardware_id", who.board_id);
    out.gauge("r4_info", "The board's identity; always 1.",
              with(std::move(info), "firmware", who.firmware), 1);
  }
  for (int i = 0; up && i < safe_reason_count; ++i) {
    const auto reason = static_cast<SafeReason>(i);
    out.gauge("r4_safe", "Why the outputs are off: 1 for the present reason, which may be none.",
              with(one, "reason", to_text(reason)), link.reason == reason ? 1 : 0);
  }
  out.count("r4_received_total", "Datagrams of the board.", one, statistics.received);
  out.count("r4_states_total", "States of the board.", one, statistics.states);
  out.count("r4_damaged_total", "Received data that were not a valid datagram.", one,
            statistics.damaged);
  out.count("r4_lost_total", "Datagrams of the board that did not arrive in order.", one,
            lost_in_turn(statistics.packets));
  out.count("r4_duplicates_total", "Duplicate datagrams.", one, statistics.packets.duplicate);
  out.count("r4_late_total", "Missing datagrams that arrived later.", one, statistics.packets.late);
  out.count("r4_restarts_total", "Restarts of the board.", one, statistics.packets.restarts);
  out.count("r4_transport_bytes_total", "Bytes of datagrams.", with(one, "direction", "received"),
            carrier.rx_bytes);
  out.count("r4_transport_bytes_total", "", with(one, "direction", "sent"), carrier.tx_bytes);
  out.count("r4_transport_downs_total", "Disconnections of the transport.", one, carrier.downs);
  describe_paths(each, one, out);
  if (!up) return;
  out.gauge("r4_state_rate_hertz", "States in the last second.", one, statistics.state_rate_hz);
  if (statistics.round_trip_us > 0) {
    out.gauge("r4_round_trip_seconds", "Time from the newest question to its answer.", one,
              statistics.round_trip_us / 1e6);
  }
  if (!state.any()) return;
  out.gauge("r4_state_age_seconds", "Time since the newest state.", one,
            statistics.state_age_us / 1e6);
  out.gauge("r4_jitter_seconds", "Interarrival jitter of the states (RFC 3550).", one,
            statistics.jitter_us / 1e6);
  if (state.sampled_error != ReceivedState::unknown) {
    out.gauge("r4_clock_error_seconds", "Uncertainty of the time of a sample.", one,
              std::chrono::duration<double>(state.sampled_error).count());
  }
  for (const StateField field : state.present) {
    if (row_of(field).kind != FieldKind::analog) continue;
    const Text name = name_of(field);
    out.gauge("r4_analog_volts", kind_row_of(field).help,
              with(one, "input", std::string(name.data(), name.size())),
              numbers_of(state, field)[0]);
  }
}

}  // namespace r4::tool
