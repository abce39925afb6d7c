// SPDX-License-Identifier: GPL-3.0-or-later
#include "json_value.hpp"

#include <algorithm>
#include <charconv>
#include <utility>

#include "r4link/error.hpp"

namespace r4::commissioning {

class JsonValue::Reader {
 public:
  Reader(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  JsonValue whole() {
    JsonValue value = any(0);
    if (next() != '\0') fail();
    return value;
  }

 private:
  static constexpr int deepest = 16;

  [[noreturn]] void fail() const {
    const auto* const end = text_.data() + std::min(at_, text_.size());
    const auto line = 1 + std::count(text_.data(), end, '\n');
    throw Error(ErrorKind::data, name_ + ":" + std::to_string(line), "this is not JSON",
                "give a file that r4 commission has written");
  }

  // The next character that is not blank; '\0' at the end.
  char next() {
    at_ = std::min(text_.find_first_not_of(" \t\r\n", at_), text_.size());
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char wanted) {
    if (next() != wanted) return false;
    ++at_;
    return true;
  }
  bool take(std::string_view word) {
    if (text_.substr(at_, word.size()) != word) return false;
    at_ += word.size();
    return true;
  }

  JsonValue any(int depth) {
    if (depth > deepest) fail();
    JsonValue value;
    switch (next()) {
      case '{':
        value.value_ = object(depth);
        break;
      case '[':
        value.value_ = array(depth);
        break;
      case '"':
        value.value_ = string();
        break;
      default:
        if (take("true")) {
          value.value_ = true;
        } else if (take("false")) {
          value.value_ = false;
        } else if (!take("null")) {
          value.value_ = read_number();
        }
    }
    return value;
  }

  Object object(int depth) {
    Object members;
    take('{');
    if (take('}')) return members;
    do {
      if (next() != '"') fail();
      std::string key = string();
      if (!take(':')) fail();
      members.insert_or_assign(std::move(key), any(depth + 1));
    } while (take(','));
    if (!take('}')) fail();
    return members;
  }

  std::vector<JsonValue> array(int depth) {
    std::vector<JsonValue> elements;
    take('[');
    if (take(']')) return elements;
    do {
      elements.push_back(any(depth + 1));
    } while (take(','));
    if (!take(']')) fail();
    return elements;
  }

  std::string string() {
    std::string out;
    ++at_;
    while (at_ < text_.size() && text_[at_] != '"') {
      const char c = text_[at_++];
      out += c == '\\' ? escaped() : c;
    }
    if (at_ == text_.size()) fail();
    ++at_;
    return out;
  }

  char escaped() {
    static constexpr std::string_view names = "\"\\/bfnrt";
    static constexpr std::string_view meant = "\"\\/\b\f\n\r\t";
    if (at_ == text_.size()) fail();
    const char name = text_[at_++];
    if (name == 'u') {
      unsigned code = 0;
      const char* const begin = text_.data() + at_;
      const auto [end, error] =
          std::from_chars(begin, begin + std::min<std::size_t>(4, text_.size() - at_), code, 16);
      if (error != std::errc() || end != begin + 4 || code > 0x7F) fail();
      at_ += 4;
      return static_cast<char>(code);
    }
    const std::size_t which = names.find(name);
    if (which == std::string_view::npos) fail();
    return meant[which];
  }

  double read_number() {
    double number = 0;
    const char* const begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), number);
    if (error != std::errc() || end == begin) fail();
    at_ += static_cast<std::size_t>(end - begin);
    return number;
  }

  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0;
};

JsonValue JsonValue::read(std::string_view text, const std::string& name) {
  return Reader(text, name).whole();
}

const JsonValue& JsonValue::operator[](const std::string& key) const {
  static const JsonValue nothing;
  const auto* const object = std::get_if<Object>(&value_);
  if (object == nullptr) return nothing;
  const auto found = object->find(key);
  return found == object->end() ? nothing : found->second;
}

std::string JsonValue::text() const {
  const auto* const text = std::get_if<std::string>(&value_);
  return text == nullptr ? std::string() : *text;
}

double JsonValue::number() const {
  const auto* const number = std::get_if<double>(&value_);
  return number == nullptr ? 0 : *number;
}

const std::vector<JsonValue>& JsonValue::elements() const {
  static const std::vector<JsonValue> none;
  const auto* const elements = std::get_if<std::vector<JsonValue>>(&value_);
  return elements == nullptr ? none : *elements;
}

}  // namespace r4::commissioning
