// SPDX-License-Identifier: GPL-3.0-or-later
// A small reader of JSON (RFC 8259), for the reports of write_json(). Does not read escapes \uXXXX
// above 0x7F, because write_json() does not write them.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace r4::commissioning {

class JsonValue {
 public:
  // Throws Error{data} with the line. `name`: of the file.
  static JsonValue read(std::string_view text, const std::string& name);

  // The member of an object, the text, the number or the elements. A value that is absent or of
  // another type reads as empty: {}, "", 0, {}.
  const JsonValue& operator[](const std::string& key) const;
  std::string text() const;
  double number() const;
  const std::vector<JsonValue>& elements() const;

 private:
  class Reader;
  using Object = std::map<std::string, JsonValue>;
  std::variant<std::monostate, bool, double, std::string, std::vector<JsonValue>, Object> value_;
};

}  // namespace r4::commissioning
