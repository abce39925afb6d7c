// SPDX-License-Identifier: GPL-3.0-or-later
// Properties of every datagram. A failure prints RC_PARAMS with its seed. To repeat the failure,
// set the same RC_PARAMS in the environment.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "tests/support/datagrams.hpp"

namespace r4 {
namespace {

using test::paper_capture;
using test::str;
using test::with_crc;

struct Content {
  std::vector<std::pair<std::string, std::string>> fields;
  std::optional<std::uint32_t> pnum;
  std::optional<std::uint64_t> time_ms;
  bool operator==(const Content&) const = default;
};

Content content_of(const Datagram& datagram) {
  Content content;
  for (const Field& field : datagram) {
    content.fields.emplace_back(str(field.name()), str(field.values()));
  }
  if (datagram.has_pnum()) content.pnum = datagram.pnum();
  if (datagram.has_time()) content.time_ms = datagram.time_ms();
  return content;
}

std::optional<Content> read_content(const std::string& bytes) {
  Datagram datagram;
  if (!read_datagram(bytes, datagram)) return std::nullopt;
  return content_of(datagram);
}

std::string bytes_but(char first, char last, const std::string& except) {
  std::string bytes;
  for (char c = first; c <= last; ++c) {
    if (except.find(c) == std::string::npos) bytes += c;
  }
  return bytes;
}

rc::Gen<std::string> text_of(const std::string& alphabet, int min_size, int max_size) {
  return rc::gen::mapcat(rc::gen::inRange(min_size, max_size + 1), [=](int size) {
    return rc::gen::container<std::string>(static_cast<std::size_t>(size),
                                           rc::gen::elementOf(alphabet));
  });
}

rc::Gen<std::string> any_name() {
  static const std::string alphabet = bytes_but('!', '~', ":;,^");
  return rc::gen::suchThat(text_of(alphabet, 1, 12),
                           [](const std::string& name) { return name != "PNum" && name != "T"; });
}

rc::Gen<std::string> any_values() {
  static const std::string alphabet = bytes_but(' ', '~', ";^") + ",,,,,,,,";
  return text_of(alphabet, 0, 30);
}

// Any content. PNum and T are at any place or missing.
rc::Gen<Content> any_content() {
  return rc::gen::exec([] {
    Content content;
    content.fields = *rc::gen::container<std::vector<std::pair<std::string, std::string>>>(
        static_cast<std::size_t>(*rc::gen::inRange(1, 40)),
        rc::gen::pair(any_name(), any_values()));
    const auto insert = [&](const char* name, const std::string& value) {
      const int at = *rc::gen::inRange(0, static_cast<int>(content.fields.size()) + 1);
      content.fields.insert(content.fields.begin() + at, {name, value});
    };
    if (*rc::gen::arbitrary<bool>()) {
      content.pnum = *rc::gen::arbitrary<std::uint32_t>();
      insert("PNum", std::to_string(*content.pnum));
    }
    if (*rc::gen::arbitrary<bool>()) {
      content.time_ms = *rc::gen::arbitrary<std::uint64_t>();
      insert("T", std::to_string(*content.time_ms));
    }
    // A test may lengthen PAD until the datagram is about as long as the limit.
    if (*rc::gen::arbitrary<bool>()) content.fields.emplace_back("PAD", "");
    return content;
  });
}

std::string text_of(const Content& content) {
  std::string text;
  for (const auto& [name, values] : content.fields) text += name + ':' + values + ';';
  return text;
}

std::string write(const Content& content) {
  char buffer[2 * max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  for (const auto& [name, values] : content.fields) writer.field(name).values(values);
  return str(writer.finish());
}

rc::Gen<std::string> any_datagram() {
  return rc::gen::map(any_content(), [](Content content) {
    while (with_crc(text_of(content)).size() > max_datagram) content.fields.pop_back();
    return with_crc(text_of(content));
  });
}

RC_GTEST_PROP(DatagramProperty, AnyContentRoundTripsAndWhatIsTooLongIsRefused, ()) {
  Content content = *any_content();
  if (content.fields.back().first == "PAD") {
    const std::size_t size = with_crc(text_of(content)).size();
    const auto wanted = static_cast<std::size_t>(*rc::gen::inRange(1015, 1034));
    if (wanted > size) content.fields.back().second.assign(wanted - size, 'p');
  }
  const std::string expected = with_crc(text_of(content));
  const std::string bytes = write(content);
  if (expected.size() > max_datagram) {
    RC_ASSERT(bytes.empty());
    RC_ASSERT(!read_content(expected));
    return;
  }
  RC_ASSERT(bytes == expected);
  RC_ASSERT(read_content(bytes) == content);
  RC_ASSERT(read_content(bytes + "\r\n") == content);
}

RC_GTEST_PROP(DatagramProperty, PacketNumberAndTimeOfTheWriterAreRead,
              (std::uint32_t pnum, std::uint64_t time_ms)) {
  char buffer[max_datagram];
  DatagramWriter writer(buffer, sizeof buffer);
  writer.field("A").value(1);
  const auto content = read_content(str(writer.finish(pnum, time_ms)));
  RC_ASSERT(content.has_value());
  RC_ASSERT(content->pnum == pnum);
  RC_ASSERT(content->time_ms == time_ms);
}

ReadResult result_of(const std::string& bytes) {
  Datagram datagram;
  return read_datagram(bytes, datagram);
}

// True if there is a field PNum or T.
bool mentions_numbers(const std::string& fields) {
  const std::string text = ';' + fields;
  return text.find(";PNum:") != std::string::npos || text.find(";T:") != std::string::npos;
}

// A second, slow implementation of the grammar.
bool is_datagram(const std::string& bytes) {
  static const std::regex grammar(
      "([!-+\\--9<-\\]_-~]+:[ -:<-\\]_-~]*;)+\\^0x[0-9a-fA-F]{1,8}\\^\r?\n?",
      std::regex::ECMAScript | std::regex::optimize);
  return std::regex_match(bytes, grammar);
}

RC_GTEST_PROP(DatagramProperty, AcceptedIsWhatTheGrammarSays, ()) {
  static const std::string alphabet = "AB1::;;;, ^\n\r\x7F";
  const std::string bytes = with_crc(*text_of(alphabet, 0, 12));
  RC_ASSERT(read_content(bytes).has_value() == is_datagram(bytes));
}

// Long datagrams: fields of all lengths, and any byte at any place.
RC_GTEST_PROP(DatagramProperty, AcceptedIsWhatTheGrammarSaysOfLongDatagramsToo, ()) {
  static const std::string alphabet = ":;, ^xT\n\x7F\x80";
  const std::string good = *any_datagram();
  std::string fields = good.substr(0, good.find('^'));
  const int bytes = *rc::gen::inRange(0, 4);
  for (int i = 0; i < bytes && !fields.empty(); ++i) {
    const auto at = static_cast<std::size_t>(*rc::gen::inRange(0, static_cast<int>(fields.size())));
    fields[at] = *rc::gen::elementOf(alphabet);
  }
  const std::string damaged = with_crc(fields);
  const auto content = read_content(damaged);
  // The grammar does not require that PNum and T are numbers and occur once.
  const bool numbers_wrong =
      !content && result_of(damaged).position < fields.size() && mentions_numbers(fields);
  RC_ASSERT(content.has_value() == is_datagram(damaged) || numbers_wrong);
}

RC_GTEST_PROP(DatagramProperty, AnySingleByteOfDamageIsRefusedOrChangesNothing, ()) {
  const std::string good = *any_datagram();
  const auto content = read_content(good);
  RC_ASSERT(content.has_value());
  const auto at = static_cast<std::size_t>(*rc::gen::inRange(0, static_cast<int>(good.size())));
  const char byte = *rc::gen::arbitrary<char>();
  std::string changed = good;
  changed[at] = byte;
  std::string dropped = good;
  dropped.erase(at, 1);
  std::string doubled = good;
  doubled.insert(at, 1, good[at]);
  std::string inserted = good;
  inserted.insert(at, 1, byte);
  for (const std::string& damaged : {changed, dropped, doubled, inserted, good + byte}) {
    const auto got = read_content(damaged);
    RC_ASSERT(!got || got == content);
  }
}

// Damages the capture: every byte at every place.
TEST(DatagramProperty, ADamagedByteIsRefusedOrChangesNothing) {
  std::size_t same = 0;
  for (const std::size_t line : {0U, 6U, 12U, 15U, 19U}) {  // state, commands, heartbeats
    const std::string good = paper_capture()[line].bytes;
    const auto content = read_content(good);
    ASSERT_TRUE(content);
    const auto judge = [&](const std::string& damaged) {
      const auto got = read_content(damaged);
      if (got) {
        ++same;
        ASSERT_EQ(*got, *content) << damaged;
      }
    };
    for (std::size_t at = 0; at <= good.size(); ++at) {
      for (int byte = 0; byte < 256; ++byte) {
        std::string damaged = good;
        damaged.insert(at, 1, static_cast<char>(byte));
        judge(damaged);
        if (at == good.size()) continue;
        damaged = good;
        damaged[at] = static_cast<char>(byte);
        judge(damaged);
      }
      if (at == good.size()) continue;
      std::string damaged = good;
      damaged.erase(at, 1);
      judge(damaged);
    }
  }
  EXPECT_GT(same, 5U) << "harmless: the same byte, a capital digit, a leading zero, a terminator";
}

}  // namespace
}  // namespace r4
