// SPDX-License-Identifier: GPL-3.0-or-later
// Runs the tests, then provokes each kind of fault. After each reset the program checks the note of
// the fault. The exit status is the number of failures.
#include <cstdint>

#include "board_bench.hpp"
#include "firmware/ports/m7/chip/registers.hpp"
#include "firmware/ports/m7/chip/semihosting.hpp"
#include "firmware/ports/m7/fault.hpp"
#include "firmware/ports/m7/startup.hpp"

namespace {

using namespace r4;
using namespace r4::m7;

// A note that keeps its values over resets.
struct Story {
  std::uint32_t failures;
  std::uint32_t made_safe;
};
__attribute__((section(".kept"))) Story story;

class Spy final : public firmware::Hal {
 public:
  void apply(const firmware::Outputs&) override {}
  void make_safe() override { ++story.made_safe; }
  void sample(firmware::Inputs&) override {}
  void zero(int) override {}
  bool clear_fault() override { return true; }
};

// `depth` makes each call different, so that the compiler does not remove the recursion.
__attribute__((noinline)) std::uint32_t overflow(std::uint32_t depth) {
  volatile std::uint32_t room[64];
  room[depth % 64] = depth;
  return depth == 0 ? 0 : overflow(depth + 1) + room[(depth + 1) % 64];
}

// Simulates handlers that fill their stack to its last word. The interrupt of the guard checks the
// word.
void fill_handler_stack() {
  Bench& board = new_board();
  *r4_handler_stack = 0;
  static_cast<void>(board.board().on_wake());
}

void expect(bool condition, const char* what) {
  say(condition ? "passed " : "FAILED ");
  say(what);
  say("\n");
  if (!condition) ++story.failures;
}

}  // namespace

int main() {
  static Spy spy;
  guard(spy);
  const FaultNote note = take_note();
  const bool safe_once = story.made_safe == boots() - 1;
  constexpr std::uint32_t hard_fault = 3;
  constexpr std::uint32_t memory_fault = 4;
  constexpr std::uint32_t bus_fault = 5;
  constexpr std::uint32_t usage_fault = 6;
  constexpr std::uint32_t nothing = 0xFFFFFFA0;
  constexpr std::uint32_t code = 0x2000;  // an address in the code
  switch (boots()) {
    case 1:
      story.failures = on_target::Test::run_all();
      on_target::say_number("stack of the tests", used_at_most(r4_stack, r4_stack_end));
      on_target::say_number("stack of the handlers",
                            used_at_most(r4_handler_stack, r4_handler_stack_end));
      story.made_safe = 0;
      expect(note.kind == FaultNote::Kind::none && canary_alive(), "Fault.NoneAtPowerUp");
      asm volatile("udf #0");
      break;
    case 2:
      expect(note.kind == FaultNote::Kind::fault && note.exception == usage_fault && note.pc != 0 &&
                 safe_once,
             "Fault.AnUndefinedInstructionSwitchesOffAndIsNoted");
      expect(overflow(1) != 0, "unreachable");
      break;
    case 3:
      expect(note.kind == FaultNote::Kind::fault &&
                 (note.exception == hard_fault || note.exception == memory_fault) && safe_once,
             "Fault.AStackOverflowSwitchesOffAndIsNoted");
      at(nothing) = 1;
      break;
    case 4:
      expect(note.kind == FaultNote::Kind::fault && note.exception == bus_fault &&
                 note.address == nothing && safe_once,
             "Fault.AnAddressWithNothingSwitchesOffAndIsNoted");
      at(code) = 1;
      break;
    case 5:
      expect(note.kind == FaultNote::Kind::fault && note.exception == memory_fault &&
                 note.address == code && safe_once,
             "Fault.WritingCodeSwitchesOffAndIsNoted");
      start_watchdog(10);
      for (;;) {
      }
    case 6:
      expect(note.kind == FaultNote::Kind::watchdog && note.pc != 0 && safe_once,
             "Fault.ALoopThatHangsSwitchesOffAndIsNoted");
      halt();
    case 7:
      expect(note.kind == FaultNote::Kind::fault && note.exception == 0 && safe_once,
             "Fault.HaltSwitchesOffAndIsNoted");
      fill_handler_stack();
      break;
    default:
      expect(note.kind == FaultNote::Kind::fault && note.exception == 0 && safe_once,
             "Fault.AFullStackOfTheHandlersSwitchesOffAndIsNotedWhileTheLoopHangs");
      exit_emulator(story.failures);
  }
  exit_emulator(100);
}
