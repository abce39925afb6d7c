// SPDX-License-Identifier: GPL-3.0-or-later
// Runs tests on the processor itself. A test looks like a test of gtest:
//
//     TEST(Crc32, IsThatOfThePaper) { EXPECT(crc32("123456789") == 0xCBF43926); }
#pragma once

#include <cstdint>

namespace r4 {
namespace on_target {

class Test {
 public:
  Test(const char* name, void (*body)());
  // Runs all tests. Returns the number of failed tests.
  static std::uint32_t run_all();

 private:
  const char* name_;
  void (*body_)();
  Test* next_;
};

// Prints the failed condition and marks the running test as failed.
void failed(const char* what, const char* file, std::uint32_t line);
void say_number(const char* what, std::uint32_t number);

}  // namespace on_target
}  // namespace r4

#define EXPECT(condition) \
  ((condition) ? static_cast<void>(0) : r4::on_target::failed(#condition, __FILE__, __LINE__))

#define TEST(subject, behaviour)                                                   \
  static void subject##_##behaviour();                                             \
  static r4::on_target::Test test_##subject##_##behaviour(#subject "." #behaviour, \
                                                          subject##_##behaviour);  \
  static void subject##_##behaviour()
