// SPDX-License-Identifier: GPL-3.0-or-later
#include "command_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "r4link/commands/command_text.hpp"

namespace r4 {
namespace {

#define R4_DRIVE_SENTENCE "{name} {ch} {direction}, duty {duty:g}{brake}"
constexpr KindWords kind_words[] = {
#define R4_COMMAND(kind, letter, word, effect, channels, values, ...) \
  {CommandKind::kind, __VA_ARGS__},
#include "r4link/tables/board.def"
};

// In `range`, {0} and {1} are the least and the most.
struct ValueWords {
  std::string_view name;
  std::string_view range;
};
constexpr ValueWords value_words[] = {
#define R4_COMMAND_VALUE(value, role, min, max, ...) {__VA_ARGS__},
#define R4_OPTIONAL_VALUE(value, role, min, max, missing, ...) {__VA_ARGS__},
#include "r4link/tables/board.def"
};

// {0} and {1} are the least and the most, {2} and {3} a hundredth of them.
constexpr std::string_view taken_values[] = {
#define R4_SETTING(setting, key, keys, min, max, standard, values) values,
#include "r4link/tables/board.def"
};

const ValueWords& words_of(CommandValue value) {
  return value_words[static_cast<std::size_t>(value)];
}

std::string form_of(CommandKind kind) {
  const CommandRow& row = row_of(kind);
  std::string form{row.letter, ':'};
  form.append(row.word.data(), row.word.size());
  for (const CommandValue value : row) {
    const std::string_view comma = form.back() == ':' ? "" : ",";
    const std::string name = fmt::format("{}{}", comma, words_of(value).name);
    form += row_of(value).optional ? "[" + name + "]" : name;
  }
  return form;
}

std::string ranges_of(CommandKind kind) {
  const CommandRow& row = row_of(kind);
  std::string ranges;
  for (const CommandValue value : row) {
    const std::string_view range = words_of(value).range;
    const std::int32_t min = row_of(value).min;
    const bool channel = row_of(value).role == ValueRole::channel;
    const std::int32_t max = channel ? row.channels : row_of(value).max;
    if (range.empty()) continue;
    if (!ranges.empty()) ranges += ", ";
    ranges += fmt::format(fmt::runtime(range), min, max);
  }
  if (kind != CommandKind::setting) return ranges;
  for (const SettingRow& each : setting_rows) {
    ranges +=
        fmt::format("{}{} {}", ranges.empty() ? "" : "; ",
                    std::string_view(each.key.data(), each.key.size()), values_of(each.setting));
  }
  return ranges;
}

}  // namespace

const KindWords& words_of(CommandKind kind) { return kind_words[static_cast<std::size_t>(kind)]; }

std::string values_of(Setting setting) {
  const SettingRow& row = row_of(setting);
  return fmt::format(fmt::runtime(taken_values[static_cast<std::size_t>(setting)]), row.min,
                     row.max, row.min / 100.0, row.max / 100.0);
}

std::string_view name_of(CommandKind kind) { return words_of(kind).name; }

const CommandHelp& command_help(CommandKind kind) {
  return all_command_help()[static_cast<std::size_t>(kind)];
}

std::span<const CommandHelp> all_command_help() {
  static const auto all = [] {
    std::array<CommandHelp, command_kinds> help;
    for (std::size_t i = 0; i < command_kinds; ++i) {
      const KindWords& each = kind_words[i];
      help[i] = {each.kind, form_of(each.kind), each.meaning, ranges_of(each.kind)};
    }
    return help;
  }();
  return all;
}

}  // namespace r4
