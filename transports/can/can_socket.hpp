// SPDX-License-Identifier: GPL-3.0-or-later
// A raw SocketCAN socket: arrival times, error frames, kernel filters, sends that never wait.
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

Problem can_problem(const std::string& interface, int error);

class CanSocket final : public CanMedium {
 public:
  CanSocket(std::string interface, bool fd);
  ~CanSocket() override;

  const std::string& name() const override { return name_; }
  // Throws Error: unsupported (no CAN in the kernel, no such interface), usage (not a CAN
  // interface), open (interface down, or without CAN FD), permission.
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
  FileDescriptor first_;  // for send_first(); has its own priority and queue
  bool simulated_ = false;
  bool heard_rate_switch_ = false;
  std::uint32_t overflows_ = 0;
  std::uint32_t overflows_before_ = 0;  // overflows of earlier openings
  const std::unique_ptr<Inbox> inbox_;
};

}  // namespace r4
