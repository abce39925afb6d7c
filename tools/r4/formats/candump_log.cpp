// SPDX-License-Identifier: GPL-3.0-or-later
#include "candump_log.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "../bus/candump.hpp"
#include "r4link/discovery/url.hpp"
#include "r4link/error.hpp"
#include "transports/framing/can/can_node.hpp"

namespace r4::tool {
namespace {

// Bytes without a frame after which the file is not accepted as a log.
constexpr std::uint64_t patience = 65536;
// SocketCAN is younger than September 2001: earlier times are not relative to 1970.
constexpr std::uint64_t earliest_us = 1'000'000'000'000'000;
// Largest disorder between frames of several interfaces.
constexpr std::uint64_t disorder_us = 1000;

}  // namespace

bool CandumpSource::recognises(std::string_view line) {
  CandumpLine read;
  return read_candump_line(line, read) == CandumpError::none;
}

void CandumpSource::feed(std::string_view bytes) {
  lines_.push(
      bytes, [this](std::uint64_t number, std::string_view text) { on_line(number, text); },
      [this](std::uint64_t number, std::uint64_t) {
        damage(number, "a line that is too long for candump");
      });
  if (!recognised_ && lines_.begin() > patience) fail_as_none();
}

void CandumpSource::finish() {
  lines_.finish([this](std::uint64_t number, std::string_view text) { on_line(number, text); },
                [this](std::uint64_t number, std::uint64_t) {
                  damage(number, "a line that is too long for candump");
                });
  if (!recognised_) fail_as_none();
  records_.finish();
  if (start_ && frames_ > 1 && latest_us_ == first_us_) {
    fail("all its times are the same (candump -H without hardware time stamps)",
         "record it again with candump -L");
  }
  if (!records_.told() && !undated_) {
    fail("does not contain a complete datagram of a board",
         "record on the bus of the board for a second or longer: candump -L can0");
  }
}

void CandumpSource::on_line(std::uint64_t number, std::string_view text) {
  CandumpLine line;
  const CandumpError error = read_candump_line(text, line);
  if (error == CandumpError::detail) return;
  if (error != CandumpError::none) return damage(number, to_text(error));
  if (!line.time_us || line.date) {
    undated_ = true;
    return damage(number, "a line without a time since 1970, which candump -L writes");
  }
  if (!start_ && *line.time_us < earliest_us) {
    if (recognised_) return damage(number, "a line whose time does not count from 1970");
    fail("its times do not count from 1970 (candump -tz, -td or -H)",
         "for -tz, give the time of the first frame: r4 convert --start 2026-11-23T21:20:00 (UTC); "
         "otherwise record it again with candump -L");
  }
  const std::uint64_t time_us = dated(*line.time_us);
  recognised_ = true;
  ++frames_;
  if (line.error_frame) return;  // from the controller, not the bus
  records_.on_frame(line.interface, line.frame, {number, lines_.begin(), time_us, {}});
}

std::uint64_t CandumpSource::dated(std::uint64_t time_us) {
  if (frames_ == 0) first_us_ = latest_us_ = time_us;
  const bool goes_back = time_us + disorder_us < latest_us_;
  latest_us_ = std::max(latest_us_, time_us);
  if (!start_) return time_us;
  if (goes_back) {
    fail("its times decrease, so they do not count from the first frame (candump -td)",
         "record it again with candump -L");
  }
  return static_cast<std::uint64_t>(start_->count()) + (std::max(time_us, first_us_) - first_us_);
}

void CandumpSource::damage(std::uint64_t number, const char* reason) {
  visitor_.on_damage({RecordingDamage::Kind::line, number, lines_.begin(), reason});
}

void CandumpSource::fail(const char* reason, const char* fix) const {
  throw Error(ErrorKind::data, name_, reason, fix);
}

void CandumpSource::fail_as_none() const {
  fail("is not a log of CAN frames", "make a log: candump -L can0 > FILE");
}

std::optional<CandumpSink::BusAddress> CandumpSink::bus_of(const RecordedPath& path) {
  try {
    const Url url = Url::parse(path.url);
    if (url.scheme() != "can" || url.host().empty()) return std::nullopt;
    const std::string interface = bus_interface(url.host());
    if (!is_interface_name(interface)) return std::nullopt;
    return BusAddress{interface, static_cast<std::uint8_t>(url.get_number("node", 0, 31, 1)),
                      url.get_number("fd", 0, 1, 0) == 1, url.get_number("pack", 0, 1, 1) == 1};
  } catch (const Error&) {
    return std::nullopt;
  }
}

void CandumpSink::on_path(const RecordedPath& path, Time) {
  if (const auto bus = bus_of(path)) {
    paths_.insert_or_assign(path.number, *bus);
  } else {
    paths_.erase(path.number);
    elsewhere_ = path.url;
  }
}

void CandumpSink::on_record(const Record& record) {
  const auto path = paths_.find(record.path);
  const bool written = record.kind != RecordKind::event && path != paths_.end() &&
                       write_frames(path->second, record);
  ++(written ? written_ : others_);
}

// Simulates both ends of the bus. A datagram that does not arrive unchanged is not written.
bool CandumpSink::write_frames(const BusAddress& bus, const Record& record) {
  CanNode board(CanEnd::board, bus.node, bus.fd);
  CanNode host(CanEnd::host, bus.node, bus.fd);
  board.use_packed_form(bus.packed);
  host.use_packed_form(bus.packed);
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
    if (classify(frame).kind == CanIdKind::went_safe) continue;  // a rare frame of boards
    const Text whole = (forth ? receiver : sender).on_frame(frame, now_us);
    arrived = arrived || (forth && whole == Text(record.bytes));
    const auto us = record.time.count();
    const auto out = std::back_inserter(text_);
    fmt::format_to(out, "({}.{:06}) {} {:03X}#{}", us / 1'000'000, us % 1'000'000, bus.interface,
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
              "has no datagrams from a CAN bus, but this format stores only CAN frames",
              "convert it to .mcap, .pcapng, .csv or .jsonl");
}

std::string CandumpSink::left_out() const {
  return others_ == 0 ? std::string() : fmt::format("{} records without frames on a bus", others_);
}

}  // namespace r4::tool
