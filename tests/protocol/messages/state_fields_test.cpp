// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/tables/state_fields.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/messages/state_fields.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::str;

// The values of a field in the table of docs/reference/protocol.md: "V", "pwm,direction".
std::string value_cell_of(const FieldKindRow& kind) {
  if (kind.value_count() == 1) return kind.values[0].unit;
  std::string names;
  for (int i = 0; i < kind.value_count(); ++i) {
    names += std::string(i == 0 ? "" : ",") + kind.values[i].name;
  }
  return names;
}

// The names in a cell of the same table: "`ENC1` … `ENC4`" means all four.
std::vector<std::string> names_in(const std::string& cell) {
  std::vector<std::string> names;
  std::istringstream words(cell);
  bool range = false;
  for (std::string word; words >> word;) {
    if (word == "…") {
      range = true;
      continue;
    }
    const std::string name = word.substr(1, word.size() - 2);
    if (range) {
      int next = static_cast<int>(state_field(Text(names.back()))) + 1;
      for (; next < static_cast<int>(state_field(Text(name))); ++next) {
        names.push_back(str(state_fields[next].name));
      }
    }
    range = false;
    names.push_back(name);
  }
  return names;
}

TEST(StateFields, MatchTheTableInProtocolMd) {
  std::ifstream file(R4_TEST_DATA "/../../docs/reference/protocol.md");
  std::string line;
  while (std::getline(file, line) && line != "### State fields") continue;
  while (std::getline(file, line) && line != "|---|---|---|") continue;
  const StateFieldRow* row = std::begin(state_fields);
  while (std::getline(file, line) && !line.empty()) {
    std::istringstream cells(line);
    std::string names;
    std::string values;
    std::getline(cells, names, '|');
    std::getline(cells, names, '|');
    std::getline(cells, values, '|');
    for (const std::string& name : names_in(names)) {
      ASSERT_NE(row, std::end(state_fields)) << name;
      EXPECT_EQ(name, str(row->name));
      EXPECT_EQ(values, " " + value_cell_of(row_of(row->kind)) + " ") << name;
      ++row;
    }
  }
  EXPECT_EQ(row, std::end(state_fields));
}

TEST(StateFields, HaveAUnitForEachValue) {
  for (const StateFieldRow& row : state_fields) {
    char buffer[100];
    DatagramWriter writer(buffer, sizeof buffer);
    write_field(writer, row.field, State());
    Datagram datagram;
    ASSERT_TRUE(read_datagram(writer.finish(), datagram));
    const FieldKindRow& kind = kind_row_of(row.field);
    const int count = kind.value_count();
    EXPECT_EQ(static_cast<std::size_t>(count), (*datagram.begin()).count()) << str(row.name);
    EXPECT_EQ(numbers_of(State(), row.field).count, count - (kind.has_bytes() ? 1 : 0))
        << str(row.name);
    for (int i = 0; i < count; ++i) {
      EXPECT_STRNE(kind.values[i].unit, "") << str(row.name);
      EXPECT_EQ(*kind.values[i].name == '\0', count == 1) << str(row.name);
    }
  }
}

TEST(StateFields, AreFoundByKindAndChannel) {
  int channels[field_kind_count] = {};
  for (const StateFieldRow& row : state_fields) {
    EXPECT_EQ(state_field(row.kind, row.channel), row.field) << str(row.name);
    EXPECT_EQ(state_field(row.name), row.field) << str(row.name);
    EXPECT_EQ(row.channel, ++channels[static_cast<int>(row.kind)]) << str(row.name);
  }
  for (int i = 0; i < field_kind_count; ++i) {
    EXPECT_EQ(state_field(static_cast<FieldKind>(i), 0), StateField::count);
    EXPECT_EQ(state_field(static_cast<FieldKind>(i), channels[i] + 1), StateField::count);
  }
  EXPECT_EQ(channels[static_cast<int>(FieldKind::osmc)], osmc_channels);
  EXPECT_EQ(channels[static_cast<int>(FieldKind::analog)], analog_channels);
  EXPECT_EQ(channels[static_cast<int>(FieldKind::servo)], servo_channels);
}

TEST(StateFields, AnalogFieldsHaveTheOrderOfTheInputs) {
  State state;
  for (int i = 0; i < analog_channels; ++i) state.raw.analog_cv[i] = 100 * i;
  for (int i = 0; i < analog_channels; ++i) {
    const StateField field = state_field(FieldKind::analog, i + 1);
    EXPECT_EQ(numbers_of(state, field)[0], state.volts(static_cast<Analog>(i)));
  }
  EXPECT_EQ(state_field(FieldKind::analog, static_cast<int>(Analog::ain6) + 1), StateField::ain6);
}

TEST(StateFields, NoSetContainsTheFieldCount) {
  FieldSet every;
  for (const StateFieldRow& row : state_fields) every.add(row.field);
  EXPECT_FALSE(every.has(StateField::count));
}

}  // namespace
}  // namespace r4
