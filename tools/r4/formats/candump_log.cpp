// SPDX-License-Identifier: GPL-3.0-or-later
#include "candump_log.hpp"

#include <fmt/format.h>

#include "../bus/candump.hpp"
#include "r4link/error.hpp"
#include "transports/framing/can/can_node.hpp"
#include "transports/url.hpp"

namespace r4::tool {
namespace {

// How much without a frame makes it no log.
constexpr std::uint64_t patience = 65536;

}  // namespace

void CandumpSource::feed(std::string_view bytes) {
  lines_.push(
      bytes, [this](std::uint64_t number, std::string_view text) { on_line(number, text); },
      [this](std::uint64_t number, std::uint64_t) {
        damage(number, "longer than any line of candump");
      });
  if (!recognised_ && lines_.begin() > patience) fail_as_none();
}

void CandumpSource::finish() {
  lines_.finish([this](std::uint64_t number, std::string_view text) { on_line(number, text); },
                [this](std::uint64_t number, std::uint64_t) {
                  damage(number, "longer than any line of candump");
                });
  if (!recognised_) fail_as_none();
  records_.finish();
}

void CandumpSource::on_line(std::uint64_t number, std::string_view text) {
  CandumpLine line;
  const CandumpError error = read_candump_line(text, line);
  if (error == CandumpError::detail) return;
  if (error != CandumpError::none) return damage(number, to_text(error));
  if (!line.time_us || line.date) {
    return damage(number, "it has no time since 1970: candump -L writes one");
  }
  recognised_ = true;
  if (line.error_frame) return;  // of the controller, not of the bus
  records_.on_frame(line.interface, line.frame, {number, lines_.begin(), line.time_us, {}});
}

void CandumpSource::damage(std::uint64_t number, const char* reason) {
  handler_.on_damage({RecordingDamage::Kind::line, number, lines_.begin(), reason});
}

void CandumpSource::fail_as_none() const {
  throw Error(ErrorKind::data, name_, "no log of CAN frames", "candump -L can0 > FILE makes one");
}

std::optional<CandumpSink::Place> CandumpSink::place_of(const RecordedWire& wire) {
  try {
    const Url url = Url::parse(wire.url);
    if (url.scheme() != "can" || url.host().empty()) return std::nullopt;
    return Place{url.host(), static_cast<std::uint8_t>(url.get_number("node", 0, 31, 1)),
                 url.get_number("fd", 0, 1, 0) == 1, url.get_number("pack", 0, 1, 1) == 1};
  } catch (const Error&) {
    return std::nullopt;
  }
}

void CandumpSink::on_wire(const RecordedWire& wire, Time) {
  if (const auto place = place_of(wire)) {
    wires_.insert_or_assign(wire.number, *place);
  } else {
    wires_.erase(wire.number);
    elsewhere_ = wire.url;
  }
}

void CandumpSink::on_record(const Record& record) {
  const auto wire = wires_.find(record.wire);
  const bool written = record.kind != RecordKind::event && wire != wires_.end() &&
                       write_frames(wire->second, record);
  ++(written ? written_ : others_);
}

// The two ends as they are on a bus. What does not come out as it went in is not written.
bool CandumpSink::write_frames(const Place& place, const Record& record) {
  CanNode board(CanEnd::board, place.node, place.fd);
  CanNode host(CanEnd::host, place.node, place.fd);
  board.use_packed_form(place.packed);
  host.use_packed_form(place.packed);
  const bool from_board = record.kind == RecordKind::from_board;
  CanNode& sender = from_board ? board : host;
  CanNode& receiver = from_board ? host : board;
  std::uint32_t now_us = 0;
  if (!sender.begin(Text(record.bytes), now_us)) return false;
  const CanLane lane = sender.lane_of(Text(record.bytes));
  text_.clear();
  bool arrived = false;
  while (!sender.idle(lane)) {
    CanFrame frame;
    const bool forth = sender.offer(now_us, frame);
    if (!forth && !receiver.offer(now_us, frame)) {
      const IsotpDeadline deadline = sender.deadline();
      if (!deadline.armed) return false;
      now_us = deadline.at_us;
      sender.poll(now_us);
      receiver.poll(now_us);
      continue;
    }
    (forth ? sender : receiver).frame_sent(now_us);
    if (classify(frame).kind == CanIdKind::went_safe) continue;  // once in a while only
    const Text whole = (forth ? receiver : sender).on_frame(frame, now_us);
    arrived = arrived || (forth && whole == Text(record.bytes));
    const auto us = record.time.count();
    const auto out = std::back_inserter(text_);
    fmt::format_to(out, "({}.{:06}) {} {:03X}#{}", us / 1'000'000, us % 1'000'000, place.interface,
                   frame.id, frame.fd ? "#0" : "");
    for (std::size_t i = 0; i < frame.size; ++i) fmt::format_to(out, "{:02X}", frame.data[i]);
    text_ += '\n';
  }
  if (arrived) output_.write(text_);
  return arrived;
}

void CandumpSink::finish() {
  if (written_ != 0) return;
  throw Error(ErrorKind::data, elsewhere_.empty() ? "the recording" : elsewhere_,
              "nothing of it went over a CAN bus, whose frames this format holds",
              "convert it to .mcap, .pcapng, .csv or .jsonl");
}

std::string CandumpSink::left_out() const {
  return others_ == 0 ? std::string() : fmt::format("{} that have no frames on a bus", others_);
}

}  // namespace r4::tool
