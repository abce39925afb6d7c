// SPDX-License-Identifier: GPL-3.0-or-later
// A Giga in virtual time: the registers of the microcontroller that the firmware uses, the hardware
// of these registers, and the functions of the core that the firmware calls. One Giga can exist at
// a time. The firmware runs in the thread of the test, and its threads are real threads.
//
// Time passes when the firmware reads the clock (1 us each time), when the firmware rests, or when
// the test advances the time. Timers interrupt the running code unless interrupts are off, so an
// interrupt can occur in the middle of a transfer, as on the chip. A reset ends the action of
// reset_by().
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "firmware/ports/sim/devices/user_devices.hpp"
#include "firmware/ports/sim/robot/board_chips.hpp"
#include "r4link/can/can_frame.hpp"

struct I2C_TypeDef;
struct USART_TypeDef;

namespace r4::fake {

// The I2C peripheral between the firmware and the chips, by RM0399.
class I2cPeripheral {
 public:
  // Another device holds SDA until SCL has risen `clocks` times.
  void hold_sda(int clocks) { sda_held_ = clocks; }
  // Another device holds SCL until the call of hold_scl(false).
  void hold_scl(bool held) { scl_held_ = held; }
  // SDA is held for `clocks` after `bytes` more bytes were sent.
  void hold_after(int bytes, int clocks) {
    hold_after_ = bytes;
    hold_clocks_ = clocks;
  }
  // After `bytes` more data bytes, the chips do not acknowledge the next byte.
  void refuse_after(int bytes) { refuse_after_ = bytes; }
  // The peripheral reports a false bus error after `bytes` more bytes (ES0430 2.15.2).
  void report_bus_error_after(int bytes) { bus_error_after_ = bytes; }
  // After `bytes` more bytes, a disturbance looks like a STOP, so the chips end the transfer.
  void disturb_after(int bytes) { disturbed_after_ = bytes; }
  // Another device pulls SDA low after `bytes` more bytes, in each of `transfers` transfers. A chip
  // that is interrupted while it sends a byte holds SDA for nine clocks.
  void lose_after(int bytes, int transfers) {
    lose_after_ = bytes;
    losses_ = transfers;
  }
  // The bytes on the wire, addresses included: {address << 1 | read, bytes…} for each START.
  std::vector<std::vector<std::uint8_t>> log;

  // Connects the registers, in the state after a reset.
  void connect(I2C_TypeDef& registers, std::vector<sim::I2cChipModel*> chips,
               std::uint64_t clock_ns);
  bool sda_low() const { return sda_held_ > 0; }
  bool scl_low() const { return scl_held_; }
  void scl_rose() {
    if (sda_held_ > 0) --sda_held_;
  }

 private:
  enum class Step { idle, address, want_byte, byte, complete, read, stop, stuck };
  void start(std::uint32_t cr2);
  void progress();
  void after(Step step, std::uint64_t ns);
  void end_of_bytes();
  void refuse();
  void shift();
  void count_byte();
  void stop_chips();
  void cut_off_chips();

  I2C_TypeDef* registers_ = nullptr;
  std::vector<sim::I2cChipModel*> chips_;
  std::uint64_t byte_ns = 0;  // nine clocks
  std::uint64_t stop_ns = 0;
  Step step_ = Step::idle;
  std::uint64_t due_ns_ = 0;
  std::uint32_t cr2_ = 0;
  std::uint32_t left_ = 0;
  std::uint32_t flags_ = 0;
  std::optional<std::uint8_t> txdr_;  // waits until the byte on the wire has ended
  std::uint8_t out_ = 0;
  std::uint8_t in_ = 0;
  std::vector<sim::I2cChipModel*> taking_part_;
  int sda_held_ = 0;
  bool scl_held_ = false;
  int refuse_after_ = -1;
  int bus_error_after_ = -1;
  int disturbed_after_ = -1;
  int lose_after_ = 0;
  int losses_ = 0;
  int sent_ = 0;  // bytes sent in this transfer
  int hold_after_ = -1;
  int hold_clocks_ = 0;
};

// A USART between the firmware and a wire, by RM0399, with FIFOs of 16 bytes and the time of a byte
// on the wire.
class UartPeripheral {
 public:
  void connect(USART_TypeDef& registers);
  // The peer sends these bytes at the baud rate of the board.
  void say(const std::string& bytes);
  // The peer sends bytes without end. One byte in four is damaged.
  bool noise = false;
  std::uint32_t said = 0;  // undamaged bytes sent to the board so far
  std::uint32_t damaged = 0;
  std::string sent;
  std::uint64_t byte_ns() const;

 private:
  struct Byte {
    char value;
    bool damaged;
  };
  void pass();
  bool on() const;

  USART_TypeDef* registers_ = nullptr;
  std::deque<char> to_say_;
  std::deque<Byte> received_;
  std::deque<char> to_send_;
  std::uint64_t in_ns_ = 0;
  std::uint64_t out_ns_ = 0;
  std::uint32_t chance_ = 1;
  bool overrun_ = false;
};

// The FDCAN controller and its bus, by RM0399. A frame takes 100 us.
class CanPeripheral {
 public:
  void connect();
  // Delivers a frame from the bus. False if the filters rejected the frame.
  bool deliver(const CanFrame& frame);
  void pass(std::uint64_t now_ns);

  bool acknowledged = true;  // another node is on the bus
  bool quiet = true;         // the bus allows the recovery from bus-off
  void go_bus_off();
  std::deque<CanFrame> sent;
  int overtaken = 0;  // urgent frames that have overtaken waiting frames
  // Is called after a frame is sent.
  std::function<void(const CanFrame&)> on_sent;

 private:
  CanFrame element(std::uint32_t word) const;
  void store(std::uint32_t base, std::uint32_t index, const CanFrame& frame);
  std::uint32_t filter_result(const CanFrame& frame) const;

  std::uint32_t pending_ = 0;
  std::uint32_t put_ = 1;  // index of the elements 1 … 8 of the queue
  std::uint32_t get_ = 1;
  std::uint32_t fifo0_get_ = 0, fifo0_fill_ = 0, fifo1_get_ = 0, fifo1_fill_ = 0;
  std::uint64_t free_at_ns_ = 0;
  bool bus_off_ = false;
  std::uint64_t back_at_ns_ = 0;
};

struct Datagram {
  std::uint32_t ip;
  std::uint16_t port;
  std::string bytes;
};

class Giga {
 public:
  explicit Giga(const Wiring& wired = plan_wiring());
  ~Giga();
  Giga(const Giga&) = delete;
  Giga& operator=(const Giga&) = delete;

  // --- time
  std::uint64_t now_ns() const { return now_ns_; }
  std::uint64_t now_ms() const { return now_ns_ / 1000000; }
  void pass_us(std::uint64_t us);
  void pass_ms(std::uint64_t ms) { pass_us(ms * 1000); }
  // `event` happens outside the firmware at that time, even if the firmware is busy.
  void at(std::uint64_t when_ns, std::function<void()> event) { events_.emplace(when_ns, event); }

  // --- resets
  // True if `action` ended in a reset of the chip, which also resets the peripherals.
  bool reset_by(const std::function<void()>& action);
  // While false, the watchdog does not need to be fed.
  bool watchdog_runs = false;
  std::uint64_t watchdog_fed_ns = 0;
  int watchdog_feeds = 0;

  // --- the board, as it is wired
  sim::BoardChips chips;
  I2cPeripheral i2c;         // on the bus with the chips
  sim::UserDevices devices;  // on the user's I2C bus
  I2cPeripheral user_i2c;
  UartPeripheral uart[uart_channels];
  CanPeripheral can;
  void set_pin(char port, int number, bool level);  // sets an input, from outside
  bool pin(char port, int number);                  // level of an output
  int rises(char port, int number) const;           // rising edges so far
  std::map<int, unsigned short> analog;             // PinName to counts
  bool converter_hangs = false;                     // the registers of ADC1 do nothing
  int core_conversions = 0;                         // conversions by the core, which waits for each

  // --- USB
  bool usb_open = false;
  bool usb_configured = true;  // a host has found the board
  bool usb_endpoint_open() const;
  // A program closes the port while a packet is being sent, so the core closes the endpoint too.
  void usb_close_under_way();
  bool usb_flushed = false;  // true: the FIFO of the endpoint was flushed after the close
  std::uint32_t usb_baud = 115200;
  bool usb_reads = true;  // the host's program reads
  std::string usb_host;   // bytes that the program has read and the test has not taken
  void usb_send(const std::string& bytes);
  std::deque<std::string> usb_packets;  // to the board
  struct UsbPacket {
    std::uint32_t size;
    std::uint64_t at_ms;
  };
  std::vector<UsbPacket> usb_sent;  // by the board

  // --- WiFi, for both threads
  std::mutex mutex;
  std::string air = "lab";  // the name of the network in range
  std::string air_password = "correct horse";
  bool wifi_hangs = false;  // joining never returns
  bool wifi_connected = false;
  int joins = 0;
  std::uint16_t udp_port = 0;
  std::deque<Datagram> udp_in, udp_out;

  // --- flash
  bool has_partition = true;
  std::atomic<bool> flash_hangs{false};
  bool flash_damaged = false;  // stored data cannot be read
  std::uint64_t partition_size = 1024 * 1024;
  std::map<std::string, std::string> stored;
  int writes = 0;

  // --- for the fakes
  void interrupts_may_come();
  struct Timer {
    std::uint64_t next_ns = 0;
    std::uint64_t period_ns = 0;  // 0: off
    std::function<void()> action;
  };
  Timer ticker, step_timer;
  std::map<int, void (*)()> vectors;
  std::map<int, std::uint32_t> priorities;
  std::array<std::atomic<bool>, 150>
      pending{};  // interrupts that the firmware requests, from any thread
  std::vector<void (*)()> usb_callbacks;
  static constexpr std::uintptr_t core_stack_in_use = 200;  // bytes, used when the core starts
  std::uint32_t primask = 0;
  bool in_interrupt = false;
  int interrupts = 0;
  std::map<int, std::function<void(bool)>> edges;  // PinName to the function for an edge
  bool flag = false;
  bool core_error = false;  // a fatal error
  int isr_queue = 0;        // requests of the running interrupt to the core
  [[noreturn]] void reset();
  void connect_registers();

 private:
  void connect_converter();
  // 0: SDA and SCL, 1: SDA1 and SCL1.
  I2cPeripheral& at_bus(int bus);
  void run_pending();
  void let_happen();
  std::uint64_t now_ns_ = 0;
  std::multimap<std::uint64_t, std::function<void()>> events_;
  std::array<std::uint32_t, 11> outside_{}, driven_{};
  std::array<std::array<int, 16>, 11> rises_{};
};

Giga& giga();

}  // namespace r4::fake
