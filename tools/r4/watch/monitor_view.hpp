// SPDX-License-Identifier: GPL-3.0-or-later
// How `r4 monitor` shows what it hears: JSON, plain lines, or a status that is redrawn.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "r4link/async_board.hpp"
#include "r4link/carrier.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/error.hpp"

namespace r4::tool {

class LineWriter;

// The values of a device that came with one of its readings.
struct DeviceNews {
  const Device& device;
  std::uint32_t pnum = 0;  // of the state
  std::uint32_t t_ms = 0;  // when the board read them
  struct Value {
    const DeviceValue* meaning = nullptr;
    std::optional<double> number;
  };
  std::vector<Value> values;
};

class MonitorView {
 public:
  virtual ~MonitorView() = default;
  MonitorView() = default;
  MonitorView(const MonitorView&) = delete;
  MonitorView& operator=(const MonitorView&) = delete;

  virtual void on_state(const ReceivedState&, const Datagram&) {}
  virtual void on_heartbeat(const Datagram&) {}
  // What a described device has measured newly, of one of its polls.
  virtual void on_reading(const DeviceNews&) {}
  // What stands in the way of setting one up.
  virtual void on_device_trouble(const Problem&) {}
  virtual void on_end() {}
  virtual void on_nack(const Nack&, const Datagram&) {}
  virtual void on_bad_datagram(const ReadResult&, std::string_view) {}
  virtual void on_link(const LinkStatus&) {}
  virtual void on_event(const CarrierEvent&) {}
  // One of several has begun to carry, or ceased to.
  virtual void on_path(const PathStatus&) {}
  // Ten times a second.
  virtual void on_tick() {}
};

// One object a line: type, transport, pnum, t, fields. The lines outlive the view.
std::unique_ptr<MonitorView> make_json_view(const AsyncBoard& board, LineWriter& lines);
// One line a state, for people who pipe it.
std::unique_ptr<MonitorView> make_plain_view(LineWriter& lines);
// A status of a few lines, redrawn in place.
std::unique_ptr<MonitorView> make_live_view(const AsyncBoard& board);

// For people: "ACTIVE", "SAFE (stop)", "ACTIVE, another host controls the board; stop that host …".
std::string link_text(const LinkStatus& status);
// "accel_x 0.02 m/s2"; "-" for what is no measurement.
std::string value_text(const DeviceNews::Value& value);

}  // namespace r4::tool
