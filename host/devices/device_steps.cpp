// SPDX-License-Identifier: GPL-3.0-or-later
#include "device_steps.hpp"

#include <algorithm>
#include <string>

#include "../../protocol/messages/command_field.hpp"
#include "r4link/commands/command_text.hpp"

namespace r4 {

Command DeviceStep::command() const {
  if (kind == CommandKind::i2c_write) return Command::i2c_write(address, bytes);
  if (kind == CommandKind::i2c_read) return Command::i2c_read(address, bytes, count);
  if (count == 0) return Command::i2c_poll_off(slot);
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
  if (description.checks.empty()) {  // without a check, the device must at least answer
    add(CommandKind::i2c_read, description.polls.front().register_bytes).count =
        description.polls.front().count;
  }
  for (const DeviceWrite& write : description.writes) {
    add(CommandKind::i2c_write, write.bytes).wait = write.wait;
    if (&write != &description.writes.front()) continue;
    // Empties the slots until the set-up ends, because a reading during the set-up is not a
    // measurement. Follows the first write, because its confirmation proves that the
    // board accepts the set-up.
    for (int slot = device.first_slot(); slot <= device.last_slot(); ++slot) {
      add(CommandKind::i2c_poll, {}).slot = slot;
    }
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

std::chrono::milliseconds longest(const Device& device, std::chrono::milliseconds timeout) {
  std::chrono::milliseconds sum = timeout;  // of the command for the fields
  for (const DeviceStep& step : steps_of(device)) sum += timeout + step.wait;
  return sum;
}

std::optional<Problem> trouble_with(const Device& device, const DeviceStep& step,
                                    const I2cAnswer& answer) {
  Problem problem{ErrorKind::refused, device.text(), "", "", Outcome::refused};
  if (answer.outcome == I2cOutcome::cancelled) {
    problem.reason = "the set-up was cancelled: the board went safe, or another session began";
    problem.fix = "set the device up again";
  } else if (answer.outcome != I2cOutcome::done) {
    problem.reason = fmt::format("the device does not answer: {}", to_text(answer.outcome));
    problem.fix = "send X:SCAN to see which addresses answer; check supply, wires and pull-ups";
  } else if (!step.expected.empty() && !std::equal(answer.data.begin(), answer.data.end(),
                                                   step.expected.begin(), step.expected.end())) {
    problem.reason = fmt::format("this is another device: its register {} has {}, not {}",
                                 step.bytes, hex_of(answer.data), hex_of(step.expected));
    problem.fix = "check which device has this address, or describe the device: r4 devices";
    for (const DeviceLookalike& each : device.description().lookalikes) {
      if (hex_of(each.register_bytes) != step.bytes || hex_of(each.found) != hex_of(answer.data)) {
        continue;
      }
      problem.reason = fmt::format("this is {}: its register {} has {}, not {}", each.title,
                                   step.bytes, hex_of(answer.data), hex_of(step.expected));
      problem.fix = fmt::format(
          "describe the device: copy share/r4link/devices/{0}.device, write check {1} {2} in the "
          "copy, compare the rest with the data sheet, and give the path of the copy: ./{0}.device",
          device.description().name, step.bytes, hex_of(answer.data));
    }
  } else {
    return std::nullopt;
  }
  return problem;
}

std::string fields_with(const std::string& chosen, const Device& device) {
  if (chosen.empty()) return "";
  FieldSet sent;
  FieldSet wanted;
  parse_fields(chosen, sent);
  parse_fields(device.fields(), wanted);
  std::string all = chosen;
  for (const StateField field : wanted) {
    if (sent.has(field)) continue;
    const Text name = name_of(field);
    all.append(",").append(name.data(), name.size());
  }
  return all == chosen ? "" : all;
}

Problem explain(const Device& device, const CommandResult& result, const LinkStatus& link) {
  const std::vector<DeviceStep> steps = steps_of(device);
  Problem problem;
  if (result.step >= 1 && result.step <= steps.size()) {
    const DeviceStep& step = steps[result.step - 1U];
    if (result.transfer.pnum != 0) {
      if (auto trouble = trouble_with(device, step, result.transfer)) return *trouble;
    }
    if (result.outcome == Outcome::timed_out && result.executed != 0) {
      return {ErrorKind::refused, device.text(),
              "the end of the transfer was not reported: " + shown(step.command()),
              "give each step more time, or check the field I2CX of the state", Outcome::timed_out};
    }
    problem = explain(step.command(), result, link);
  } else {  // the command for the fields failed
    problem = explain(Command::fields(device.fields()), result, link);
  }
  problem.thing = device.text() + ": " + problem.thing;
  return problem;
}

}  // namespace r4
