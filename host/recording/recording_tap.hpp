// SPDX-License-Identifier: GPL-3.0-or-later
// Records a board's link between transport and session: every datagram, before it is checked.
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "r4link/carrier.hpp"
#include "r4link/devices/device.hpp"
#include "r4link/link.hpp"
#include "recorder.hpp"

namespace r4 {

class RecordingTap {
 public:
  // Records into `recorder` instead of an earlier recorder. `url`: of the path.
  void attach(std::shared_ptr<Recorder> recorder, const std::string& url);
  void detach() { recorder_.reset(); }
  bool attached() const { return recorder_ != nullptr; }
  // Returns, once, why the recording has ended or was restarted. Detaches an ended recording.
  std::optional<Problem> take_news();

  // `at`: when the datagram arrived, by the steady clock.
  void on_received(std::string_view bytes, Time at) {
    if (recorder_) recorder_->record(path_, RecordKind::from_board, bytes, at);
  }
  // Sent by this program, or by another program on the same path.
  void on_sent(std::string_view bytes) { record(RecordKind::to_board, bytes); }
  void on_oversize(std::string_view beginning);
  void on_carrier_event(const CarrierEvent& event);
  void on_link(const LinkStatus& link);
  void on_packets(const PacketCounters& packets);
  void on_name(std::string_view name);
  void on_device(const Device& device);

 private:
  void record(RecordKind kind, std::string_view bytes) {
    if (recorder_) recorder_->record(path_, kind, bytes);
  }

  std::shared_ptr<Recorder> recorder_;
  unsigned known_news_ = 0;
  std::uint16_t path_ = no_path;
  HostLinkState state_ = HostLinkState::connecting;
  SafeReason reason_ = SafeReason::none;
  std::uint32_t lost_ = 0;
};

}  // namespace r4
