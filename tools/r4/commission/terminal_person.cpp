// SPDX-License-Identifier: GPL-3.0-or-later
#include "terminal_person.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstddef>
#include <optional>

#include "../shell/number.hpp"
#include "../shell/output.hpp"

namespace r4::tool {
namespace {

using namespace std::chrono_literals;
using commissioning::Answer;
using commissioning::Question;

constexpr auto repeat_within = 150ms;     // longest time between two repeats
constexpr auto first_repeat_within = 1s;  // longest time after the key was pressed

std::optional<Answer> action_of(int key) {
  Answer answer;
  switch (key) {
    case 's':
      answer.kind = Answer::Kind::skip;
      return answer;
    case 'r':
      answer.kind = Answer::Kind::repeat;
      return answer;
    case 'q':
    case Keyboard::ended:
      answer.kind = Answer::Kind::leave;
      return answer;
    default:
      return std::nullopt;
  }
}

std::optional<Answer> read_line(const Question& question, const std::string& line) {
  Answer answer;
  if (question.kind == Question::Kind::choice) {
    const auto number = number_in<std::size_t>(line);
    if (!number || *number < 1 || *number > question.choices.size()) return std::nullopt;
    answer.choice = *number - 1;
    return answer;
  }
  const auto number = line.starts_with("0x") ? number_in<int>(line.substr(2), 16) : std::nullopt;
  if (number) {
    answer.number = *number;
    return answer;
  }
  double value = 0;
  const char* const end = line.data() + line.size();
  const auto [rest, error] = std::from_chars(line.data(), end, value);
  if (error != std::errc() || rest != end) return std::nullopt;
  answer.number = value;
  return answer;
}

std::string prompt_of(const Question& question) {
  switch (question.kind) {
    case Question::Kind::yes_no:
      return "  y yes, n no, s skip, r repeat, q leave: ";
    case Question::Kind::number:
      return fmt::format("  type a number ({}) and Enter; s skip, r repeat, q leave: ",
                         question.unit);
    case Question::Kind::choice:
      break;
  }
  std::string list;
  for (std::size_t i = 0; i < question.choices.size(); ++i) {
    list += fmt::format("{}{} {}", i == 0 ? "  " : ", ", i + 1, question.choices[i]);
  }
  return list + "\n  type the number and Enter; s skip, r repeat, q leave: ";
}

}  // namespace

void TerminalPerson::say(std::string_view check, std::string_view text) {
  print_text("\n{}: {}\n", check, text);
}

Answer TerminalPerson::ask(const Question& question) {
  keyboard_.forget();
  print_text("{}\n{}", question.text, prompt_of(question));
  std::string line;
  for (;;) {
    const int key = keyboard_.next(Keyboard::a_while);
    if (line.empty() || key == Keyboard::ended) {
      const auto action = action_of(key);
      if (action || (question.kind == Question::Kind::yes_no && (key == 'y' || key == 'n'))) {
        print_text("{}\n", key > 0 ? std::string(1, static_cast<char>(key)) : "left");
        Answer answer = action.value_or(Answer{});
        answer.yes = key == 'y';
        return answer;
      }
    }
    if (key == Keyboard::nothing || question.kind == Question::Kind::yes_no) continue;
    if (key == '\n' || key == '\r') {
      print_text("\n");
      if (const auto answer = read_line(question, line)) return *answer;
      if (!line.empty()) print_text("  '{}' is not a valid answer: ", line);
      line.clear();
    } else if (key == '\b' || key == 0x7F) {
      if (!line.empty()) line.pop_back();
      print_raw("\b \b");
    } else if (key > ' ' && key < 0x7F && line.size() < 20) {
      line += static_cast<char>(key);
      print_text("{}", static_cast<char>(key));
    }
  }
}

Answer TerminalPerson::await_key(const commissioning::Movement& movement) {
  // A key held since the last movement must be released first.
  while (keyboard_.next(repeat_within) == ' ') {
  }
  keyboard_.forget();
  print_text("{}\n  HOLD the space bar to start, release it to stop; s skip, r repeat, q leave: ",
             movement.text);
  Clock::time_point pressed{};
  for (;;) {
    const int key = keyboard_.next(Keyboard::a_while);
    if (const auto action = action_of(key)) {
      print_text("\n");
      return *action;
    }
    const auto now = Clock::now();
    if (key == ' ' && now - pressed < first_repeat_within) {
      repeated_ = now;
      print_text("\n");
      return {};
    }
    pressed = key == ' ' ? now : Clock::time_point{};
  }
}

bool TerminalPerson::holds_key() {
  for (int key = keyboard_.next(0ms); key != Keyboard::nothing; key = keyboard_.next(0ms)) {
    repeated_ = key == ' ' ? Clock::now() : Clock::time_point{};
    if (key == Keyboard::ended) break;
  }
  return Clock::now() - repeated_ < repeat_within;
}

}  // namespace r4::tool
