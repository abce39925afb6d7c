// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/commissioning/findings.hpp"

#include <algorithm>
#include <array>
#include <iterator>

namespace r4::commissioning {
namespace {

constexpr std::array<FindingText, static_cast<std::size_t>(Finding::count)> finding_texts{{
    {"wiring damaged", "The stored wiring cannot be read: nothing is connected.",
     "Give it again: r4 wiring give FILE URL."},
    {"not kept", "The board does not keep what it was given over a restart.",
     "See what `report` says about its settings, and run QSPIFormat (docs/how-to/firmware.md)."},
    {"chip absent", "The chip does not answer at any address.",
     "Look at its supply, its solder joints, SDA and SCL; if it is not fitted, its place in the "
     "wiring is none."},
    {"chip at another address", "The chip answers at another address than the wiring says.",
     "Give the learnt wiring, or change the address jumpers of the chip."},
    {"chips on the other bus", "The chips answer on the other I2C bus than the wiring says.",
     "Give the learnt wiring, or change the connection of SDA and SCL."},
    {"chip in trouble", "The chip answers, but does not work as it should.",
     "Look at its supply and at the bus: noise, short circuits, pull-ups."},
    {"divider wrong", "The input shows another voltage than the meter, by more than a tenth.",
     "Turn the potentiometer of its divider, or give the learnt full scale."},
    {"no voltage", "The meter shows a voltage, and the input none.",
     "Look at the input's plug, its divider and the pin of the Giga."},
    {"handle inverted", "The input of the handle is high while the handle is released.",
     "Give the learnt wiring (handle low), or change the handle's circuit."},
    {"handle elsewhere", "The handle is connected to another pin than the wiring says.",
     "Give the learnt wiring, or move the wire."},
    {"handle missing", "The input of the handle stays low.",
     "Look at the wire and the 12 V of its circuit; if the board has no handle, its place in the "
     "wiring is none."},
    {"handle stuck", "The input of the handle stays high: letting go would not stop the robot.",
     "Look for a short circuit or a stuck button before anything moves."},
    {"encoder channel dead", "Only one of the encoder's channels A and B changes.",
     "Look at the wire and the pull-up of the other channel."},
    {"encoder silent", "The encoder does not count.",
     "Look at its supply, at both channels, and at the shaft's coupling."},
    {"echo unsteady", "The distance jumps although the hand is still.",
     "Look at the echo wire: a floating input, or a divider that is missing."},
    {"ultrasonic silent", "The sensor does not see the hand.",
     "Look at its 5 V, and at its trigger and echo wires."},
    {"ultrasonic blocked", "The sensor sees something although the way is free.",
     "Look for an obstacle, or an echo line that falls early."},
    {"user bus stuck", "The user's I2C bus does not work.",
     "Look at SDA1 and SCL1: pull-ups, short circuits, a device that holds a line."},
    {"uart silent", "The device at the UART sends nothing.",
     "Look at its supply, and at RX and TX, which may be exchanged."},
    {"uart damaged", "Bytes of the device are damaged.",
     "Look at its speed and framing: C:uart1,115200:8N1."},
    {"transport dead", "The board does not answer over this transport.",
     "r4 doctor URL names the reason."},
    {"relay dead", "The relay does not click.", "Look at the relay, its driver and its supply."},
    {"no motor supply", "The motors have no supply although relay 1 is closed.",
     "Look at the circuit of the handle, relay 1 and the motor supply (docs/reference/safety.md)."},
    {"relay 1 not in supply", "The motors have supply although relay 1 is open.",
     "Do not drive: nothing takes the supply away in the safe state. Put relay 1 into the circuit "
     "(docs/reference/safety.md)."},
    {"servo without supply", "The servo's header has no 5 V.",
     "Connect a regulator to the 5 V input of the board (paper, section 8.3)."},
    {"does not move", "Nothing moved.",
     "Look at the driver, its supply, its plug, and at the line in the wiring."},
    {"reversed", "It goes the other way than commanded.",
     "Give the learnt wiring (inverted), or exchange the wires."},
    {"two pwm",
     "The driver has an input for each direction, and the wiring says pwm and direction.",
     "Give the learnt wiring (two-pwm)."},
    {"one way", "It does not go forward as it goes backward.",
     "Look at the direction line, and at the driver."},
    {"exchanged", "Another one moves or answers in its place.",
     "Give the learnt wiring, or exchange the plugs."},
    {"silence too long", "The outputs were on for longer than the timeout without a heartbeat.",
     "Look at the setting `timeout`: r4 send URL C:timeout,1000."},
    {"rolls on", "The encoder went on counting in the safe state.",
     "Look at the driver: it drives without a command, or the robot rolls by itself."},
    {"stop too slow", "The outputs were not off in time after a stop.",
     "Look at the transport: r4 bench URL."},
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
