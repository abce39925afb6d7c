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

  virtual void on_state(const ReceivedState& state, const Datagram& datagram) = 0;
  virtual void on_heartbeat(const Datagram& datagram) = 0;
  // What a described device has measured newly, of one of its polls.
  virtual void on_reading(const DeviceNews& news) = 0;
  // What stands in the way of setting one up.
  virtual void on_device_trouble(const Problem& problem) = 0;
  virtual void on_end() {}
  virtual void on_nack(const Nack& nack, const Datagram& datagram) = 0;
  virtual void on_bad_datagram(const ReadResult& result, std::string_view bytes) = 0;
  virtual void on_link(const LinkStatus& status) = 0;
  virtual void on_event(const CarrierEvent& event) = 0;
  // One of several has begun to carry, or ceased to.
  virtual void on_path(const PathStatus& path) = 0;
  // Ten times a second.
  virtual void on_tick() {}
  // Lines that were left out because nobody read the output.
  virtual std::uint64_t skipped() const { return 0; }
};

// One object a line: type, transport, pnum, t, fields.
std::unique_ptr<MonitorView> make_json_view(const AsyncBoard& board);
// The same among those of other boards.
std::unique_ptr<MonitorView> make_json_view(const AsyncBoard& board, LineWriter& lines);
// One line a state, for people who pipe it.
std::unique_ptr<MonitorView> make_plain_view();
// A status of a few lines, redrawn in place.
std::unique_ptr<MonitorView> make_live_view(const AsyncBoard& board);

// For people: "ACTIVE", "SAFE (stop)", "ACTIVE, another host controls the board; stop that host …".
std::string link_text(const LinkStatus& status);
// "accel_x 0.02 m/s2"; "-" for what is no measurement.
std::string value_text(const DeviceNews::Value& value);

}  // namespace r4::tool
