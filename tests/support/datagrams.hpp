// SPDX-License-Identifier: GPL-3.0-or-later
// Datagrams for tests: the paper's capture, and any fields with the right checksum.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "r4link/text.hpp"

namespace r4::test {

// A line of tests/data/paper_capture.tsv.
struct CapturedLine {
  bool from_board;
  std::string bytes;
};
const std::vector<CapturedLine>& paper_capture();

// The first line of the capture, a state of 156 bytes.
std::string captured_state();

// `fields`, followed by "^0x<crc>^". The fields are not checked.
std::string with_crc(std::string_view fields);

std::string str(Text text);

}  // namespace r4::test
