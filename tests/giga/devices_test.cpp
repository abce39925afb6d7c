// SPDX-License-Identifier: GPL-3.0-or-later
// The user's I2C bus of the Giga: its peripheral at the level of registers, and its effect on the
// board.
#include <cstring>
#include <iterator>

#include "bench.hpp"
#include "firmware/ports/giga/devices/user_i2c_controller.hpp"
#include "firmware/ports/giga/devices/user_uart_controller.hpp"
#include "firmware/ports/giga/pins.hpp"
#include "protocol/messages/state_fields.hpp"

namespace r4::test {
namespace {

class GigaDevices : public testing::Test {
 protected:
  GigaDevices() {
    bench.boot();
    bench.drive(host, bench.usb());
  }
  void command(const std::string& field) {
    bench.usb()(host.command(field));
    bench.run_ms(3);
  }
  // Runs for `ms` and returns the number of states with the field `told`. The newest state is in
  // `state`.
  std::size_t states(std::uint64_t ms) {
    bench.usb_lines();
    bench.run_ms(ms, host, bench.usb());
    std::size_t count = 0;
    for (const std::string& line : bench.usb_lines()) {
      Datagram datagram;
      if (!read_datagram(line, datagram) ||
          datagram.find(Text(told, std::strlen(told))).name().empty())
        continue;
      EXPECT_TRUE(read_state(datagram, state));
      ++count;
    }
    return count;
  }
  void read_all() {
    command("F:I2C1,I2C8,I2CX,I2CBUS");
    command("X:WRITE,0x68,x6b00");
    command("X:POLL,0x68,x3b,14,10,1");
    for (int slot = 2; slot <= 8; ++slot) command("X:POLL,0x40,x02,2,50," + std::to_string(slot));
  }

  GigaBench bench;
  PlainHost host;
  State state;
  const char* told = "I2CBUS";  // only states with this field are counted
};

TEST(UserI2cTiming, KeepsTheLimitsOfStandardModeForEveryClock) {
  for (std::uint32_t mhz = 8; mhz <= 250; ++mhz) {
    const std::uint32_t timing = giga::user_i2c_timing(mhz * 1000000);
    const double tick_ns = 1000.0 * ((timing >> 28) + 1) / mhz;
    const double low = tick_ns * ((timing & 0xFF) + 1);
    const double high = tick_ns * ((timing >> 8 & 0xFF) + 1);
    EXPECT_GE(low, 4700) << mhz;  // UM10204 table 10
    EXPECT_GE(high, 4000) << mhz;
    EXPECT_GE(tick_ns * ((timing >> 20 & 0xF) + 1), 250) << mhz;
    EXPECT_LE(tick_ns * (timing >> 16 & 0xF), 3450) << mhz;
    EXPECT_LE(low + high, 11000) << mhz << ": not needlessly slow";
    EXPECT_EQ(timing & 0x0F000000, 0U) << "reserved";
  }
}

// From variants/GIGA of ArduinoCore-mbed, commit 2080938: I2C_SDA1 PH_12, I2C_SCL1 PB_6_ALT0, both
// I2C4.
TEST(GigaPins, TheUsersBusIsTheCoresWire1) {
  EXPECT_TRUE(giga::i2c_scl_pins[1] == (giga::Pin{'B', 6}));
  EXPECT_TRUE(giga::i2c_sda_pins[1] == (giga::Pin{'H', 12}));
  EXPECT_EQ(giga::i2c_scl_functions[1], 6U);
  EXPECT_EQ(giga::i2c_sda_functions[1], 4U);
}

TEST_F(GigaDevices, AreReadAtTheirRateOnTheirOwnBus) {
  read_all();
  bench.giga.i2c.log.clear();
  bench.giga.user_i2c.log.clear();
  EXPECT_NEAR(static_cast<double>(states(1000)), 100, 3);
  EXPECT_EQ(state.raw.i2c[0].data.size, 14);
  EXPECT_EQ(state.raw.i2c[0].data.bytes[4], 0x40) << "1 g";
  EXPECT_EQ(state.raw.i2c[7].data.size, 2);
  EXPECT_EQ(state.i2c_bus.errors, 0U);
  EXPECT_LE(state.t_ms - state.raw.i2c[0].t_ms, 15U);
  const auto& log = bench.giga.user_i2c.log;
  const auto imu = std::count_if(log.begin(), log.end(), [](const auto& each) {
    return each == std::vector<std::uint8_t>{0x68 << 1, 0x3B};
  });
  const auto meters = std::count_if(log.begin(), log.end(), [](const auto& each) {
    return each == std::vector<std::uint8_t>{0x40 << 1, 0x02};
  });
  EXPECT_NEAR(static_cast<double>(imu), 100, 3);
  EXPECT_NEAR(static_cast<double>(meters), 7 * 20, 8);
  for (const auto& transfer : bench.giga.i2c.log) EXPECT_NE(transfer[0] >> 1, 0x68);
}

TEST_F(GigaDevices, AMissingDeviceIsReportedAndAScanFindsTheOthers) {
  command("F:I2CX,I2CBUS");
  command("X:READ,0x50,x00,1");
  states(30);
  EXPECT_EQ(state.i2c_answer.outcome, I2cOutcome::no_acknowledge);
  command("X:SCAN");
  states(300);
  EXPECT_EQ(state.i2c_answer.outcome, I2cOutcome::done);
  ASSERT_EQ(state.i2c_answer.data.size, 2);
  EXPECT_EQ(state.i2c_answer.data.bytes[0], 0x40);
  EXPECT_EQ(state.i2c_answer.data.bytes[1], 0x68);
}

TEST_F(GigaDevices, ARefusedTransferLeavesNoByteForTheNext) {
  command("F:I2CX,I2CBUS");
  bench.giga.user_i2c.refuse_after(1);
  command("X:WRITE,0x40,x051122");
  states(30);
  EXPECT_EQ(state.i2c_answer.outcome, I2cOutcome::no_acknowledge);
  bench.giga.user_i2c.log.clear();
  command("X:WRITE,0x68,x6b00");
  states(30);
  EXPECT_EQ(state.i2c_answer.outcome, I2cOutcome::done);
  EXPECT_EQ(bench.giga.user_i2c.log,
            (std::vector<std::vector<std::uint8_t>>{{0x68 << 1, 0x6B, 0x00}}));
}

TEST_F(GigaDevices, AReadingFromSettingsNeedsNoBusRecoveryAtBoot) {
  command("C:i2c1,0x68:x75:1:50");
  bench.run_ms(1000, host, bench.usb());
  bench.restart();
  bench.drive(host, bench.usb());
  command("F:I2C1,I2CBUS");
  states(100);
  EXPECT_EQ(state.raw.i2c[0].data.size, 1);
  EXPECT_EQ(state.raw.i2c[0].errors, 0U);
  EXPECT_EQ(state.i2c_bus.recoveries, 0U);
}

TEST_F(GigaDevices, FreesTheBusFromACutOffDevice) {
  read_all();
  bench.giga.user_i2c.hold_sda(9);
  states(200);
  EXPECT_EQ(state.i2c_bus.recoveries, 1U);
  EXPECT_LE(state.t_ms - state.raw.i2c[0].t_ms, 20U) << "the device is read again";
}

TEST_F(GigaDevices, AHeldBusDoesNotDelayTheBoard) {
  read_all();
  for (const bool scl : {false, true}) {
    bench.giga.user_i2c.hold_sda(scl ? 0 : 1'000'000);
    bench.giga.user_i2c.hold_scl(scl);
    states(200);
    EXPECT_NEAR(static_cast<double>(states(500)), 50, 2);
    EXPECT_EQ(state.i2c_bus.newest, I2cOutcome::bus_stuck);
    EXPECT_TRUE(bench.active());
    EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
    bench.usb()(host.command("E:STOP"));
    const std::uint64_t sent_ns = bench.giga.now_ns();
    while (!bench.pins().is_safe() && bench.giga.now_ns() - sent_ns < 20'000'000) bench.turn();
    EXPECT_TRUE(bench.pins().is_safe());
    EXPECT_LE((bench.giga.now_ns() - sent_ns) / 1000, 3000U);
    bench.run_ms(1100, host, bench.usb());
    command("E:CLEAR");
    command("O:358,1,1");
    bench.run_ms(20, host, bench.usb());
    EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
  }
  bench.giga.user_i2c.hold_scl(false);
  states(300);
  EXPECT_LE(state.t_ms - state.raw.i2c[0].t_ms, 20U);
}

// --- UARTs, DAC and spare inputs

TEST(UserUartTiming, IsWithin1Point5PercentAtEveryRateAndClock) {
  for (std::uint32_t mhz = 16; mhz <= 250; ++mhz) {
    for (const std::uint32_t baud : {1200U, 9600U, 38400U, 115200U, 230400U, 460800U}) {
      const giga::UartTiming timing = giga::user_uart_timing(mhz * 1000000, baud);
      EXPECT_GE(timing.divider, 16U) << "RM0399: at least 16 samples a bit";
      EXPECT_LE(timing.divider, 0xFFFFU);
      const double real = mhz * 1e6 / (1U << timing.prescaler) / timing.divider;
      EXPECT_NEAR(real, baud, 0.015 * baud) << mhz;
    }
  }
}

// From the same commit: pins_arduino.h has SERIAL2_TX 18, SERIAL2_RX 19, SERIAL3_TX 16, SERIAL3_RX
// 17; variant.cpp has D18 PD_5, D19 PD_6, D16 PH_13, D17 PI_9. In the data sheet, PD5 and PD6 are
// USART2 with function 7, and PH13 and PI9 are UART4 with function 8.
TEST(GigaPins, TheUsersUartsAreTheCoresSerial2AndSerial3) {
  EXPECT_TRUE(giga::uart_tx_pins[0] == (giga::Pin{'D', 5}));
  EXPECT_TRUE(giga::uart_rx_pins[0] == (giga::Pin{'D', 6}));
  EXPECT_TRUE(giga::uart_tx_pins[1] == (giga::Pin{'H', 13}));
  EXPECT_TRUE(giga::uart_rx_pins[1] == (giga::Pin{'I', 9}));
  EXPECT_EQ(giga::uart_functions[0], 7U);
  EXPECT_EQ(giga::uart_functions[1], 8U);
}

// From the same commit: A12 PA_4 (DAC1_OUT1), A13 PA_5 (DAC1_OUT2).
TEST(GigaPins, TheDacOutputsAreA12AndA13) {
  EXPECT_TRUE(giga::dac_pins[0] == (giga::Pin{'A', 4}));
  EXPECT_TRUE(giga::dac_pins[1] == (giga::Pin{'A', 5}));
}

TEST(GigaPins, TheSpareInputsAreD6AndD44AndD8ToD13) {
  const giga::Pin pins_of_variant[] = {{'D', 13}, {'G', 10}, {'B', 8},  {'B', 9},
                                       {'K', 1},  {'J', 10}, {'J', 11}, {'H', 6}};
  for (int i = 1; i <= gpio_channels; ++i) {
    const giga::Pin pin = giga::pin_of(plan_wiring().at(SignalKind::gpio, i));
    EXPECT_TRUE(pin == pins_of_variant[i - 1]) << "input " << i;
  }
}

TEST_F(GigaDevices, AUartReceivesEachByteOnceAndSendsItsWrites) {
  told = "UART1";
  command("F:UART1,UART2");
  command("C:uart1,115200:8N1");
  command("C:uart2,460800:8E2");
  EXPECT_NEAR(static_cast<double>(bench.giga.uart[0].byte_ns()), 86806, 900);
  EXPECT_NEAR(static_cast<double>(bench.giga.uart[1].byte_ns()), 26042, 300);
  bench.giga.uart[1].say("hello");
  std::string sentence;
  for (int i = 0; i < 60; ++i) sentence += static_cast<char>('A' + i % 26);
  bench.giga.uart[0].say(sentence);
  states(30);
  EXPECT_EQ(state.raw.uart[0].position + state.raw.uart[0].data.size, 60U);
  EXPECT_EQ(state.raw.uart[0].lost, 0U);
  EXPECT_EQ(state.raw.uart[1].position + state.raw.uart[1].data.size, 5U);
  command("X:UART,1,x48656c6c6f");
  states(20);
  EXPECT_EQ(bench.giga.uart[0].sent, "Hello");
  command("C:uart1,off");
  bench.giga.uart[0].say("nobody hears it");
  states(30);
  EXPECT_EQ(state.raw.uart[0].position + state.raw.uart[0].data.size, 60U);
}

TEST_F(GigaDevices, AStopDropsUnsentUartBytes) {
  command("C:uart1,1200:8N1");
  command("X:UART,1,x" + std::string(96, '4'));
  bench.run_ms(30);
  command("E:STOP");
  const std::size_t sent = bench.giga.uart[0].sent.size();
  bench.run_ms(1000);
  EXPECT_LE(bench.giga.uart[0].sent.size(), sent + 1) << "at most the byte on the wire";
}

TEST_F(GigaDevices, DropsOnlyTheDamagedUartBytes) {
  told = "UART1";
  command("F:UART1");
  command("C:uart1,9600:8N1");
  bench.giga.uart[0].noise = true;
  states(500);
  bench.giga.uart[0].noise = false;
  states(50);
  EXPECT_GT(bench.giga.uart[0].damaged, 50U);
  EXPECT_EQ(state.raw.uart[0].lost, bench.giga.uart[0].damaged);
  EXPECT_EQ(state.raw.uart[0].position + state.raw.uart[0].data.size, bench.giga.uart[0].said);
}

TEST_F(GigaDevices, NoiseOnTheUartsDoesNotDelayTheBoard) {
  told = "UART1";
  command("F:UART1,UART2");
  command("C:uart1,460800:8N1");
  command("C:uart2,460800:8N1");
  bench.giga.uart[0].noise = bench.giga.uart[1].noise = true;
  states(200);
  EXPECT_NEAR(static_cast<double>(states(500)), 50, 2);
  EXPECT_GT(state.raw.uart[0].lost, 1000U);
  EXPECT_TRUE(bench.active());
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
  bench.usb()(host.command("E:STOP"));
  const std::uint64_t sent_ns = bench.giga.now_ns();
  while (!bench.pins().is_safe() && bench.giga.now_ns() - sent_ns < 20'000'000) bench.turn();
  EXPECT_LE((bench.giga.now_ns() - sent_ns) / 1000, 3000U);
  bench.run_ms(1100, host, bench.usb());
  command("E:CLEAR");
  command("O:358,1,1");
  bench.run_ms(20, host, bench.usb());
  EXPECT_EQ(bench.pins().osmc[0].pwm, 358);
  bench.run_ms(1010);
  EXPECT_TRUE(bench.pins().is_safe()) << "the host is silent";
}

TEST_F(GigaDevices, ADacVoltageIsSetAndZeroInTheSafeState) {
  command("X:DAC,1,1650");
  command("X:DAC,2,3300");
  EXPECT_EQ(DAC1->DHR12R1.value, 2048U);
  EXPECT_EQ(DAC1->DHR12R2.value, 4095U);
  EXPECT_EQ(DAC1->CR.value, 0x10001U);
  EXPECT_EQ(DAC1->MCR.value, 0x20002U);
  EXPECT_EQ(GPIOA->MODER.value >> 8 & 0xFU, 0xFU) << "PA4 and PA5 are analog";
  command("E:STOP");
  EXPECT_EQ(DAC1->DHR12R1.value, 0U);
  EXPECT_EQ(DAC1->DHR12R2.value, 0U);
}

TEST_F(GigaDevices, SpareInputsArePulledUp) {
  told = "GPIO";
  command("F:GPIO");
  states(30);
  EXPECT_EQ(state.gpio, 0xFF);
  bench.giga.set_pin('B', 8, false);
  bench.giga.set_pin('H', 6, false);
  states(30);
  EXPECT_EQ(state.gpio, 0x7B);
}

}  // namespace
}  // namespace r4::test
