// SPDX-License-Identifier: GPL-3.0-or-later
#include "json_person.hpp"

#include <algorithm>
#include <chrono>
#include <optional>

#include "../shell/output.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/error.hpp"

namespace r4::tool {
namespace {

using namespace std::chrono_literals;
using commissioning::Answer;
using commissioning::Question;

constexpr std::size_t longest_line = 4096;
constexpr const char* answers[] = {"yes_no", "number", "choice"};

std::optional<Answer> action_in(const Json& line) {
  const auto action = line.find("action");
  if (action == line.end()) return std::nullopt;
  Answer answer;
  if (*action == "skip") answer.kind = Answer::Kind::skip;
  if (*action == "repeat") answer.kind = Answer::Kind::repeat;
  if (*action == "leave") answer.kind = Answer::Kind::leave;
  return answer.kind == Answer::Kind::given ? std::nullopt : std::optional(answer);
}

std::optional<Answer> answer_in(const Json& line, const Question& question) {
  const auto given = line.find("answer");
  if (given == line.end()) return std::nullopt;
  Answer answer;
  switch (question.kind) {
    case Question::Kind::yes_no:
      if (!given->is_boolean()) return std::nullopt;
      answer.yes = given->get<bool>();
      return answer;
    case Question::Kind::number:
      if (!given->is_number()) return std::nullopt;
      answer.number = given->get<double>();
      return answer;
    case Question::Kind::choice:
      break;
  }
  if (!given->is_string()) return std::nullopt;
  const auto chosen = std::find(question.choices.begin(), question.choices.end(),
                                given->get_ref<const std::string&>());
  if (chosen == question.choices.end()) return std::nullopt;
  answer.choice = static_cast<std::size_t>(chosen - question.choices.begin());
  return answer;
}

void refuse(const Json& line, const std::string& expected) {
  print_line(problem_json({ErrorKind::data, line_of(line), "is not a valid answer", expected}));
}

}  // namespace

Json JsonPerson::next_line(std::chrono::milliseconds timeout) {
  for (;;) {
    const int byte = keyboard_.next(timeout);
    if (byte == Keyboard::nothing) return nullptr;
    if (byte == Keyboard::ended) return {{"action", "leave"}};
    if (byte != '\n') {
      if (line_.size() < longest_line) line_ += static_cast<char>(byte);
      continue;
    }
    Json line = Json::parse(line_, nullptr, false);
    line_.clear();
    if (line.is_object()) return line;
    refuse(text_of(line_), "send one object a line");
  }
}

void JsonPerson::say(std::string_view check, std::string_view text) {
  print_line({{"type", "say"}, {"check", check}, {"text", text}});
}

Answer JsonPerson::ask(const Question& question) {
  key_ = false;
  Json object{{"type", "question"},
              {"check", question.check},
              {"topic", to_text(question.topic)},
              {"text", question.text},
              {"answer", answers[static_cast<std::size_t>(question.kind)]}};
  if (!question.choices.empty()) object["choices"] = question.choices;
  if (!question.unit.empty()) object["unit"] = question.unit;
  print_line(object);
  for (;;) {
    const Json line = next_line(Keyboard::a_while);
    if (line.is_null() || line.contains("key")) continue;  // a late key
    if (const auto action = action_in(line)) return *action;
    if (const auto answer = answer_in(line, question)) return *answer;
    refuse(line, std::string("answer with a value of the kind ") +
                     answers[static_cast<std::size_t>(question.kind)]);
  }
}

Answer JsonPerson::await_key(const commissioning::Movement& movement) {
  key_ = false;
  // A key before the announcement does not count.
  for (Json early = next_line(0ms); !early.is_null(); early = next_line(0ms)) {
    if (const auto action = action_in(early)) return *action;
  }
  print_line({{"type", "movement"},
              {"check", movement.check},
              {"text", movement.text},
              {"command", shown(movement.command)},
              {"milliseconds", movement.most.count()}});
  for (;;) {
    const Json line = next_line(Keyboard::a_while);
    if (line.is_null()) continue;
    if (const auto action = action_in(line)) return *action;
    key_ = line.contains("key") && line["key"] == true;
    if (key_) return {};
    if (!line.contains("key")) refuse(line, R"(send {"key":true} or an action)");
  }
}

bool JsonPerson::holds_key() {
  for (Json line = next_line(0ms); !line.is_null(); line = next_line(0ms)) {
    if (!line.contains("key") || line["key"] != true) key_ = false;
    if (!key_) break;
  }
  return key_;
}

}  // namespace r4::tool
