// SPDX-License-Identifier: GPL-3.0-or-later
#include "stop_numbers.hpp"

#include "../../protocol/messages/command_field.hpp"
#include "../../protocol/messages/message.hpp"
#include "r4link/messages/datagram_writer.hpp"

namespace r4 {

void StopNumbers::add(std::uint32_t pnum, std::uint32_t carried) {
  stops_[next_].pnum = pnum;
  stops_[next_].carried = carried;
  next_ = (next_ + 1) % most;
  if (count_ < most) ++count_;
}

bool StopNumbers::find(std::uint32_t pnum, std::uint32_t& carried) const {
  for (std::size_t i = 0; i < count_; ++i) {
    if (stops_[i].pnum != pnum) continue;
    carried = stops_[i].carried;
    return true;
  }
  return false;
}

const StopNumbers::Stop* StopNumbers::stop_of(std::uint32_t carried) const {
  for (std::size_t i = 0; i < count_; ++i) {
    if (stops_[i].carried == carried) return &stops_[i];
  }
  return nullptr;
}

Text StopNumbers::in_full(Text datagram, char* room) const {
  if (count_ == 0 || datagram.empty() || datagram.data()[0] != 'H') return datagram;
  Datagram heartbeat;
  if (!read_datagram(datagram, heartbeat)) return datagram;
  const SafeReport report = heartbeat_report(heartbeat);
  const Stop* const stop = report.has_stop ? stop_of(report.stop) : nullptr;
  if (stop == nullptr) return datagram;
  DatagramWriter writer(room, max_datagram);
  for (const Field& field : heartbeat) {
    writer.field(field.name());
    if (field.name() == stop_number_name) {
      writer.value(stop->pnum);
    } else {
      writer.values(field.values());
    }
  }
  const Text whole = writer.finish();
  return whole.empty() ? datagram : whole;
}

}  // namespace r4
