// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/r4/formats/csv.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "converted.hpp"

namespace r4::test {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string one_state(const std::string& fields) {
  std::string native;
  write_record_header(native);
  write_path(native, {1, "udp://robot", ""});
  write_record(native, {Time{1795468293000001}, 1, RecordKind::from_board, with_crc(fields)});
  write_path(native, {1, "udp://robot", "left-arm"});
  return native;
}

TEST(Csv, HasARowForEachStateAndAColumnForEachValue) {
  const Converted csv = converted(recorded_capture(), ".r4log", ".csv");
  const std::vector<std::string> lines = lines_of(csv.bytes);
  EXPECT_EQ(
      lines[0],
      "time [s],path,board,PNum,T [ms],AIN24 [V],AIN12 [V],AIN5 [V],AINDMH [V],DMHSTA [0/1/2],"
      "AINSTEER [V],DHB1A pwm [0-4095],DHB1A direction [0/1],OSMC1 pwm [0-4095],"
      "OSMC1 direction [0/1],STEP1POS [steps],SERVO1POS [us]");
  EXPECT_EQ(lines[1],
            "1795468293.414765,1,left-arm,7434,79090,24.28,12.12,5.12,12.11,1,1.03,4095,1,400,1,"
            "-100,2000");
  // Damaged datagrams and datagrams that are not states are counted.
  const auto states = lines.size() - 1;
  EXPECT_EQ(csv.left_out,
            std::to_string(paper_capture().size() + 2 - states) + " records that are not states");
  EXPECT_GT(states, 50);
  for (const std::string& line : lines) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 16) << line;
  }
}

TEST(Csv, HasTheRecordedFieldsAndAnEmptyCellForAMissingOne) {
  const std::string native = one_state("ENC1:-5;BLDC1:1,0,1;PNum:1;T:2;");
  std::string two = native;
  write_record(two, {Time{1795468293000002}, 1, RecordKind::from_board,
                     with_crc("US2:30;NEWFIELD:1;PNum:2;T:3;")});
  const std::vector<std::string> lines = lines_of(converted(two, ".r4log", ".csv").bytes);
  ASSERT_EQ(lines.size(), 3);
  EXPECT_EQ(lines[0],
            "time [s],path,board,PNum,T [ms],ENC1 [counts],US2 [cm],BLDC1 speed [0-4095],"
            "BLDC1 direction [0/1],BLDC1 brake [0/1]");
  EXPECT_EQ(lines[1], "1795468293.000001,1,left-arm,1,2,-5,,1,0,1");
  EXPECT_EQ(lines[2], "1795468293.000002,1,left-arm,2,3,,30,,,");
}

TEST(Csv, HasNoCellThatASpreadsheetReadsAsAFormula) {
  const struct {
    std::string url, cell;
  } cases[] = {
      {"=1+cmd|calc!A0", "'=1+cmd|calc!A0"},
      {"@SUM(1+1)", "'@SUM(1+1)"},
      {"+1", "'+1"},
      {"-1", "'-1"},
      {"\t=1", "\\x09=1"},
      {"\r=1", "\\x0d=1"},
      {" =1", " '=1"},
      {"x;=1", "x;'=1"},
      {"x,=1", "\"x,'=1\""},
      {"\"=1", "\"\"\"'=1\""},
      {"udp://robot?listen=-1", "udp://robot?listen=-1"},
  };
  for (const auto& c : cases) {
    std::string native;
    write_record_header(native);
    write_path(native, {1, c.url, ""});
    write_record(native, {Time{1795468293000001}, 1, RecordKind::from_board,
                          with_crc("STEP1POS:-100;PNum:1;T:2;")});
    const auto lines = lines_of(converted(native, ".r4log", ".csv").bytes);
    ASSERT_EQ(lines.size(), 2);
    EXPECT_EQ(lines[1], "1795468293.000001,1," + c.cell + ",1,2,-100");
  }
}

TEST(Csv, HasNoRowForAStateWithAnInvalidNumber) {
  // The checksum is right, but the column must contain only numbers.
  const Converted csv = converted(one_state("AIN24:abc;PNum:1;T:2;"), ".r4log", ".csv");
  EXPECT_EQ(lines_of(csv.bytes).size(), 1);
  EXPECT_EQ(csv.left_out, "1 records that are not states");
}

TEST(Csv, HasTheReadingsOfDescribedDevices) {
  const std::string recording = one_state("I2C3:1000,0,x07d0;I2C4:1002,0,x5d98;PNum:1;T:1010;") +
                                one_state("I2C3:0,0,x;PNum:2;T:1020;");
  const Converted csv =
      converted(recording, ".r4log", ".csv", 1000, {Device::from("ina219@0x40:3")});
  const auto lines = lines_of(csv.bytes);
  ASSERT_EQ(lines.size(), 3);
  EXPECT_TRUE(lines[0].ends_with(",ina219@0x40 voltage [V],ina219@0x40 current [A]")) << lines[0];
  EXPECT_TRUE(lines[1].ends_with(",x5d98,11.98,0.2")) << lines[1];
  EXPECT_TRUE(lines[2].ends_with(",,")) << lines[2] << ": the device was not read yet";
  const Converted json =
      converted(recording, ".r4log", ".jsonl", 1000, {Device::from("ina219@0x40:3")});
  EXPECT_NE(json.bytes.find(R"("devices":{"ina219@0x40":{"voltage":11.98,"current":0.2)"),
            std::string::npos)
      << json.bytes;
  EXPECT_THROW(converted(recording, ".r4log", ".pcapng", 1000, {Device::from("ina219@0x40:3")}),
               Error);
}

void add_state(std::string& all, std::uint16_t path, const std::string& fields) {
  write_record(all, {Time{1795468293000000 + path}, path, RecordKind::from_board,
                     with_crc(fields + "PNum:1;T:1010;")});
}

// Path 1 and path 2 have devices in different slots.
std::string recording_of_two_with_devices() {
  std::string all = "# r4log 1 by r4 0.1.0\n# path 1 udp://a\n# path 2 udp://b\n";
  write_device(all, {1, "ina219@0x40:3", std::string(DeviceDescription::text_of("ina219"))});
  write_device(all, {2, "ina219@0x40:1", std::string(DeviceDescription::text_of("ina219"))});
  write_device(all, {2, "odd@0x40:5", "no description"});
  add_state(all, 1, "I2C3:1000,0,x07d0;I2C4:1002,0,x5d98;");
  add_state(all, 2, "I2C1:1000,0,x07d0;I2C2:1002,0,x5da0;");
  add_state(all, 2, "I2C3:1000,0,x07d0;I2C4:1002,0,x5d98;");
  return all;
}

TEST(Csv, HasTheRecordedDevicesOfEachPath) {
  const std::string recording = recording_of_two_with_devices();
  const Converted csv = converted(recording, ".r4log", ".csv");
  const auto lines = lines_of(csv.bytes);
  ASSERT_EQ(lines.size(), 4);
  EXPECT_TRUE(lines[0].ends_with(" bytes [hex],ina219@0x40 voltage [V],ina219@0x40 current [A]"))
      << lines[0];
  EXPECT_TRUE(lines[1].ends_with(",11.98,0.2")) << lines[1];
  EXPECT_TRUE(lines[2].ends_with(",11.984,0.2")) << lines[2];
  EXPECT_TRUE(lines[3].ends_with(",x5d98,,"))
      << lines[3] << ": these slots belong to the other board";
  EXPECT_TRUE(csv.left_out.find("odd@0x40:5, line 1") != std::string::npos) << csv.left_out;
  // Devices named on the command line replace the recorded devices on every path.
  const Converted named =
      converted(recording, ".r4log", ".csv", 1000, {Device::from("ina219@0x40:3")});
  EXPECT_TRUE(lines_of(named.bytes)[2].ends_with(",,,,"));
  EXPECT_TRUE(lines_of(named.bytes)[3].ends_with(",11.98,0.2"));
}

TEST(Csv, DevicesDoNotApplyToTheNextRecordingInTheFile) {
  const std::string two = recording_of_two_with_devices() +
                          "# r4log 1 by r4 0.1.0\n# path 1 udp://c\n" +
                          one_state("I2C3:1000,0,x07d0;I2C4:1002,0,x5d98;PNum:1;T:1010;");
  const auto lines = lines_of(converted(two, ".r4log", ".csv").bytes);
  EXPECT_TRUE(lines[1].ends_with(",11.98,0.2"));
  EXPECT_TRUE(lines.back().ends_with(",x5d98,,")) << lines.back();
}

TEST(Csv, ConditionsOfADeviceUseItsOwnPath) {
  std::string all = "# r4log 1 by r4 0.1.0\n# path 1 udp://a\n# path 2 udp://b\n";
  for (const std::uint16_t path : {std::uint16_t{1}, std::uint16_t{2}}) {
    write_device(all, {path, "as5600@0x36:1", std::string(DeviceDescription::text_of("as5600"))});
  }
  add_state(all, 1, "I2C2:1000,0,x20;");    // the magnet is detected
  add_state(all, 2, "I2C1:1000,0,x0400;");  // the status of this magnet has not been read yet
  const auto lines = lines_of(converted(all, ".r4log", ".csv").bytes);
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_NE(lines[2].find("x0400,"), std::string::npos) << lines[2];
  EXPECT_EQ(lines[2].find("1.57"), std::string::npos) << lines[2];
  EXPECT_EQ(converted(all, ".r4log", ".jsonl").bytes.find("1.57"), std::string::npos);
}

TEST(Csv, ReportsADeviceDeclaredTooLateForAColumn) {
  StringOutput output;
  const auto sink = tool::make_sink("test.csv", output, {});
  tool::Conversion conversion(*sink, [](const RecordingDamage&) {});
  std::string all = one_state("I2C3:1000,0,x07d0;I2C4:1002,0,x5d98;PNum:1;T:1010;");
  write_device(all, {1, "ina219@0x40:3", std::string(DeviceDescription::text_of("ina219"))});
  const auto source = tool::make_source("test.r4log", conversion);  // not surveyed, like a pipe
  source->feed(all);
  source->finish();
  conversion.finish();
  EXPECT_NE(sink->left_out().find("measurements of ina219@0x40"), std::string::npos)
      << sink->left_out();
}

TEST(Csv, OtherFormatsKeepTheDevicesOfARecording) {
  const std::string recording = recording_of_two_with_devices();
  const char* const measured = R"("devices":{"ina219@0x40":{"voltage":11.984,"current":0.2)";
  EXPECT_NE(converted(recording, ".r4log", ".jsonl").bytes.find(measured), std::string::npos);
  for (const char* const by : {".pcapng", ".mcap", ".r4log.zst"}) {
    const std::string there = converted(recording, ".r4log", by).bytes;
    EXPECT_EQ(converted(there, by, ".r4log").bytes, recording) << by;
    EXPECT_NE(converted(there, by, ".jsonl").bytes.find(measured), std::string::npos) << by;
  }
}

TEST(Csv, HasEveryColumnIfTheInputCannotBeReadTwice) {
  StringOutput output;
  tool::CsvSink sink(output);
  sink.on_record({Time{1}, 1, RecordKind::event, "up"});
  EXPECT_EQ(std::count(output.bytes.begin(), output.bytes.end(), ','), 4 + 82);
}

}  // namespace
}  // namespace r4::test
