// SPDX-License-Identifier: GPL-3.0-or-later
// A raw SocketCAN socket on one interface: frames in batches with the time at which they came, the
// controller's error frames apart, and sends that never wait. The kernel filters what it hears.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "../file_descriptor.hpp"
#include "can_medium.hpp"
#include "r4link/can/can_frame.hpp"
#include "r4link/error.hpp"

namespace r4 {

// The meaning of an errno of a socket on that interface, with the fix if there is one.
Problem can_problem(const std::string& interface, int error);

class CanSocket final : public CanMedium {
 public:
  // On `interface`. With `fd`, CAN FD frames can be sent.
  CanSocket(std::string interface, bool fd);
  ~CanSocket() override;

  const std::string& name() const override { return name_; }
  // Throws Error: unsupported if this kernel has no CAN or there is no such interface, open if the
  // interface is down, is not CAN or does not do CAN FD, permission.
  void open() override;
  void close() noexcept override;
  int number() const override { return descriptor_.get(); }
  bool simulated() const override { return simulated_; }
  bool heard_rate_switch() const override { return heard_rate_switch_; }
  std::string state() const override;
  Problem problem(int error) const override;
  [[nodiscard]] bool hear(const std::vector<std::uint32_t>& ids) override;
  [[nodiscard]] bool hear_everything() override;
  int receive(std::array<Received, batch>& frames) override;
  Outcome send(const CanFrame* frames, std::size_t count, std::size_t& sent) override;
  Outcome send_first(const CanFrame& frame) override;
  std::uint32_t overflows() const override { return overflows_before_ + overflows_; }

 private:
  struct Inbox;
  const std::string interface_;
  const std::string name_;
  const bool fd_;
  FileDescriptor descriptor_;
  FileDescriptor first_;  // with a priority and a queue of its own
  bool simulated_ = false;
  bool heard_rate_switch_ = false;
  std::uint32_t overflows_ = 0;         // of this opening
  std::uint32_t overflows_before_ = 0;  // of earlier openings
  const std::unique_ptr<Inbox> inbox_;
};

}  // namespace r4
