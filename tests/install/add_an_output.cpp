// SPDX-License-Identifier: GPL-3.0-or-later
// Drives the lamp of docs/contributing.md on the simulated board: add_an_output.py compiles this with
// the edit of that page. Prints what is wrong.
#include <cstdio>
#include <string>

#include "firmware/ports/sim/simulated_hardware.hpp"
#include "protocol/datagram/datagram_writer.hpp"
#include "protocol/messages/command_field.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/tables/state_fields.hpp"
#include "transports/framing/can/packed_form.hpp"

namespace r4 {
namespace {

int faults = 0;
void expect(bool condition, const std::string& what) {
  if (condition) return;
  std::printf("wrong: %s\n", what.c_str());
  ++faults;
}

std::string str(Text text) { return {text.data(), text.size()}; }

// A board with a host that stands beside it.
class Host final : public firmware::Port {
 public:
  Host() : hardware_(model), application_(hardware_.hal(), firmware::Application::Config()) {
    model.power_on();
    hardware_.power_up();
    application_.add_port(*this);
    application_.start(now_ms_);
    run(1000);
    say("F:LAMP1,LAMP2,SAFE");
    say("E:CLEAR");
  }

  void send(Text datagram, Priority, Peer) override {
    Datagram read;
    expect(bool{read_datagram(datagram, read)}, "the board's datagram: " + str(datagram));
    if (kind_of(read) == MessageKind::board_heartbeat) echo_ms_ = read.time_ms();
    if (kind_of(read) == MessageKind::nack) refusal = str(datagram);
    if (kind_of(read) != MessageKind::state) return;
    text = str(datagram);
    expect(read_state(read, state), "a state: " + text);
  }

  std::size_t max_size() const override { return max_datagram; }

  // With a heartbeat each 100 ms.
  void run(int ms) {
    for (int i = 0; i < ms; ++i, ++now_ms_) {
      if (i % 100 == 0) receive("H:ROS2-R4");
      application_.poll(now_ms_);
      hardware_.pass_millisecond();
    }
  }
  void say(Text command) {
    receive(command);
    run(100);
  }

  sim::BoardModel model{1};
  State state;
  std::string text;     // of the newest state
  std::string refusal;  // the newest

 private:
  void receive(Text field) {
    char buffer[max_datagram];
    DatagramWriter writer(buffer, sizeof buffer);
    Field read;
    expect(read_field(field, read), "a field: " + str(field));
    writer.field(read.name()).values(read.values());
    application_.receive(0, everyone, writer.session(1).finish(pnum_++, echo_ms_), now_ms_);
  }

  std::uint32_t now_ms_ = 1000;
  std::uint32_t pnum_ = 1;
  std::uint64_t echo_ms_ = 0;
  sim::SimulatedHardware hardware_;
  firmware::Application application_;
};

void check_board() {
  Host host;
  const auto duty = [&host](int line) { return host.model.chips().osmc.duty(line); };
  host.say("L:1000,1");
  host.say("L:4000,2");
  expect(duty(8) == 1000 && duty(9) == 4000, "the lines of both lamps");
  const StateField field = state_field(FieldKind::lamp, 2);
  expect(host.state.present.has(field) && numbers_of(host.state, field)[0] == 4000 &&
             host.state.raw.lamp[0] == 1000 && host.state.lamp(2) == 4000,
         "the state: " + host.text);
  expect(host.text.find("LAMP1:1000;LAMP2:4000;") != std::string::npos, "its text: " + host.text);
  std::uint8_t packed[max_datagram];
  char unpacked[max_datagram];
  const std::size_t size = pack(host.text, packed, sizeof packed);
  const UnpackResult result = unpack(packed, size, unpacked, sizeof unpacked);
  expect(size > 0 && size < host.text.size() && str(Text(unpacked, result.size)) == host.text,
         "the packed form on a CAN bus");
  host.say("L:5000,1");
  expect(host.refusal.find(",RANGE;") != std::string::npos, "the range: " + host.refusal);
  host.say("L:5,3");
  expect(host.refusal.find(",CHANNEL;") != std::string::npos, "the channel: " + host.refusal);
  expect(host.state.lamp(1) == 1000, "a refused command changes nothing: " + host.text);
  host.say("E:STOP");
  expect(duty(8) == 0 && duty(9) == 0, "the lines in the safe state");
  expect(host.state.lamp(1) == 0 && host.state.lamp(2) == 0, "the safe state: " + host.text);
  host.say("L:1000,1");
  expect(host.refusal.find(",SAFE;") != std::string::npos, "the safe state: " + host.refusal);
}

void check_words() {
  const CommandHelp& help = command_help(CommandKind::lamp);
  expect(help.form == "L:pwm,ch" && help.ranges == "pwm 0-4095, ch 1-2", "the help: " + help.form);
  const OwnCommand command = parse_command_text("L:1000,2");
  expect(describe(command.get()) == "lamp 2 at 1000", "the description");
  const FieldKindRow& kind = row_of(FieldKind::lamp);
  expect(std::string(kind.values[0].unit) == "0-4095" && shown_by(CommandKind::lamp) == kind.kind,
         "the field's unit");
}

}  // namespace
}  // namespace r4

int main() {
  r4::check_board();
  r4::check_words();
  return r4::faults == 0 ? 0 : 1;
}
