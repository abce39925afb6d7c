// SPDX-License-Identifier: GPL-3.0-or-later
// The records of an MCAP file (mcap.dev/spec, version 0), and what r4 puts into them.
//
// A recording is a topic a board, /left-arm or /board1, whose messages are its records as JSON, as .jsonl has them; and
// the topic /r4log, whose messages are those lines of the native format that belong to no board. In their order in the
// file these are all of the recording: it can be had back byte by byte.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "../byte_order.hpp"

namespace r4::tool::mcap {

constexpr std::string_view magic{"\x89MCAP0\r\n", 8};

enum class Op : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0B,
  data_end = 0x0F,
  summary_offset = 0x0E,
};

// A record's opcode and size.
constexpr std::size_t record_head = 9;
// In front of a message's data.
constexpr std::size_t message_head = 22;

// The file's profile.
constexpr std::string_view profile = "r4log";
constexpr std::string_view record_schema = "r4.Record";
constexpr std::string_view line_schema = "r4.Line";
// The key of a channel's metadata that has the number of its path; 0: it is that of lines.
constexpr std::string_view path_key = "path";
// And how its board is reached and is called, escaped as in the native format.
constexpr std::string_view url_key = "url";
constexpr std::string_view name_key = "name";

inline void append_string(std::string& out, std::string_view text) {
  append_number(out, static_cast<std::uint32_t>(text.size()));
  out += text;
}

inline void append_record(std::string& out, Op op, std::string_view content) {
  append_number(out, static_cast<std::uint8_t>(op));
  append_number(out, std::uint64_t{content.size()});
  out += content;
}

// Takes numbers and strings off the front of a record's content; what is not there reads 0 and is told by good().
class Fields {
 public:
  explicit Fields(std::string_view bytes) : rest_(bytes) {}
  template <class Number>
  Number number() {
    if (rest_.size() < sizeof(Number)) return fail(), Number{};
    const auto value = read_number<Number>(rest_);
    rest_.remove_prefix(sizeof(Number));
    return value;
  }
  std::string_view string() { return take(number<std::uint32_t>()); }
  std::string_view take(std::uint64_t size) {
    if (rest_.size() < size) return fail(), std::string_view();
    const std::string_view bytes = rest_.substr(0, static_cast<std::size_t>(size));
    rest_.remove_prefix(bytes.size());
    return bytes;
  }
  std::string_view rest() const { return rest_; }
  bool good() const { return good_; }

 private:
  void fail() {
    good_ = false;
    rest_ = {};
  }
  std::string_view rest_;
  bool good_ = true;
};

}  // namespace r4::tool::mcap
