// SPDX-License-Identifier: GPL-3.0-or-later
#include "on_target.hpp"

#include "firmware/ports/m7/chip/semihosting.hpp"
#include "protocol/datagram/numbers.hpp"

namespace r4 {
namespace on_target {

namespace {

Test* first = nullptr;
std::uint32_t failures_here = 0;

}  // namespace

Test::Test(const char* name, void (*body)()) : name_(name), body_(body), next_(first) {
  first = this;
}

std::uint32_t Test::run_all() {
  std::uint32_t bad = 0;
  for (Test* each = first; each != nullptr; each = each->next_) {
    failures_here = 0;
    each->body_();
    m7::say(failures_here == 0 ? "passed " : "FAILED ");
    m7::say(each->name_);
    m7::say("\n");
    if (failures_here != 0) ++bad;
  }
  return bad;
}

void failed(const char* what, const char* file, std::uint32_t line) {
  ++failures_here;
  m7::say(file);
  say_number("", line);
  m7::say("  is not so: ");
  m7::say(what);
  m7::say("\n");
}

void say_number(const char* what, std::uint32_t number) {
  m7::say(what);
  char digits[max_number_text + 1];
  *write_number(digits, number) = '\0';
  m7::say(": ");
  m7::say(digits);
  m7::say("\n");
}

}  // namespace on_target
}  // namespace r4
