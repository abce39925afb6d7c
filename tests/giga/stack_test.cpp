// SPDX-License-Identifier: GPL-3.0-or-later
// The stacks of the interrupts: the guard notices a full stack. (stack_bounds.py checks their
// sizes.)
#include "bench.hpp"
#include "tests/giga/core/registers.hpp"

extern "C" std::uint32_t __StackLimit[];  // NOLINT
extern "C" std::uint32_t r4_giga_own_stack[1024];

namespace r4::test {
namespace {

// The lowest word of our stack or the core's stack. The handlers' frames grow down to this word.
std::uint32_t* lowest_word(bool own) { return own ? r4_giga_own_stack : __StackLimit; }

class GigaStacks : public testing::TestWithParam<bool> {};

TEST_P(GigaStacks, AFullStackMakesTheBoardSafeWithinAMillisecond) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  const std::uint64_t full_ns = bench.giga.now_ns();
  EXPECT_TRUE(bench.giga.reset_by([&] {
    // The stack is full, but no word below it is overwritten.
    lowest_word(GetParam())[7] = 0x12345678;
    bench.run_ms(20);
  }));
  EXPECT_TRUE(bench.pins().is_safe());
  EXPECT_LE(bench.giga.now_ns() - full_ns, 2000000U) << "1 ms, and the time to reach the chips";

  bench.restart();
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  PlainHost again;
  bench.run_ms(150, again, bench.usb());
  bench.usb()(again.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_TRUE(bench.pins().is_safe()) << "until E:CLEAR";
  EXPECT_TRUE(has_line(bench.report(), "Last boot ended by: a full stack of the interrupts"));
}

TEST_P(GigaStacks, AFullStackMakesAHungBoardSafe) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  EXPECT_TRUE(bench.giga.reset_by([&] {
    lowest_word(GetParam())[0] = 0;
    bench.giga.pass_ms(3);  // the loop does not return
  }));
  EXPECT_TRUE(bench.pins().is_safe());
}

INSTANTIATE_TEST_SUITE_P(Each, GigaStacks, testing::Bool());

TEST(GigaStacksReport, ShowsThePeakUseOfEachStack) {
  GigaBench bench;
  bench.boot();
  r4_giga_own_stack[924] = 0;  // a hundred words used
  __StackLimit[56] = 0;        // two hundred words used
  EXPECT_TRUE(
      has_line(bench.report(), "Interrupt stacks: the core's 800 of 1024, ours 400 of 4096"));
}

}  // namespace
}  // namespace r4::test
