// SPDX-License-Identifier: GPL-3.0-or-later
// Drives the winch of docs/design/contributing.md on the simulated board, and prints the faults.
// add_an_output.py compiles this file with the edit of that page.
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>

#include "firmware/ports/sim/simulated_hardware.hpp"
#include "protocol/messages/command_field.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/messages/datagram_writer.hpp"
#include "r4link/messages/packed_form.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4 {
namespace {

int faults = 0;
void expect(bool condition, const std::string& what) {
  if (condition) return;
  std::printf("wrong: %s\n", what.c_str());
  ++faults;
}

std::string str(Text text) { return {text.data(), text.size()}; }

class Host final : public firmware::Port {
 public:
  Host() : hardware_(model), application_(hardware_.hal(), firmware::Application::Config()) {
    model.power_on();
    hardware_.power_up();
    application_.add_port(*this);
    application_.start(now_ms_);
    run(1000);
    say("F:WINCH1,WINCH2,SAFE");
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

  // Runs the board with a heartbeat every 100 ms.
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
  std::string text;     // the newest state
  std::string refusal;  // the newest refusal

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
  host.say("L:1000,1,1");
  host.say("L:4000,0,2");
  expect(duty(8) == 1000 && duty(9) == 4096 && duty(10) == 4000 && duty(11) == 0, "the lines");
  const StateField field = state_field(FieldKind::winch, 2);
  expect(host.state.present.has(field) && numbers_of(host.state, field)[0] == 4000 &&
             host.state.raw.winch[0].pwm == 1000 && host.state.winch(2).pwm == 4000,
         "the state: " + host.text);
  expect(host.text.find("WINCH1:1000,1;WINCH2:4000,0;") != std::string::npos,
         "its text: " + host.text);
  std::uint8_t packed[max_datagram];
  char unpacked[max_datagram];
  const std::size_t size = pack(host.text, packed, sizeof packed);
  const UnpackResult result = unpack(packed, size, unpacked, sizeof unpacked);
  expect(size > 0 && size < host.text.size() && str(Text(unpacked, result.size)) == host.text,
         "the packed form on a CAN bus");
  host.say("L:5000,1,1");
  expect(host.refusal.find(",RANGE;") != std::string::npos, "the range: " + host.refusal);
  host.say("L:5,1,3");
  expect(host.refusal.find(",CHANNEL;") != std::string::npos, "the channel: " + host.refusal);
  expect(host.state.winch(1).pwm == 1000, "a refused command changes nothing: " + host.text);
  host.say("R:1,On");
  expect(host.state.winch(1).pwm == 0 && duty(8) == 0, "no motor starts when its supply comes");
  host.say("L:1000,1,1");
  host.say("E:STOP");
  expect(duty(8) == 0 && duty(9) == 0, "the lines in the safe state");
  expect(host.state.winch(1) == Drive() && host.state.winch(2) == Drive(),
         "the safe state: " + host.text);
  host.say("L:1000,1,1");
  expect(host.refusal.find(",SAFE;") != std::string::npos, "the safe state: " + host.refusal);
}

// `protocol`: the text of docs/reference/protocol.md.
void check_words(const std::string& protocol) {
  const CommandHelp& help = command_help(CommandKind::winch);
  expect(help.form == "L:pwm,dir,ch", "the help: " + help.form);
  const std::string row =
      "| `" + help.form + "` | " + std::string(help.meaning) + " | " + help.ranges;
  expect(protocol.find(row) != std::string::npos, "docs/reference/protocol.md has no " + row);
  const OwnCommand command = parse_command_text("L:4095,1,2");
  expect(describe(command) == "winch 2 forward, duty 1", "the description");
  expect(shown_by(CommandKind::winch) == FieldKind::winch, "the field that shows it");
}

}  // namespace
}  // namespace r4

int main(int, char** arguments) {
  std::ifstream protocol(arguments[1]);
  r4::check_board();
  r4::check_words({std::istreambuf_iterator<char>(protocol), {}});
  return r4::faults == 0 ? 0 : 1;
}
