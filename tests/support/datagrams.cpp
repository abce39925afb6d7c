// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/datagrams.hpp"

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "protocol/datagram/crc32.hpp"

namespace r4::test {
namespace {

std::vector<CapturedLine> read_capture() {
  const std::string path = R4_TEST_DATA "/paper_capture.tsv";
  std::ifstream file(path);
  std::vector<CapturedLine> lines;
  for (std::string line; std::getline(file, line);) {
    const std::size_t tab = line.find('\t');
    if (tab == std::string::npos) throw std::runtime_error(path + ": a line without a tab");
    lines.push_back({line.substr(0, tab) == "board", line.substr(tab + 1)});
  }
  if (lines.empty()) throw std::runtime_error(path + ": not found or empty");
  return lines;
}

}  // namespace

const std::vector<CapturedLine>& paper_capture() {
  static const std::vector<CapturedLine> lines = read_capture();
  return lines;
}

std::string captured_state() { return paper_capture().front().bytes; }

std::string with_crc(std::string_view fields) {
  std::string bytes(fields);
  bytes += '^';
  char hex[16];
  std::snprintf(hex, sizeof hex, "0x%x^", static_cast<unsigned>(crc32_table(bytes)));
  return bytes + hex;
}

std::string str(Text text) { return {text.data(), text.size()}; }

}  // namespace r4::test
