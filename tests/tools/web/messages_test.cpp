// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/web/messages.hpp"

#include <gtest/gtest.h>

#include <set>

#include "r4link/tables/state_fields.hpp"
#include "tests/support/datagrams.hpp"

namespace r4::tool::web {
namespace {

// The values of a JSON row by the names of their columns. The key of the time is "time".
Json row_of(const Columns& columns, const Json& row) {
  Json values;
  values["time"] = row.at(0);
  for (std::size_t i = 0; i < columns.size(); ++i) values[columns.names()[i]] = row.at(i + 1);
  return values;
}

Json rows_after(const Columns& columns, std::initializer_list<const char*> states) {
  Rows rows(columns);
  std::int64_t time = 1000;
  for (const char* state : states) {
    const std::string bytes = test::with_crc(state);
    Datagram datagram;
    EXPECT_TRUE(read_datagram(Text(bytes), datagram));
    rows.add(datagram, time++);
  }
  std::string text;
  rows.take(text);
  EXPECT_TRUE(rows.empty());
  return Json::parse(text);
}

TEST(WebRows, HaveAColumnForEachValueOfEveryField) {
  const Columns columns;
  std::size_t values = 0;
  for (const StateFieldRow& row : state_fields) {
    values += static_cast<std::size_t>(row_of(row.kind).value_count());
  }
  EXPECT_EQ(columns.size(), values);
  EXPECT_EQ(columns.units().size(), values);
  const std::set<std::string> different(columns.names().begin(), columns.names().end());
  EXPECT_EQ(different.size(), values);
}

TEST(WebRows, HaveAColumnForEachValueOfADescribedDevice) {
  const Columns columns({Device::from("ina219@0x40:3")});
  const Json rows = rows_after(columns, {"I2C3:1000,0,x07d0;I2C4:1002,0,x5d98;PNum:1;T:10;",
                                         "I2C3:0,0,x;I2C4:0,0,x;PNum:2;T:20;"});
  EXPECT_EQ(row_of(columns, rows.at(0)).at("ina219@0x40.voltage"), 11.98);
  EXPECT_EQ(row_of(columns, rows.at(0)).at("ina219@0x40.current"), 0.2);
  EXPECT_TRUE(row_of(columns, rows.at(1)).at("ina219@0x40.current").is_null());
  EXPECT_EQ(columns.units().back(), "A");
}

TEST(WebRows, ShowTheNumbersOfADatagramAndNullForMissingOnes) {
  const Columns columns;
  const Json rows =
      rows_after(columns, {"AIN24:24.28;OSMC1:358,1;BLDC2:7,0,1;CMD:4294967295;X:5;PNum:1;T:10;"});
  ASSERT_EQ(rows.size(), 1U);
  const Json row = row_of(columns, rows[0]);
  EXPECT_EQ(row["time"], 1000);
  EXPECT_EQ(row["AIN24"], 24.28);
  EXPECT_EQ(row["OSMC1.pwm"], 358);
  EXPECT_EQ(row["OSMC1.direction"], 1);
  EXPECT_EQ(row["BLDC2.speed"], 7);
  EXPECT_EQ(row["BLDC2.brake"], 1);
  EXPECT_EQ(row["CMD"], 4294967295U);
  EXPECT_TRUE(row["AIN12"].is_null());
}

TEST(WebRows, PutThePartsOfAStateTogether) {
  const Columns columns;
  const Json rows =
      rows_after(columns, {"AIN24:1;PNum:1;T:10;", "AIN12:2;PNum:2;T:10;", "AIN24:3;PNum:3;T:20;"});
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(row_of(columns, rows[0])["AIN24"], 1);
  EXPECT_EQ(row_of(columns, rows[0])["AIN12"], 2);
  EXPECT_TRUE(row_of(columns, rows[1])["AIN12"].is_null());
}

TEST(WebRows, KeepTheNewest64) {
  const Columns columns;
  Rows rows(columns);
  for (int i = 0; i < 100; ++i) {
    const std::string bytes = test::with_crc("AIN24:1;PNum:1;T:" + std::to_string(i) + ";");
    Datagram datagram;
    ASSERT_TRUE(read_datagram(Text(bytes), datagram));
    rows.add(datagram, i);
  }
  std::string text;
  rows.take(text);
  const Json kept = Json::parse(text);
  ASSERT_EQ(kept.size(), 64U);
  EXPECT_EQ(kept[0][0], 36);
  EXPECT_EQ(kept[63][0], 99);
}

TEST(WebChannels, NameExistingColumns) {
  const Columns columns;
  const std::set<std::string> names(columns.names().begin(), columns.names().end());
  const Json channels = channels_json();
  EXPECT_EQ(channels.size(), 42U);
  EXPECT_EQ(channels[0]["command"], "O:{value},{direction},1");
  for (const Json& channel : channels) {
    for (const Json& field : channel["fields"])
      EXPECT_TRUE(names.contains(field.get<std::string>())) << field;
  }
}

}  // namespace
}  // namespace r4::tool::web
