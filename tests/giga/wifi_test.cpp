// SPDX-License-Identifier: GPL-3.0-or-later
// The firmware on a fake Giga over WiFi: networks, and a library that hangs.
#include <algorithm>

#include "bench.hpp"

namespace r4::test {
namespace {

TEST(GigaWiFi, JoinsTheNetworkThatIsSetOverUsbAndAnswersThere) {
  GigaBench bench;
  bench.boot();
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:network,lab"));
  bench.usb()(host.command("C:password,correct%20horse"));
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.wifi_connected && bench.giga.udp_port == 2018;
  }));
  bench.giga.usb_open = false;
  bench.run_ms(1100);
  PlainHost other;
  bench.udp()(other.heartbeat(1));
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return std::any_of(bench.giga.udp_out.begin(), bench.giga.udp_out.end(),
                       [](const fake::Datagram& datagram) {
                         return datagram.ip == GigaBench::host_ip && datagram.port == 40000 &&
                                datagram.bytes.find("AIN24:") == 0;
                       });
  }));
}

TEST(GigaWiFi, JoinsAnOpenNetwork) {
  GigaBench bench;
  bench.giga.air_password = "";
  bench.store("network,lab\n");
  bench.boot();
  EXPECT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.wifi_connected && bench.giga.udp_port == 2018;
  }));
}

TEST(GigaWiFi, AThreadThatHangsInTheLibraryDoesNotDisturbTheLoop) {
  GigaBench bench;
  bench.giga.wifi_hangs = true;
  bench.store("network,lab\n");
  bench.boot();
  PlainHost host;
  bench.drive(host, bench.usb());
  bench.usb_lines();
  bench.run_ms(2000, host, bench.usb());
  EXPECT_TRUE(bench.active());
  EXPECT_NEAR(static_cast<double>(bench.usb_lines().size()), 204, 6);
}

TEST(GigaWiFi, RejoinsALostNetworkAndRetriesAWrongPassword) {
  GigaBench bench;
  bench.store("network,lab\npassword,wrong-one\n");
  bench.boot();
  const auto joins = [&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.joins;
  };
  const auto up = [&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.udp_port != 0;
  };
  ASSERT_TRUE(bench.run_until([&] { return joins() >= 3; }));
  EXPECT_FALSE(up());
  {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    bench.giga.air_password = "wrong-one";
  }
  ASSERT_TRUE(bench.run_until(up));
  const int before = joins();
  {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    bench.giga.wifi_connected = false;
  }
  ASSERT_TRUE(bench.run_until([&] { return joins() > before && up(); }));
}

TEST(GigaWiFi, LosingTheNetworkMakesTheOutputsSafeAtOnce) {
  GigaBench bench;
  ASSERT_TRUE(bench.boot_in_network());
  PlainHost host;
  std::uint64_t next_ms = 0;
  ASSERT_TRUE(bench.run_until([&] {
    if (bench.giga.now_ms() < next_ms) return false;
    next_ms = bench.giga.now_ms() + 100;
    bench.udp()(host.heartbeat(next_ms));
    bench.udp()(host.command("O:358,1,1"));
    return bench.pins().osmc[0].pwm == 358;
  }));
  {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    bench.giga.wifi_connected = false;
    bench.giga.air.clear();
  }
  ASSERT_TRUE(bench.run_until([&] {
    if (bench.giga.now_ms() >= next_ms) {
      next_ms = bench.giga.now_ms() + 100;
      bench.udp()(host.heartbeat(next_ms));
    }
    return bench.pins().is_safe();
  }));
  EXPECT_EQ(bench.reason(), SafeReason::link);
}

TEST(GigaWiFi, ANewCalibrationDoesNotDropTheNetwork) {
  GigaBench bench;
  bench.store("network,lab\npassword,correct%20horse\n");
  bench.boot();
  const auto joins = [&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return bench.giga.joins;
  };
  ASSERT_TRUE(bench.run_until([&] { return joins() == 1; }));
  PlainHost host;
  bench.run_ms(150, host, bench.usb());
  bench.usb()(host.command("C:AIN24,33.00"));
  bench.usb()(host.command("C:host,192.168.0.117"));
  ASSERT_TRUE(bench.run_until([&] {
    const std::lock_guard<std::mutex> lock(bench.giga.mutex);
    return std::any_of(bench.giga.udp_out.begin(), bench.giga.udp_out.end(),
                       [](const fake::Datagram& datagram) { return datagram.port == 2390; });
  })) << "the board sends to the new host";
  EXPECT_EQ(joins(), 1);
}

}  // namespace
}  // namespace r4::test
