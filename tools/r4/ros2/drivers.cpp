// SPDX-License-Identifier: GPL-3.0-or-later
#include "drivers.hpp"

#include <algorithm>

#include "r4link/tables/state_fields.hpp"

namespace r4::tool::ros2 {
namespace {

constexpr int supply_relay = 1;

}  // namespace

bool Drivers::rests(const Command& command) {
  switch (command.kind) {
    case CommandKind::stepper:
    case CommandKind::zero:
      return false;
    case CommandKind::relay:
      return !command.on;
    case CommandKind::bldc:
      return command.value == 0 && command.on;
    default:
      return command.value == 0;
  }
}

std::optional<std::size_t> Drivers::index_of(const Command& command) {
  std::size_t first = 0;
  for (const CommandRow& row : command_rows) {
    if (!is_driven(row)) continue;
    if (command.kind == row.kind) {
      if (row.kind == CommandKind::relay && command.channel == supply_relay) return std::nullopt;
      return first + command.channel - 1U;
    }
    first += row.channels;
  }
  return std::nullopt;
}

std::optional<Command> Drivers::stop_of(std::size_t index, Time now) const {
  std::size_t i = index;
  const CommandRow* row = command_rows;
  for (; !is_driven(*row) || i >= row->channels; ++row) {
    if (is_driven(*row)) i -= row->channels;
  }
  Command stop;
  stop.kind = row->kind;
  stop.channel = static_cast<std::uint8_t>(i + 1);
  stop.direction = Direction::forward;
  stop.on = row->kind == CommandKind::bldc;  // the brake
  if (row->kind == CommandKind::stepper) {
    const Position& position = positions_[i];
    if (!position.sampled || now - *position.sampled > oldest_position) return std::nullopt;
    stop.value = position.steps;
  }
  return stop;
}

void Drivers::on_sent(const Command& command, const void* source, std::uint64_t publisher,
                      Time now) {
  if (command.kind == CommandKind::zero) {
    positions_[command.channel - 1U] = {0, std::nullopt, now + longest_way, 0};
  }
  const auto index = index_of(command);
  if (!index) return;
  Output& output = outputs_[*index];
  const bool rest = rests(command);
  if (rest && output.stage != Stage::driven) return;
  output = {rest ? Stage::stopping : Stage::driven, source, publisher, now, ++sent_, rest};
}

void Drivers::on_number(const Command& command, std::uint32_t pnum) {
  if (command.kind != CommandKind::zero) return;
  Position& position = positions_[command.channel - 1U];
  if (position.zero == 0) position.zero = pnum;  // otherwise a later Z has been sent
}

void Drivers::on_state(const State& state, Time sampled) {
  for (int n = 1; n <= stepper_channels; ++n) {
    Position& position = positions_[static_cast<std::size_t>(n - 1)];
    const auto after_zero = static_cast<std::int32_t>(state.last_command - position.zero);
    if (position.zero != 0 && after_zero >= 0) {
      position.counts_from = sampled;
      position.zero = 0;
    }
    if (!state.present.has(state_field(FieldKind::stepper, n)) || sampled < position.counts_from)
      continue;
    position.steps = state.steps(n);
    position.sampled = sampled;
  }
}

void Drivers::on_publishers(const void* source, const std::vector<std::uint64_t>& there) {
  for (Output& output : outputs_) {
    if (output.stage != Stage::driven || output.source != source) continue;
    if (std::find(there.begin(), there.end(), output.publisher) == there.end()) {
      output.stage = Stage::stopping;
    }
  }
}

void Drivers::forget() {
  outputs_.fill({});
  for (Position& position : positions_) position.zero = 0;  // a new session has other numbers
}

void Drivers::forget(const Command& command) {
  if (const auto index = index_of(command)) outputs_[*index] = {};
}

Drivers::Stop Drivers::to_stop(Time now) {
  Stop stop{{}, sent_, false};
  for (std::size_t i = 0; i < outputs; ++i) {
    Output& output = outputs_[i];
    const bool silent = deadline_.count() != 0 && now - output.last >= deadline_;
    if (output.stage == Stage::driven && silent) output.stage = Stage::stopping;
    if (output.stage != Stage::stopping || stop.commands.size() == max_group) continue;
    const auto command = stop_of(i, now);
    if (!command) continue;
    const bool voltage = command->kind == CommandKind::dac;
    if (voltage && !stop.commands.empty() && stop.commands[0].kind != CommandKind::dac) continue;
    stop.commands.push_back(*command);
    stop.missed = stop.missed || !output.asked;
  }
  return stop;
}

void Drivers::stopped(const Stop& stop) {
  for (const Command& command : stop.commands) {
    const auto index = index_of(command);
    if (index && outputs_[*index].sent <= stop.sent) outputs_[*index] = {};
  }
}

bool Drivers::any() const {
  return std::any_of(outputs_.begin(), outputs_.end(),
                     [](const Output& output) { return output.stage != Stage::free; });
}

}  // namespace r4::tool::ros2
