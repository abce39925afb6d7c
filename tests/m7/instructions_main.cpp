// SPDX-License-Identifier: GPL-3.0-or-later
// The cost of the protocol on a Cortex-M7, in instructions. With `-icount shift=10` an instruction
// takes 1024 ns of the board's time, so the timer counts instructions. A loop of known length gives
// the number of ticks per instruction.
#include <new>

#include "firmware/application/application.hpp"
#include "firmware/ports/m7/chip/board_clock.hpp"
#include "firmware/ports/m7/chip/semihosting.hpp"
#include "firmware/ports/m7/startup.hpp"
#include "firmware/ports/sim/robot/board_model.hpp"
#include "on_target.hpp"
#include "protocol/datagram/crc32.hpp"
#include "protocol/messages/device_command.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/datagram.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/packed_form.hpp"
#include "r4link/state.hpp"
#include "transports/framing/can/isotp_sender.hpp"

namespace {

using namespace r4;
using namespace r4::m7;

// Runs 2 * `turns` instructions and a small constant number of other instructions.
__attribute__((noinline)) void loop(std::uint32_t turns) {
  asm volatile("1: subs %0, #1\n\tbne 1b" : "+r"(turns) : : "cc");
}

// Repetitions between two readings of the timer. Reading the timer also takes instructions. The
// repetitions make the share of the reading small.
constexpr std::uint32_t repetitions = 100;

template <class Work>
std::uint32_t ticks_of(Work&& work) {
  work();  // the first call includes one-time setup
  const std::uint32_t before = BoardClock::ticks();
  for (std::uint32_t i = 0; i < repetitions; ++i) work();
  return BoardClock::ticks() - before;
}

std::uint32_t ticks_per_million = 0;

void calibrate() {
  const std::uint32_t before = BoardClock::ticks();
  loop(500000);
  ticks_per_million = BoardClock::ticks() - before;
}

template <class Work>
std::uint32_t instructions_of(Work&& work) {
  const std::uint64_t ticks = ticks_of(work);
  return static_cast<std::uint32_t>(ticks * 1000000 / ticks_per_million / repetitions);
}

// Accepts every datagram and discards it.
class Sink final : public firmware::Port {
 public:
  void send(Text datagram, Priority, std::uint32_t) override { size_ = datagram.size(); }
  std::size_t max_size() const override { return max_datagram; }

 private:
  volatile std::size_t size_ = 0;
};

// This Hal costs almost no instructions, because the chips' cost is not part of the protocol.
class Hal final : public firmware::Hal {
 public:
  void apply(const firmware::Outputs& outputs) override { pwm_ = outputs.osmc[0].pwm; }
  void make_safe() override { pwm_ = 0; }
  void sample(firmware::Inputs& inputs) override { inputs.handle = Handle::held; }
  void zero(int) override {}
  bool clear_fault() override { return true; }
  std::uint16_t pwm() const { return pwm_; }

 private:
  std::uint16_t pwm_ = 0;
};

// A bus with simulated chips until set_free(). After set_free(), every write succeeds and costs
// almost nothing.
class Bus final : public firmware::I2cBus {
 public:
  firmware::I2cResult write(std::uint8_t address, const std::uint8_t* bytes,
                            std::size_t size) override {
    ++writes_;
    return free_ ? firmware::I2cResult::ok : chips_.bus.write(address, bytes, size);
  }
  firmware::I2cResult write_read(std::uint8_t address, const std::uint8_t* out,
                                 std::size_t out_size, std::uint8_t* in,
                                 std::size_t in_size) override {
    return chips_.bus.write_read(address, out, out_size, in, in_size);
  }
  bool recover() override { return chips_.bus.recover(); }

  void pass_millisecond() { chips_.bus.advance(1000); }
  void set_free() { free_ = true; }
  std::uint32_t writes() const { return writes_; }

 private:
  sim::BoardChips chips_;
  bool free_ = false;
  std::uint32_t writes_ = 0;
};

// A state as in the paper's capture: 154 bytes.
State captured() {
  State state;
  state.raw.analog_cv[0] = 2428;
  state.raw.analog_cv[1] = 1215;
  state.raw.analog_cv[2] = 511;
  state.raw.analog_cv[3] = 1219;
  state.raw.analog_cv[4] = 103;
  state.handle = Handle::held;
  return state;
}

Text written(const State& state, char* buffer) {
  DatagramWriter writer(buffer, max_datagram);
  for (const StateField field : FieldSet::paper_default()) write_field(writer, field, state);
  return writer.finish(22, 79146);
}

// If there is a signer, signs the datagram.
void sign(Signer* signer, DatagramWriter& writer) {
  if (signer != nullptr) signer->sign(writer, 1700000000000000, 1000);
}

constexpr SessionId session = 0x0123456789abcdef;

// Instructions to read, check and execute one datagram with `group` commands. Each datagram has a
// new packet number. If there is a key, each datagram is signed.
std::uint32_t command_instructions(firmware::Hal& hal, std::uint32_t first, SessionId sid,
                                   const Key* key = nullptr, std::uint32_t group = 1) {
  Sink sink;
  static firmware::Application::Config config;
  config = firmware::Application::Config();
  const std::uint8_t chance[Authentication::chance_size] = {1};
  config.chance = chance;
  if (key != nullptr) config.settings.site.keys[0] = *key;
  // All calls use the same static memory, because the stack is too small for an application.
  alignas(firmware::Application) static unsigned char place[sizeof(firmware::Application)];
  firmware::Application& application = *new (place) firmware::Application(hal, config);
  const std::uint8_t port = application.add_port(sink);
  Signer key_signer(key != nullptr ? *key : Key());
  key_signer.on_nonce(application.authentication().nonce());
  key_signer.on_board_time(1000, 1000);
  Signer* const signer = key != nullptr ? &key_signer : nullptr;
  static char commands[repetitions + 1][128];
  static Text texts[repetitions + 1];
  application.start(1000);
  for (std::uint32_t i = 0; i < 2; ++i) {  // the second heartbeat echoes the board's answer
    DatagramWriter heartbeat(commands[0], sizeof commands[0]);
    heartbeat.field("H").value("ROS2-R4");
    heartbeat.session(sid);
    heartbeat.stamp(first - 2 + i, 1000 * i);
    sign(signer, heartbeat);
    application.receive(port, 1, heartbeat.finish(), 1000);
  }
  for (std::uint32_t i = 0; i <= repetitions; ++i) {
    DatagramWriter command(commands[i], sizeof commands[i]);
    for (std::uint32_t channel = 1; channel <= group; ++channel) {
      command.field("O").value(std::uint32_t{358 + i % 2}).value(std::uint32_t{1}).value(channel);
    }
    command.session(sid);
    sid != no_session ? command.packet(first + i) : command.stamp(first + i, 79146);
    sign(signer, command);
    texts[i] = command.finish();
  }
  std::uint32_t next = 0;
  const std::uint32_t count =
      instructions_of([&] { application.receive(port, 1, texts[next++], 1000); });
  // The count is valid only if the board executed all commands.
  const bool done = application.state() == firmware::BoardState::active &&
                    application.link().last_executed() == first + repetitions &&
                    application.outputs().osmc[group - 1].pwm == 358;
  return done ? count : 0;
}

// Like command_instructions(), with the drivers of all channels.
std::uint32_t with_drivers() {
  static Bus bus;
  static sim::BoardModel around(1);
  static firmware::BoardHardware hardware(bus, around.microcontroller_pins(plan_wiring()), {});
  hardware.power_up(0);
  for (std::uint32_t ms = 1; ms <= 100; ++ms) {
    bus.pass_millisecond();
    hardware.poll(ms * 1000);
  }
  bus.set_free();
  const std::uint32_t before = bus.writes();
  const std::uint32_t count = command_instructions(hardware, 1500001000, session);
  if (count == 0 || bus.writes() - before < repetitions) exit_emulator(5);
  return count;
}

// A bus on which each transfer ends at the next call of progress().
class UserWire final : public firmware::UserI2cPort {
 public:
  void begin(const firmware::UserTransfer& transfer) override {
    for (std::size_t i = 0; i < transfer.in_size; ++i)
      transfer.in[i] = static_cast<std::uint8_t>(i);
    ++transfers;
  }
  Progress progress() override { return Progress::done; }
  void release() override {}
  void drive(bool, bool) override {}
  bool scl_is_high() override { return true; }
  bool sda_is_high() override { return true; }
  void resume() override {}
  std::uint32_t transfers = 0;
};

// Instructions for one of eight readings of the user's bus, which takes two calls of poll().
std::uint32_t reading_instructions() {
  static UserWire wire;
  static firmware::UserI2c bus(wire);
  std::uint32_t now_ms = 1000;
  for (int slot = 1; slot <= i2c_slots; ++slot) {
    bus.poll_slot(slot, poll_of(Command::i2c_poll(slot, 0x68, "x3B", 14, 8)),
                  now_ms + static_cast<std::uint32_t>(slot));
  }
  now_ms += 20;
  const std::uint32_t count = instructions_of([&] {
    bus.poll(++now_ms);
    bus.poll(now_ms);
  });
  return wire.transfers >= repetitions && bus.reading(8).data.size == 14 ? count : 0;
}

}  // namespace

int main() {
  BoardClock clock(0);
  clock.start();
  calibrate();

  static char buffer[max_datagram];
  const State state = captured();
  Text datagram = written(state, buffer);
  const std::uint32_t writing = instructions_of([&] { datagram = written(state, buffer); });
  if (datagram.size() < 140 || datagram.size() > 160) exit_emulator(1);
  on_target::say_number("a state with the default fields, written", writing);

  Datagram seen;
  on_target::say_number("that state, read and checked",
                        instructions_of([&] { read_datagram(datagram, seen); }));

  static Hal hal;
  const std::uint32_t command = command_instructions(hal, 1000, no_session);
  const std::uint32_t of_session = command_instructions(hal, 1500001000, session);
  if (command == 0 || of_session == 0) exit_emulator(2);
  on_target::say_number("a command read, checked and executed", command);
  on_target::say_number("one of a session with an id", of_session);
  on_target::say_number("that, written to its chip by the drivers", with_drivers());
  Key key;
  key.id = 1;
  const std::uint32_t signed_command = command_instructions(hal, 1500001000, session, &key);
  if (signed_command == 0) exit_emulator(6);
  on_target::say_number("that command signed, on a board with a key", signed_command);
  const std::uint32_t group = command_instructions(hal, 1500001000, no_session, nullptr, 4);
  if (group == 0) exit_emulator(7);
  on_target::say_number("a group of four commands, all executed", group);

  static char bytes[170];
  for (std::size_t i = 0; i < sizeof bytes; ++i) bytes[i] = static_cast<char>(i);
  volatile std::uint32_t crc = 0;
  on_target::say_number("CRC-32 of 154 bytes",
                        instructions_of([&] { crc = crc32(Text(bytes, 154)); }));

  IsotpSenderOptions options;
  options.channel.id = 0x401;
  options.flow_control = false;
  static IsotpSender sender(options);
  std::uint32_t frames = 0;
  const std::uint32_t cutting = instructions_of([&] {
    CanFrame frame;
    sender.begin(bytes, sizeof bytes, 0);
    while (sender.offer(0, frame)) {
      sender.frame_sent(0);
      ++frames;
    }
  });
  if (frames != 25 * (repetitions + 1)) exit_emulator(3);
  on_target::say_number("170 bytes cut into ISO-TP frames", cutting);

  static std::uint8_t packed[max_datagram];
  std::size_t size = 0;
  const std::uint32_t packing =
      instructions_of([&] { size = pack(datagram, packed, sizeof packed); });
  if (size == 0) exit_emulator(4);
  on_target::say_number("that state, packed", packing);

  const std::uint32_t reading = reading_instructions();
  if (reading == 0) exit_emulator(8);
  on_target::say_number("14 bytes of a user's device, one of eight", reading);
  exit_emulator(0);
}
