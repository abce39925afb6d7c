// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "r4link/error.hpp"

namespace r4 {

namespace {

template <class Bytes>
std::string hex_of(const Bytes& bytes) {
  return fmt::format("x{:02x}", fmt::join(bytes.begin(), bytes.end(), ""));
}

}  // namespace

Command DeviceStep::command() const {
  if (kind == CommandKind::i2c_write) return Command::i2c_write(address, bytes);
  if (kind == CommandKind::i2c_read) return Command::i2c_read(address, bytes, count);
  return Command::i2c_poll(slot, address, bytes, count, static_cast<int>(poll_period.count()));
}

std::vector<DeviceStep> steps_of(const Device& device) {
  const DeviceDescription& description = device.description();
  std::vector<DeviceStep> steps;
  const auto add = [&](CommandKind kind, const std::vector<std::uint8_t>& bytes) -> DeviceStep& {
    DeviceStep& step = steps.emplace_back();
    step.kind = kind;
    step.address = device.address();
    step.bytes = hex_of(bytes);
    return step;
  };
  for (const DeviceCheck& check : description.checks) {
    DeviceStep& step = add(CommandKind::i2c_read, check.register_bytes);
    step.count = static_cast<int>(check.expected.size());
    step.expected = check.expected;
  }
  if (description.checks.empty()) {  // does anything answer?
    add(CommandKind::i2c_read, description.polls.front().register_bytes).count =
        description.polls.front().count;
  }
  for (const DeviceWrite& write : description.writes) {
    add(CommandKind::i2c_write, write.bytes).wait = write.wait;
  }
  int slot = device.first_slot();
  for (const DevicePoll& poll : description.polls) {
    DeviceStep& step = add(CommandKind::i2c_poll, poll.register_bytes);
    step.count = poll.count;
    step.poll_period = poll.period;
    step.slot = slot++;
  }
  return steps;
}

void require_answer(const Device& device, const DeviceStep& step, const I2cAnswer& answer) {
  if (answer.outcome == I2cOutcome::cancelled) {
    throw Error(ErrorKind::refused, device.text(),
                "its set-up was broken off: the board went safe, or another session began",
                "set it up again");
  }
  if (answer.outcome != I2cOutcome::done) {
    throw Error(ErrorKind::refused, device.text(),
                fmt::format("it does not answer: {}", to_text(answer.outcome)),
                "X:SCAN shows which addresses answer; look at supply, wires and pull-ups");
  }
  if (step.expected.empty() || std::equal(answer.data.begin(), answer.data.end(),
                                          step.expected.begin(), step.expected.end())) {
    return;
  }
  throw Error(ErrorKind::refused, device.text(),
              fmt::format("it is another device: its register {} has {}, not {}", step.bytes,
                          hex_of(answer.data), hex_of(step.expected)),
              "look what is at that address, or describe it: r4 devices");
}

}  // namespace r4
