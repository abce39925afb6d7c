// SPDX-License-Identifier: GPL-3.0-or-later
// Records of an MCAP file (mcap.dev/spec, version 0), and r4's use of them.
// Each board has a topic, /left-arm or /board1, whose messages are its records as JSON, as in
// .jsonl. Topic /r4log holds the lines of the native format that belong to no board. In file order
// the messages contain the whole recording, so the native file can be restored byte by byte.
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

// Opcode and size of a record, in bytes.
constexpr std::size_t record_head = 9;
// Bytes before a message's data.
constexpr std::size_t message_head = 22;

constexpr std::string_view profile = "r4log";
constexpr std::string_view record_schema = "r4.Record";
constexpr std::string_view line_schema = "r4.Line";
// Metadata key of a channel: the path's number; 0 is the channel of lines.
constexpr std::string_view path_key = "path";
// Metadata keys: the board's URL and name, escaped as in the native format.
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

// Reads from the front of a record. After a read beyond the end, values are 0, good() false.
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
