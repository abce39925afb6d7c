// SPDX-License-Identifier: GPL-3.0-or-later
// How `r4 monitor` shows what it hears: JSON, plain lines, or a status that is redrawn.
#pragma once

#include <memory>
#include <string_view>

#include "r4link/async_board.hpp"
#include "r4link/carrier.hpp"

namespace r4::tool {

class LineWriter;

class MonitorView {
 public:
  virtual ~MonitorView() = default;
  MonitorView() = default;
  MonitorView(const MonitorView&) = delete;
  MonitorView& operator=(const MonitorView&) = delete;

  virtual void on_state(const ReceivedState& state, const Datagram& datagram) = 0;
  virtual void on_heartbeat(const Datagram& datagram) = 0;
  virtual void on_end() {}
  virtual void on_nack(const Nack& nack, const Datagram& datagram) = 0;
  virtual void on_bad_datagram(const ReadResult& result, std::string_view bytes) = 0;
  virtual void on_link(const LinkStatus& status) = 0;
  virtual void on_event(const CarrierEvent& event) = 0;
  // One of several has begun to carry, or ceased to.
  virtual void on_wire(const Wire& wire) = 0;
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

// "ACTIVE", "SAFE (stop)", "busy: another host controls the board": for people.
std::string link_text(const LinkStatus& status);

}  // namespace r4::tool
