// SPDX-License-Identifier: GPL-3.0-or-later
// E:STOP while the loop is busy: the interrupt or thread that receives a stop detects it, and the
// board obeys at once.
#include "bench.hpp"

namespace r4::test {
namespace {

// A board that drives its outputs. Measures the time from the arrival of a stop to the last safe
// register.
class StopBench : public GigaBench {
 public:
  StopBench() {
    boot();
    drive(host, usb());
    drive_everything();
    run_ms(20);
  }

  // Sends commands that cause many writes to the chips in the next turns.
  void drive_everything() {
    for (const char* command : {"O:4095,0,2", "D:4095,1,2", "S:2000,2", "B:4000,1,0,2", "R:3,On"}) {
      usb()(host.command(command));
    }
  }

  // Sends `stop` after `after_us`, while the loop runs `meanwhile`. Returns the microseconds from
  // the stop to the safe state.
  std::uint64_t us_to_safe(const std::function<void()>& stop, std::uint64_t after_us,
                           const std::function<void()>& meanwhile) {
    const std::uint64_t stop_ns = giga.now_ns() + after_us * 1000;
    safe_ns_ = 0;
    giga.at(stop_ns, [this, &stop] {
      stop();
      watch();
    });
    for (int i = 0; i < 1000 && safe_ns_ == 0; ++i) meanwhile();
    EXPECT_NE(safe_ns_, 0U) << "the board never became safe";
    return (safe_ns_ - stop_ns) / 1000;
  }
  void clear_and_drive() {
    run_ms(120, host, usb());
    usb()(host.command("E:CLEAR," + std::to_string(application().safe_report().cause)));
    run_ms(5);
    drive(host, usb());
  }

  PlainHost host;

 private:
  void watch() {
    if (pins().is_safe()) {
      safe_ns_ = giga.now_ns();
    } else {
      giga.at(giga.now_ns() + 5000, [this] { watch(); });
    }
  }
  std::uint64_t safe_ns_ = 0;
};

void emergency_frame(GigaBench& bench) {
  CanFrame frame{};
  frame.id = emergency_stop_id;
  EXPECT_TRUE(bench.giga.can.deliver(frame));
}

constexpr std::uint64_t bar_us = 1000;

TEST(GigaStop, AStopOverUsbOrByCanFrameWorksWhileTheLoopHangs) {
  for (const bool over_usb : {true, false}) {
    StopBench bench;
    const auto stop = [&] {
      if (over_usb) bench.usb()(with_crc("E:STOP;"));
      if (!over_usb) emergency_frame(bench);
    };
    const std::uint64_t us = bench.us_to_safe(stop, 300, [&] { bench.giga.pass_us(20); });
    std::printf("%s, the loop hangs: %d us\n", over_usb ? "USB" : "CAN's frame",
                static_cast<int>(us));
    EXPECT_LE(us, bar_us);
    bench.run_ms(5);
    EXPECT_EQ(bench.reason(), SafeReason::stop);
  }
}

TEST(GigaStop, AStopOverUsbOrByCanFrameWorksAtAnyMomentOfATurn) {
  for (const bool over_usb : {true, false}) {
    StopBench bench;
    const auto stop = [&] {
      if (over_usb) bench.usb()(bench.host.command("E:STOP"));
      if (!over_usb) emergency_frame(bench);
    };
    std::uint64_t longest_us = 0;
    for (std::uint64_t after_us = 7; after_us < 3000; after_us += 31) {
      bench.drive_everything();
      const std::uint64_t us = bench.us_to_safe(stop, after_us, [&] { bench.turn(); });
      longest_us = std::max(longest_us, us);
      bench.run_ms(5);
      ASSERT_EQ(bench.reason(), SafeReason::stop) << after_us;
      ASSERT_TRUE(bench.pins().is_safe()) << after_us;
      bench.clear_and_drive();
    }
    std::printf("%s, at the worst moment: %d us\n", over_usb ? "USB" : "CAN's frame",
                static_cast<int>(longest_us));
    EXPECT_LE(longest_us, bar_us);
  }
}

// The loop assembles a datagram from CAN frames, so a stop in a datagram waits for the end of a
// turn. Our hosts send a stop as a frame instead.
TEST(GigaStop, AStopByCanDatagramWorksInTheNextTurn) {
  StopBench bench;
  std::uint64_t longest_us = 0;
  for (std::uint64_t after_us = 7; after_us < 3000; after_us += 131) {
    bench.drive_everything();
    const auto stop = [&] { bench.can()(bench.host.command("E:STOP")); };
    longest_us = std::max(longest_us, bench.us_to_safe(stop, after_us, [&] { bench.turn(); }));
    bench.run_ms(5);
    ASSERT_EQ(bench.reason(), SafeReason::stop) << after_us;
    bench.clear_and_drive();
  }
  std::printf("CAN's datagram, at the worst moment: %d us\n", static_cast<int>(longest_us));
  EXPECT_LE(longest_us, 5000U);
}

TEST(GigaStop, AUsbStopPassesUnreadInput) {
  StopBench bench;
  const auto stop = [&] {
    for (int i = 0; i < 10; ++i) bench.usb()(bench.host.command("O:100,1,1"));
    bench.usb()(with_crc("E:STOP;"));
  };
  EXPECT_LE(bench.us_to_safe(stop, 300, [&] { bench.giga.pass_us(20); }), bar_us);
}

TEST(GigaStop, AUsbStopWorksAfterAnotherProgramsUnfinishedLine) {
  StopBench bench;
  bench.giga.usb_send("O:358,1");
  bench.run_ms(5);
  bench.giga.usb_open = false;
  bench.run_ms(5);
  bench.giga.usb_open = true;
  bench.run_ms(5);
  PlainHost other;
  bench.drive(other, bench.can());
  const auto stop = [&] { bench.usb()(with_crc("E:STOP;")); };
  EXPECT_LE(bench.us_to_safe(stop, 300, [&] { bench.giga.pass_us(20); }), bar_us);
}

TEST(GigaStop, TheGuardMakesAHungLoopWithAFullUsbRingSafe) {
  // The host keeps the bytes that the board cannot accept. The guard notices that the loop hangs.
  StopBench bench;
  for (int i = 0; i < 200; ++i) bench.giga.usb_send(std::string(64, 'x'));
  bench.giga.usb_send("\n" + with_crc("E:STOP;") + "\r\n");
  bench.giga.pass_ms(50);
  EXPECT_FALSE(bench.pins().is_safe());
  bench.giga.pass_ms(75);
  EXPECT_TRUE(bench.pins().is_safe());
}

TEST(GigaStop, AUdpStopWorksWhileTheLoopHangs) {
  GigaBench bench;
  ASSERT_TRUE(bench.boot_in_network());
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.udp()(with_crc("E:STOP;"));
  // Gives the network thread time.
  for (int i = 0; i < 20000 && !bench.giga.pending[MDIOS_IRQn]; ++i) {
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  const std::uint64_t heard_ns = bench.giga.now_ns();
  while (!bench.pins().is_safe() && bench.giga.now_ns() < heard_ns + 3000000) {
    bench.giga.pass_us(5);
  }
  EXPECT_LE((bench.giga.now_ns() - heard_ns) / 1000, bar_us);
  bench.run_ms(5);
  EXPECT_EQ(bench.reason(), SafeReason::stop);
}

}  // namespace
}  // namespace r4::test
