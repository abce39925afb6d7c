// SPDX-License-Identifier: GPL-3.0-or-later
// Joins recorded CAN frames to datagrams, as boards and hosts do (docs/reference/can.md).
// Only listens. Times are the recording's. Memory is bounded by max_interfaces for any input.
#pragma once

#include <array>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "r4link/can/can_ids.hpp"
#include "r4link/datagram.hpp"
#include "transports/framing/can/isotp_receiver.hpp"

namespace r4::tool {

class BusTransfers {
 public:
  static constexpr std::size_t max_interfaces = 32;

  struct LogPosition {
    std::uint64_t line = 0;
    std::uint64_t offset = 0;  // position in the file, in bytes
    std::optional<std::uint64_t> time_us;
    std::string date;  // as written, if the log has dates instead of times
  };
  struct Lane {
    Lane(std::string name, const CanIdMeaning& what);
    Lane(const Lane&) = delete;
    Lane& operator=(const Lane&) = delete;

    const std::string interface;
    const CanIdMeaning meaning;
    std::array<std::uint8_t, max_datagram> bytes;
    IsotpReceiver receiver;
    bool answered = false;     // the other end has sent flow control
    std::uint32_t frames = 0;  // frames of the transfer so far
    LogPosition first, last;
  };
  class Handler {
   public:
    // lane.receiver holds a complete datagram, plain or packed.
    virtual void on_datagram(const Lane& lane) = 0;
    virtual void on_failure(const Lane& lane, const LogPosition& position, IsotpError error) = 0;
    // An emergency stop, a went-safe frame, or a watch frame.
    virtual void on_raw_frame(const std::string& interface, const CanIdMeaning& meaning,
                              const CanFrame& frame, const LogPosition& position) = 0;

   protected:
    ~Handler() = default;
  };

  explicit BusTransfers(Handler& handler) : handler_(handler) {}

  enum class Frame : std::uint8_t { taken, other, too_many_interfaces };
  Frame on_frame(std::string_view interface, const CanFrame& frame, const LogPosition& position);
  void pass_time(const std::optional<std::uint64_t>& time_us);

  std::vector<const Lane*> unfinished() const;
  std::uint64_t flow_control() const { return flow_control_; }
  std::uint64_t orphans() const { return orphans_; }

 private:
  struct Interface {
    std::string name;
    // By node and kind (command, reply, telemetry); created at first use.
    std::array<std::array<std::unique_ptr<Lane>, 3>, can_nodes> lanes;
  };

  void on_lane_frame(Interface& interface, const CanIdMeaning& meaning, const CanFrame& frame,
                     const LogPosition& position);
  Interface* interface_of(std::string_view name);
  Lane& lane_of(Interface& interface, const CanIdMeaning& meaning);
  void end_late_transfers();

  Handler& handler_;
  std::list<Interface> interfaces_;
  std::vector<Lane*> lanes_;
  std::uint32_t now_us_ = 0;
  std::optional<std::uint64_t> last_time_us_;
  IsotpDeadline earliest_{false, 0};  // earliest timeout of a transfer
  std::uint64_t flow_control_ = 0;
  std::uint64_t orphans_ = 0;
};

}  // namespace r4::tool
