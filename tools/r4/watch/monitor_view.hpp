// SPDX-License-Identifier: GPL-3.0-or-later
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

struct DeviceNews {
  const Device& device;
  std::uint32_t pnum = 0;
  std::uint32_t t_ms = 0;  // time of the reading on the board
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
  virtual void on_reading(const DeviceNews&) {}
  virtual void on_device_trouble(const Problem&) {}
  virtual void on_end() {}
  virtual void on_nack(const Nack&, const Datagram&) {}
  virtual void on_bad_datagram(const ReadResult&, std::string_view) {}
  virtual void on_link(const LinkStatus&) {}
  virtual void on_event(const CarrierEvent&) {}
  virtual void on_path(const PathStatus&) {}
  // Called ten times a second.
  virtual void on_tick() {}
};

// One JSON object a line: type, transport, pnum, t, fields. `lines` must outlive the view.
std::unique_ptr<MonitorView> make_json_view(const AsyncBoard& board, LineWriter& lines);
std::unique_ptr<MonitorView> make_plain_view(LineWriter& lines);
std::unique_ptr<MonitorView> make_live_view(const AsyncBoard& board);

// For people: "ACTIVE", "SAFE (stop)", "ACTIVE, another host controls the board; stop that host …".
std::string link_text(const LinkStatus& status);
// "accel_x 0.02 m/s2"; "-" for an invalid measurement.
std::string value_text(const DeviceNews::Value& value);

}  // namespace r4::tool
