// SPDX-License-Identifier: GPL-3.0-or-later
// How the firmware reacts to faults of its own, of its hardware and of its supply, and which data
// it keeps.
#include "bench.hpp"
#include "firmware/ports/giga/pins.hpp"
#include "tests/giga/core/registers.hpp"

namespace r4::test {
namespace {

TEST(GigaWatchdog, IsFedByTheGuardAsLongAsTheLoopTurns) {
  GigaBench bench;
  bench.boot();
  const int feeds = bench.giga.watchdog_feeds;
  bench.run_ms(1000);
  EXPECT_GT(bench.giga.watchdog_feeds - feeds, 300);
}

// `turn` advances the time by 1 ms on a board that fails in one of its duties.
template <class Turn>
void expect_safe_soon_and_reset(GigaBench& bench, Turn turn) {
  std::uint64_t safe_after_ms = 0;
  const std::uint64_t failed_ms = bench.giga.now_ms();
  EXPECT_TRUE(bench.giga.reset_by([&] {
    for (int turns = 0; turns < 5000; ++turns) {
      turn();
      if (safe_after_ms == 0 && bench.pins().is_safe()) {
        safe_after_ms = bench.giga.now_ms() - failed_ms;
      }
    }
  }));
  EXPECT_GT(safe_after_ms, 0U);
  EXPECT_LE(safe_after_ms, 125U) << "five deadlines of 20 ms";
  EXPECT_LE(bench.giga.now_ms() - failed_ms, 450U);
}

TEST(GigaWatchdog, AHungLoopGoesSafeAndResetsTheBoard) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  expect_safe_soon_and_reset(bench, [&] { bench.giga.pass_ms(1); });  // only the timers run

  bench.system.reset();
  bench.giga.connect_registers();
  bench.boot();
  PlainHost again;
  bench.run_ms(150, again, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::watchdog);
  bench.usb()(again.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_TRUE(bench.pins().is_safe());
  bench.run_ms(1100, again, bench.usb());
  bench.usb()(again.command("E:CLEAR"));
  bench.usb()(again.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
}

TEST(GigaWatchdog, ADeadStepTimerMakesTheBoardSafeAndResetsIt) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.step_timer.period_ns = 0;
  expect_safe_soon_and_reset(bench, [&] { bench.turn(); });

  bench.restart();
  PlainHost again;
  bench.run_ms(150, again, bench.usb());
  EXPECT_EQ(bench.reason(), SafeReason::watchdog);
  bench.run_ms(1100, again, bench.usb());
  bench.usb()(again.command("E:CLEAR"));
  bench.usb()(again.command("P:20,1000,1"));
  bench.run_ms(100, again, bench.usb());
  EXPECT_EQ(bench.giga.rises('A', 3), 20) << "the timer runs again";
}

TEST(GigaWatchdog, TheReportCountsMissedDeadlinesOfTheLoop) {
  GigaBench bench;
  bench.boot();
  bench.run_ms(20);
  bench.giga.pass_ms(50);  // without a turn of the loop
  bench.run_ms(20);
  EXPECT_TRUE(has_line(bench.report(), "Deadlines missed: 2"));
  EXPECT_EQ(bench.reason(), SafeReason::link) << "two missed deadlines are forgiven";
}

TEST(GigaWatchdog, ResetsTheBoardHalfASecondAfterTheTimerInterruptIsDead) {
  GigaBench bench;
  bench.boot();
  bench.giga.primask = 1;
  EXPECT_FALSE(bench.giga.reset_by([&] { bench.giga.pass_ms(490); }));
  EXPECT_TRUE(bench.giga.reset_by([&] { bench.giga.pass_ms(20); }));
  bench.restart();
  EXPECT_EQ(bench.reason(), SafeReason::watchdog);
  bench.restart();
  EXPECT_NE(bench.reason(), SafeReason::watchdog) << "a restart ends this cause";
}

TEST(GigaFault, AProcessorFaultTurnsOutputsOffAndTheNextBootReportsIt) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  ASSERT_EQ(bench.giga.vectors.count(HardFault_IRQn), 1U);
  r4_fake_scb.CFSR.value = 0x8200;
  EXPECT_TRUE(bench.giga.reset_by([&] { bench.giga.vectors[HardFault_IRQn](); }));
  EXPECT_TRUE(bench.pins().is_safe());
  bench.restart();
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_TRUE(has_line(bench.report(), "fault, exception 3, pc 0x00, status 0x8200"));
}

TEST(GigaFault, AFaultDuringATransferTurnsAllOutputsOff) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  for (int after_bytes = 0; after_bytes < 6; ++after_bytes) {
    bench.giga.i2c.hold_after(after_bytes, 4);
    if (!bench.giga.reset_by([&] {
          bench.usb()(host.command("O:" + std::to_string(400 + after_bytes) + ",1,1"));
          bench.run_ms(2);
          bench.giga.vectors[BusFault_IRQn]();
        })) {
      ADD_FAILURE() << "no reset";
    }
    EXPECT_TRUE(bench.pins().is_safe()) << after_bytes;
    bench.restart();
    bench.run_ms(150, host, bench.usb());
    bench.run_ms(1100, host, bench.usb());
    bench.usb()(host.command("E:CLEAR"));
    bench.run_ms(20);
  }
}

// docs/reference/safety.md, "How long it takes".
TEST(GigaFault, AChipThatHoldsTheBusStopsTheSteppersWithin23Ms) {
  std::uint64_t longest_us = 0;
  for (std::uint64_t after_us = 0; after_us < 21000; after_us += 237) {
    GigaBench bench;
    bench.boot();
    PlainHost host;
    bench.run_ms(150, host, bench.usb());
    bench.usb()(host.command("P:1000000,20000,1"));
    bench.run_ms(60, host, bench.usb());
    const giga::Pin pin = giga::pin_of(plan_wiring().at(SignalKind::step));
    const std::uint64_t held_ns = bench.giga.now_ns() + after_us * 1000;
    std::uint64_t last_step_ns = 0;
    int steps = 0;
    const std::function<void()> watch = [&] {
      const int now = bench.giga.rises(pin.port, pin.number);
      if (now != steps) last_step_ns = bench.giga.now_ns();
      steps = now;
      bench.giga.at(bench.giga.now_ns() + 20000, watch);
    };
    bench.giga.at(held_ns, [&] {
      bench.giga.i2c.hold_sda(1'000'000);
      watch();
    });
    bench.run_ms(50, host, bench.usb());
    ASSERT_EQ(bench.reason(), SafeReason::fault) << after_us;
    ASSERT_GT(last_step_ns, held_ns) << after_us;
    longest_us = std::max(longest_us, (last_step_ns - held_ns) / 1000);
  }
  std::printf("a chip holds the bus: the steppers stop after %d us\n",
              static_cast<int>(longest_us));
  EXPECT_LE(longest_us, 23000U);
}

TEST(GigaFault, AnErrorOfTheCoreResetsTheBoard) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  EXPECT_TRUE(bench.giga.reset_by([] { r4_fake_core_error(-5, 0x08040000); }));
  EXPECT_TRUE(bench.pins().is_safe());
  EXPECT_TRUE(bench.giga.reset_by([] { mbed_die(); }));
}

TEST(GigaFault, AWarningOfTheCoreChangesNothing) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  r4_fake_core_warning(-5, 0x08040000);
  bench.run_ms(20);
  EXPECT_TRUE(bench.active());
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
  bench.restart();
  EXPECT_NE(bench.reason(), SafeReason::fault);
}

TEST(GigaFault, TheNextBootSkipsASettingsStoreThatFailed) {
  GigaBench bench;
  bench.store("rate,20\n");
  bench.giga.flash_hangs = true;
  bench.giga.step_timer.period_ns = 1000000000;
  bench.giga.step_timer.next_ns = bench.giga.now_ns() + 50000000;
  bench.giga.step_timer.action = [] { r4_fake_core_error(-5, 0x08040000); };
  EXPECT_TRUE(bench.giga.reset_by([&] { bench.boot(); }));

  bench.system.reset();
  const std::uint64_t before_ms = bench.giga.now_ms();
  bench.boot();
  EXPECT_LE(bench.giga.now_ms() - before_ms, 20U) << "the boot does not wait for the store";
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_TRUE(
      has_line(bench.report(), "Settings: not kept: the key-value store ended the last boot"));

  bench.giga.flash_hangs = false;
  bench.restart();
  EXPECT_NE(bench.reason(), SafeReason::fault);
  EXPECT_EQ(bench.application().settings().state_rate_hz, 20)
      << "the next boot uses the store again";
}

TEST(GigaFault, AFaultAfterTheStoreStartedKeepsTheSettings) {
  GigaBench bench;
  bench.store("rate,20\n");
  bench.boot();
  EXPECT_TRUE(bench.giga.reset_by([] { r4_fake_core_error(-5, 0x08040000); }));
  bench.restart();
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_EQ(bench.application().settings().state_rate_hz, 20);
}

TEST(GigaTimers, LateTicksInOneInterruptWakeTheLoopOnce) {
  GigaBench bench;
  bench.boot();
  bench.run_ms(10);
  bench.giga.primask = 1;
  bench.giga.pass_ms(40);
  bench.giga.primask = 0;
  bench.giga.pass_us(100);  // 40 ticks at once, while the core's queue holds 16
  bench.run_ms(10);
  const std::uint64_t before_ms = bench.giga.now_ms();
  for (int i = 0; i < 10; ++i) bench.turn();
  EXPECT_LE(bench.giga.now_ms() - before_ms, 12U) << "each tick wakes the loop again";
}

TEST(GigaBus, AStuckBusDelaysTheLoopWithinItsLimit) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.giga.i2c.hold_scl(true);
  std::uint64_t longest_us = 0;
  for (int i = 0; i < 500; ++i) {
    const std::uint64_t before = bench.giga.now_ns();
    bench.system->poll();
    longest_us = std::max(longest_us, (bench.giga.now_ns() - before) / 1000);
    giga::rest();
  }
  EXPECT_EQ(bench.reason(), SafeReason::fault);
  EXPECT_LT(longest_us, 10000U);
  RecordProperty("longest_turn_us", static_cast<int>(longest_us));
  bench.giga.i2c.hold_scl(false);
  bench.run_ms(500, host, bench.usb());
  bench.run_ms(1100, host, bench.usb());
  bench.usb()(host.command("E:CLEAR"));
  bench.usb()(host.command("O:358,1,1"));
  bench.run_ms(20);
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358) << "the motor runs again";
}

TEST(GigaSettings, SurviveARestart) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:rate,50"));
  bench.usb()(host.command("C:timeout,1500"));
  bench.usb()(host.command("C:node,7"));
  bench.usb()(host.command("C:AIN24,33.00"));
  bench.run_ms(20);
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.writes == 1;
  })) << "all settings at once, after the last change";
  bench.giga.analog[0x24] = 0x8000;
  bench.restart();
  const Settings& settings = bench.application().settings();
  EXPECT_EQ(settings.state_rate_hz, 50);
  EXPECT_EQ(settings.timeout_ms, 1500);
  EXPECT_EQ(settings.site.can_node, 7);
  PlainHost again;
  bench.run_ms(200, again, bench.usb());
  EXPECT_TRUE(has_line(bench.usb_lines(), "AIN24:16.50;"));
}

TEST(GigaSettings, CalibrateOnlyTheirAnalogInputAtOnce) {
  const std::vector<std::string> names = {"AIN24", "AIN12", "AIN5", "AINDMH", "AINSTEER", "AIN6"};
  for (const std::string& calibrated : names) {
    GigaBench bench;
    for (const int pin : {0x24, 0x25, 0x10, 0x11, 0x23, 0x22}) bench.giga.analog[pin] = 0x8000;
    bench.boot();
    PlainHost host;
    bench.run_ms(150, host, bench.usb());
    bench.usb()(host.command("F:AIN24,AIN12,AIN5,AINDMH,AINSTEER,AIN6"));
    bench.run_ms(20);
    bench.usb_lines();
    bench.usb()(host.command("C:" + calibrated + ",33.00"));
    bench.run_ms(20);
    const std::vector<std::string> lines = bench.usb_lines();
    ASSERT_FALSE(lines.empty());
    for (const std::string& name : names) {
      EXPECT_TRUE(has_line({lines.back()}, name + (name == calibrated ? ":16.50;" : ":25.00;")))
          << calibrated << " in " << lines.back();
    }
  }
}

TEST(GigaSettings, AreNotStoredOnAPartitionForUserFiles) {
  GigaBench bench;
  bench.giga.partition_size = 8 * 1024 * 1024;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:rate,50"));
  bench.run_ms(2500, host, bench.usb());
  EXPECT_EQ(bench.giga.writes, 0);
  EXPECT_TRUE(has_line(bench.report(), "Settings: not kept"));
}

TEST(GigaSettings, AreNotOverwrittenIfTheyCouldNotBeRead) {
  GigaBench bench;
  bench.store("network,mine\nrate,20\n");
  bench.giga.flash_hangs = true;
  const std::uint64_t before_ms = bench.giga.now_ms();
  bench.boot();
  EXPECT_LE(bench.giga.now_ms() - before_ms, 2100U);
  EXPECT_EQ(bench.application().settings().state_rate_hz, 100);
  bench.giga.flash_hangs = false;
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:rate,50"));
  for (int i = 0; i < 30; ++i) {
    bench.run_ms(100, host, bench.usb());
    std::this_thread::sleep_for(std::chrono::milliseconds(1));  // gives the store's thread time
  }
  EXPECT_EQ(bench.giga.writes, 0);
  EXPECT_TRUE(has_line(bench.report(), "Settings: not kept: the key-value store was not ready"));
}

TEST(GigaSettings, AKeySurvivesARestartAndIsRequiredOnCan) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:key,3:" + std::string(64, 'c')));
  bench.run_ms(20);
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.writes == 1;
  }));
  bench.restart();
  EXPECT_TRUE(bench.application().authentication().required());
  PlainHost stranger;
  bench.can_datagrams.clear();
  bench.run_ms(600, stranger, bench.can());
  EXPECT_EQ(bench.application().state(), firmware::BoardState::connecting);
  EXPECT_TRUE(has_line(bench.can_datagrams, ";AN:"));
  const std::vector<std::string> report = bench.report();
  EXPECT_TRUE(has_line(report, "Keys: 3; dropped: missing "));
  EXPECT_FALSE(has_line(report, "cccc"));
  PlainHost again;
  bench.drive(again, bench.usb());
}

TEST(GigaReport, ReportsHowManyPathsTheSessionHas) {
  GigaBench bench;
  bench.boot();
  EXPECT_FALSE(has_line(bench.report(), "Paths: "));
  const std::string named = "H:ROS2-R4;SID:0123456789abcdef;";
  bench.usb_lines();
  bench.usb()(with_crc(named + "PNum:1;T:0;"));
  bench.run_ms(20);
  // The answer is "H:R4-ROS2;PNum:1;T:…;^…^". The T of a heartbeat with PNum:0 cannot be echoed.
  std::string offered;
  for (const std::string& line : bench.usb_lines()) {
    if (line.find(";PNum:0;") == std::string::npos) offered = line;
  }
  const std::size_t at = offered.find(";T:");
  ASSERT_NE(at, std::string::npos) << offered;
  const std::string echo = offered.substr(at + 1, offered.find(';', at + 1) - at);
  bench.usb()(with_crc(named + "PNum:2;" + echo));
  bench.can()(with_crc(named + "PNum:2;" + echo));
  bench.run_ms(20);
  EXPECT_TRUE(has_line(bench.report(), "Paths: 2; joined 1, lost 0"));
}

TEST(GigaSettings, NetworkSettingsAreRefusedOverCan) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.can());
  bench.can()(host.command("C:network,evil"));
  bench.run_ms(50);
  EXPECT_TRUE(has_line(bench.can_datagrams, ",AUTH;"));
  EXPECT_STREQ(bench.application().settings().site.network, "");
}

}  // namespace
}  // namespace r4::test
