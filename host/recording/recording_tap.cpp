// SPDX-License-Identifier: GPL-3.0-or-later
#include "recording_tap.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "r4link/recordings/record_line.hpp"

namespace r4 {

void RecordingTap::attach(std::shared_ptr<Recorder> recorder, const std::string& url) {
  recorder_ = std::move(recorder);
  path_ = recorder_->add_path(url);
  known_news_ = recorder_->news_count();
  state_ = HostLinkState::connecting;
  reason_ = SafeReason::none;
}

std::optional<Problem> RecordingTap::take_news() {
  if (!recorder_) return std::nullopt;
  const bool ended = recorder_->ended();  // read first, because no news follows the end
  std::optional<Problem> news = recorder_->news(known_news_);
  if (ended) recorder_.reset();
  return news;
}

// Records an event, because the kept beginning could look like a whole datagram.
void RecordingTap::on_oversize(std::string_view beginning) {
  if (recorder_) record(RecordKind::event, "oversize " + std::string(beginning));
}

void RecordingTap::on_carrier_event(const CarrierEvent& event) {
  if (!recorder_) return;
  const std::string words =
      event.kind == CarrierEvent::Kind::up ? event.problem.thing : event.problem.text();
  record(RecordKind::event, fmt::format("{} {}", to_text(event.kind), words));
}

void RecordingTap::on_link(const LinkStatus& link) {
  if (!recorder_ || (link.state == state_ && link.reason == reason_)) return;
  state_ = link.state;
  reason_ = link.reason;
  const bool safe = reason_ != SafeReason::none;
  record(RecordKind::event, fmt::format("link {}{}{}", to_text(state_), safe ? " " : "",
                                        safe ? to_text(reason_) : ""));
}

void RecordingTap::on_packets(const PacketCounters& packets) {
  if (packets.lost == lost_) return;
  if (recorder_ && packets.lost > lost_) {
    record(RecordKind::event, fmt::format("lost {}", packets.lost - lost_));
  }
  lost_ = packets.lost;  // decreases when a late datagram arrives
}

void RecordingTap::on_name(std::string_view name) {
  if (recorder_) recorder_->name_path(path_, std::string(name));
}

void RecordingTap::on_device(const Device& device) {
  if (!recorder_) return;
  const std::string& description = device.description().text;
  if (description.size() > max_record_bytes) {
    return record(
        RecordKind::event,
        fmt::format(
            "warning {}: its description has {} bytes and is left out; the limit is {} bytes",
            device.place(), description.size(), max_record_bytes));
  }
  recorder_->add_device({path_, device.place(), description});
}

}  // namespace r4
