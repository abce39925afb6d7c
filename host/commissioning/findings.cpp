// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commissioning/findings.hpp"

#include <algorithm>
#include <array>
#include <iterator>

namespace r4::commissioning {
namespace {

constexpr std::array<FindingText, static_cast<std::size_t>(Finding::count)> finding_texts{{
    {"wiring damaged", "The stored wiring cannot be read, so no signal is connected.",
     "Give the wiring again: r4 wiring give FILE URL."},
    {"not kept", "The board loses its settings when it restarts.",
     "Send the line `report`, read its part about settings, and run QSPIFormat "
     "(docs/how-to/firmware.md)."},
    {"chip absent", "The chip does not answer at any address.",
     "Check the chip's supply, solder joints, SDA and SCL; if the chip is not fitted, write none "
     "as its place in the wiring."},
    {"chip at another address",
     "The chip does not answer at the address in the wiring, but at another address.",
     "Give the learnt wiring, or change the address jumpers of the chip."},
    {"chips on the other bus",
     "The chips do not answer on the I2C bus in the wiring, but on the other bus.",
     "Give the learnt wiring, or change the connection of SDA and SCL."},
    {"chip in trouble", "The chip answers, but does not work correctly.",
     "Check the chip's supply, and the bus for noise, short circuits and missing pull-ups."},
    {"divider wrong", "The voltage of the input differs from the meter by more than a tenth.",
     "Turn the potentiometer of the input's divider, or give the learnt full scale."},
    {"no voltage", "The meter shows a voltage, but the input shows 0 V.",
     "Check the input's plug, its divider and the pin of the Giga."},
    {"handle inverted", "The input of the handle is high while the handle is released.",
     "Give the learnt wiring (handle low), or change the handle's circuit."},
    {"handle elsewhere",
     "The handle is not connected to the pin in the wiring, but to another pin.",
     "Give the learnt wiring, or move the wire."},
    {"handle missing", "The input of the handle stays low.",
     "Check the wire and the 12 V of the handle's circuit; if the board has no handle, write none "
     "as its place in the wiring."},
    {"handle stuck",
     "The input of the handle stays high: the robot would not stop when the handle is released.",
     "Find the short circuit or the stuck button before you move the robot."},
    {"encoder channel dead", "Only one of the encoder's channels A and B changes.",
     "Check the wire and the pull-up of the other channel."},
    {"encoder silent", "The encoder does not count.",
     "Check the encoder's supply, both channels and the coupling of the shaft."},
    {"echo unsteady", "The distance jumps although the hand is still.",
     "Check the echo wire for a floating input or a missing divider."},
    {"ultrasonic silent", "The sensor does not see the hand.",
     "Check the sensor's 5 V, and its trigger and echo wires."},
    {"ultrasonic blocked", "The sensor sees an obstacle, but the way is free.",
     "Check for an obstacle, or an echo line that falls early."},
    {"user bus stuck", "The user's I2C bus does not work.",
     "Check SDA1 and SCL1 for missing pull-ups, short circuits or a device that holds a line."},
    {"uart silent", "The device at the UART sends nothing.",
     "Check the device's supply, and whether RX and TX are exchanged."},
    {"uart damaged", "Bytes of the device are damaged.",
     "Check the speed and framing of the UART, such as C:uart1,115200:8N1."},
    {"transport dead", "The board does not answer over this transport.",
     "Find the reason with r4 doctor URL."},
    {"relay dead", "The relay does not click.", "Check the relay, its driver and its supply."},
    {"no motor supply", "Relay 1 is closed, but the motors have no supply.",
     "Check the circuit of the handle, relay 1 and the motor supply (docs/reference/safety.md)."},
    {"relay 1 not in supply", "Relay 1 is open, but the motors have supply.",
     "Do not drive: the motors keep their supply in the safe state. Put relay 1 into the circuit "
     "(docs/reference/safety.md)."},
    {"servo without supply", "The servo's header has no 5 V.",
     "Connect a regulator to the 5 V input of the board (paper, section 8.3)."},
    {"does not move", "Nothing moved.",
     "Check the driver, its supply, its plug, and its line in the wiring. If a motor hums, a tenth "
     "of full duty may be too little for this motor: try a higher duty with r4 send."},
    {"reversed", "The movement is in the opposite direction of the command.",
     "Give the learnt wiring (inverted), or exchange the wires."},
    {"two pwm",
     "The driver has one input for each direction, but the wiring has pwm and direction.",
     "Give the learnt wiring (two-pwm)."},
    {"one way", "The motor does not turn forward as it turns backward.",
     "Check the direction line and the driver."},
    {"exchanged", "Another output moves, or another input answers.",
     "Give the learnt wiring, or exchange the plugs."},
    {"silence too long", "Without a heartbeat, the outputs were on for longer than the timeout.",
     "Check the setting `timeout`: r4 send URL C:timeout,1000."},
    {"rolls on", "The encoder continued to count in the safe state.",
     "Check whether the driver drives without a command, or the robot rolls by itself."},
    {"stop too slow", "The outputs were not off in time after a stop.",
     "Measure the transport with r4 bench URL."},
}};
static_assert(!finding_texts.back().fix.empty(), "each Finding has its text");

}  // namespace

const FindingText& text_of(Finding finding) {
  return finding_texts.at(static_cast<std::size_t>(finding));
}

Finding finding_named(std::string_view name) {
  const auto* const found = std::find_if(finding_texts.begin(), finding_texts.end(),
                                         [&](const auto& each) { return each.name == name; });
  return static_cast<Finding>(found - finding_texts.begin());
}

}  // namespace r4::commissioning
