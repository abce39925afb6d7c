// SPDX-License-Identifier: GPL-3.0-or-later
// The state fields in two tables (docs/protocol.md). A row of the first says what a field is of: a
// kind and a channel. A row of the second says what the values of that kind are: their form, units
// and place in State.
//
//     for (const StateFieldRow& row : state_fields) …   in the order of the wire
//     state_field(FieldKind::osmc, 2)                   StateField::osmc2
//     numbers_of(state, StateField::osmc2)[0]           its duty cycle, 0-4095
//     kind_row_of(StateField::osmc2).values[0].unit     "0-4095"
//
// Both tables are constants. A program that reads them only while it is compiled, as the firmware
// does, carries none of their texts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "../config.hpp"
#include "../state.hpp"
#include "../text.hpp"
#include "../vocabulary.hpp"

namespace r4 {

// clang-format off
enum class FieldKind : std::uint8_t {
  analog, handle, dhb12, osmc, stepper, servo, encoder, ultrasonic, bldc, relays,
  safe, last_command, rx_ok, rx_crc, rx_lost, rx_duplicate, rx_refused, late,
  encoder_hz, encoder_index, i2c, i2c_answer, i2c_bus, uart, dac, gpio, fault,
  count
};
// clang-format on
constexpr int field_kind_count = static_cast<int>(FieldKind::count);

// How the values of a field look on the wire, and which type of State's they are.
enum class FieldForm : std::uint8_t {
  volts,   // int32 in hundredths: "24.28"
  flag,    // bool: 0 or 1
  drive,   // Drive: pwm,direction
  bldc,    // Bldc: speed,direction,brake
  servo,   // uint16, 0-2500
  u8,      // uint8
  u16,     // uint16
  i32,     // int32
  u32,     // uint32
  reason,  // SafeReason
  fault,   // ChipFault: chip,trouble
  // of devices on the user's bus and UARTs (docs/devices.md)
  reading,  // I2cReading
  answer,   // I2cAnswer
  bus,      // I2cBusReport
  uart,     // UartBytes
};

struct StateFieldRow {
  Text name;  // on the wire
  StateField field;
  FieldKind kind;
  std::uint8_t channel;  // from 1; of a kind with one field it is 1
};

// clang-format off
#define R4_FIELD(field, name, kind, channel) \
  {name, StateField::field, FieldKind::kind, channel}
constexpr StateFieldRow state_fields[] = {
    R4_FIELD(ain24, "AIN24", analog, 1),
    R4_FIELD(ain12, "AIN12", analog, 2),
    R4_FIELD(ain5, "AIN5", analog, 3),
    R4_FIELD(aindmh, "AINDMH", analog, 4),
    R4_FIELD(dmhsta, "DMHSTA", handle, 1),
    R4_FIELD(ainsteer, "AINSTEER", analog, 5),
    R4_FIELD(dhb1a, "DHB1A", dhb12, 1),
    R4_FIELD(osmc1, "OSMC1", osmc, 1),
    R4_FIELD(step1pos, "STEP1POS", stepper, 1),
    R4_FIELD(servo1pos, "SERVO1POS", servo, 1),
    R4_FIELD(ain6, "AIN6", analog, 6),
    R4_FIELD(dhb1b, "DHB1B", dhb12, 2),
    R4_FIELD(dhb2a, "DHB2A", dhb12, 3),
    R4_FIELD(dhb2b, "DHB2B", dhb12, 4),
    R4_FIELD(osmc2, "OSMC2", osmc, 2),
    R4_FIELD(osmc3, "OSMC3", osmc, 3),
    R4_FIELD(osmc4, "OSMC4", osmc, 4),
    R4_FIELD(step2pos, "STEP2POS", stepper, 2),
    R4_FIELD(step3pos, "STEP3POS", stepper, 3),
    R4_FIELD(step4pos, "STEP4POS", stepper, 4),
    R4_FIELD(servo2pos, "SERVO2POS", servo, 2),
    R4_FIELD(servo3pos, "SERVO3POS", servo, 3),
    R4_FIELD(servo4pos, "SERVO4POS", servo, 4),
    R4_FIELD(servo5pos, "SERVO5POS", servo, 5),
    R4_FIELD(servo6pos, "SERVO6POS", servo, 6),
    R4_FIELD(servo7pos, "SERVO7POS", servo, 7),
    R4_FIELD(servo8pos, "SERVO8POS", servo, 8),
    R4_FIELD(servo9pos, "SERVO9POS", servo, 9),
    R4_FIELD(servo10pos, "SERVO10POS", servo, 10),
    R4_FIELD(servo11pos, "SERVO11POS", servo, 11),
    R4_FIELD(servo12pos, "SERVO12POS", servo, 12),
    R4_FIELD(servo13pos, "SERVO13POS", servo, 13),
    R4_FIELD(servo14pos, "SERVO14POS", servo, 14),
    R4_FIELD(servo15pos, "SERVO15POS", servo, 15),
    R4_FIELD(servo16pos, "SERVO16POS", servo, 16),
    R4_FIELD(enc1, "ENC1", encoder, 1),
    R4_FIELD(enc2, "ENC2", encoder, 2),
    R4_FIELD(enc3, "ENC3", encoder, 3),
    R4_FIELD(enc4, "ENC4", encoder, 4),
    R4_FIELD(us1, "US1", ultrasonic, 1),
    R4_FIELD(us2, "US2", ultrasonic, 2),
    R4_FIELD(us3, "US3", ultrasonic, 3),
    R4_FIELD(us4, "US4", ultrasonic, 4),
    R4_FIELD(bldc1, "BLDC1", bldc, 1),
    R4_FIELD(bldc2, "BLDC2", bldc, 2),
    R4_FIELD(bldc3, "BLDC3", bldc, 3),
    R4_FIELD(bldc4, "BLDC4", bldc, 4),
    R4_FIELD(relays, "RELAYS", relays, 1),
    R4_FIELD(safe, "SAFE", safe, 1),
    R4_FIELD(cmd, "CMD", last_command, 1),
    R4_FIELD(rxok, "RXOK", rx_ok, 1),
    R4_FIELD(rxcrc, "RXCRC", rx_crc, 1),
    R4_FIELD(rxlost, "RXLOST", rx_lost, 1),
    R4_FIELD(rxdup, "RXDUP", rx_duplicate, 1),
    R4_FIELD(rxref, "RXREF", rx_refused, 1),
    R4_FIELD(late, "LATE", late, 1),
    R4_FIELD(enc1hz, "ENC1HZ", encoder_hz, 1),
    R4_FIELD(enc2hz, "ENC2HZ", encoder_hz, 2),
    R4_FIELD(enc3hz, "ENC3HZ", encoder_hz, 3),
    R4_FIELD(enc4hz, "ENC4HZ", encoder_hz, 4),
    R4_FIELD(enc1idx, "ENC1IDX", encoder_index, 1),
    R4_FIELD(enc2idx, "ENC2IDX", encoder_index, 2),
    R4_FIELD(enc3idx, "ENC3IDX", encoder_index, 3),
    R4_FIELD(enc4idx, "ENC4IDX", encoder_index, 4),
    R4_FIELD(i2c1, "I2C1", i2c, 1),
    R4_FIELD(i2c2, "I2C2", i2c, 2),
    R4_FIELD(i2c3, "I2C3", i2c, 3),
    R4_FIELD(i2c4, "I2C4", i2c, 4),
    R4_FIELD(i2c5, "I2C5", i2c, 5),
    R4_FIELD(i2c6, "I2C6", i2c, 6),
    R4_FIELD(i2c7, "I2C7", i2c, 7),
    R4_FIELD(i2c8, "I2C8", i2c, 8),
    R4_FIELD(i2cx, "I2CX", i2c_answer, 1),
    R4_FIELD(i2cbus, "I2CBUS", i2c_bus, 1),
    R4_FIELD(uart1, "UART1", uart, 1),
    R4_FIELD(uart2, "UART2", uart, 2),
    R4_FIELD(dac1, "DAC1", dac, 1),
    R4_FIELD(dac2, "DAC2", dac, 2),
    R4_FIELD(gpio, "GPIO", gpio, 1),
    R4_FIELD(fault, "FAULT", fault, 1),
};
#undef R4_FIELD
// clang-format on

// One of the values of a field.
struct FieldValue {
  const char* name;  // "pwm"; "" if the field has one value only
  const char* unit;  // "V"; where there is none, the range: "0-4095"
};
constexpr int most_field_values = 3;

struct FieldKindRow {
  const char* name;  // "osmc"
  FieldKind kind;
  FieldForm form;
  std::uint16_t place;                   // of channel 1 in State; channel n is n-1 sizes after it
  std::uint16_t size;                    // of the value of a channel in State
  FieldValue values[most_field_values];  // those that are not there have no unit
  const char* help;                      // one sentence

  // True if the last value is not a number but the bytes of a device: "x3b00".
  constexpr bool has_bytes() const {
    return form == FieldForm::reading || form == FieldForm::answer || form == FieldForm::uart;
  }
  constexpr int value_count() const {
    int count = 0;
    while (count < most_field_values && values[count].unit != nullptr) ++count;
    return count;
  }
};

// clang-format off
#define R4_KIND(kind, form, member) \
  #kind, FieldKind::kind, FieldForm::form, static_cast<std::uint16_t>(offsetof(State, member)), \
      sizeof(std::remove_extent_t<decltype(std::declval<State&>().member)>)
constexpr FieldKindRow field_kinds[] = {
    {R4_KIND(analog, volts, raw.analog_cv), {{"", "V"}}, "The voltage of an analog input."},
    {R4_KIND(handle, flag, handle_held), {{"", "0/1"}}, "1 while the dead-man's handle is held."},
    {R4_KIND(dhb12, drive, raw.dhb12), {{"pwm", "0-4095"}, {"direction", "0/1"}},
     "The duty cycle and direction of a DHB12 motor driver."},
    {R4_KIND(osmc, drive, raw.osmc), {{"pwm", "0-4095"}, {"direction", "0/1"}},
     "The duty cycle and direction of an OSMC motor driver."},
    {R4_KIND(stepper, i32, raw.stepper_steps), {{"", "steps"}}, "The position of a stepper motor."},
    {R4_KIND(servo, servo, raw.servo_us), {{"", "us"}},
     "The pulse width of a servo. 0: there are no pulses."},
    {R4_KIND(encoder, i32, raw.encoder_counts), {{"", "counts"}}, "The count of an encoder."},
    {R4_KIND(ultrasonic, u16, raw.ultrasonic_cm), {{"", "cm"}},
     "The distance that an ultrasonic sensor measures. 0: there is no echo."},
    {R4_KIND(bldc, bldc, raw.bldc), {{"speed", "0-4095"}, {"direction", "0/1"}, {"brake", "0/1"}},
     "The speed, direction and brake of a brushless motor driver."},
    {R4_KIND(relays, u8, relays), {{"", "bits"}}, "The relays that are on: bit n-1 is relay n."},
    {R4_KIND(safe, reason, safe), {{"", "reason"}},
     "Why the outputs are in the safe state. 0: they are not."},
    {R4_KIND(last_command, u32, last_command), {{"", "PNum"}},
     "The packet number of the last command that the board executed. 0: there is none."},
    {R4_KIND(rx_ok, u32, rx_ok), {{"", "datagrams"}}, "The datagrams that the board accepted."},
    {R4_KIND(rx_crc, u32, rx_crc), {{"", "datagrams"}},
     "The datagrams that reached the board damaged."},
    {R4_KIND(rx_lost, u32, rx_lost), {{"", "datagrams"}},
     "The packet numbers of the controlling host that did not reach the board."},
    {R4_KIND(rx_duplicate, u32, rx_duplicate), {{"", "datagrams"}},
     "The datagrams that reached the board again."},
    {R4_KIND(rx_refused, u32, rx_refused), {{"", "commands"}},
     "The commands that the board refused."},
    {R4_KIND(late, u32, late), {{"", "periods"}},
     "The states that were left out because the board's loop was late."},
    {R4_KIND(encoder_hz, i32, raw.encoder_hz), {{"", "counts/s"}},
     "The speed of an encoder. It is negative backwards."},
    {R4_KIND(encoder_index, i32, raw.encoder_index_counts), {{"", "counts"}},
     "The count of an encoder when its index line rose last. 0 before the first time."},
    {R4_KIND(i2c, reading, raw.i2c),
     {{"t", "ms"}, {"errors", "transfers"}, {"bytes", "hex"}},
     "The newest repeated reading of a device on the user's I2C bus."},
    {R4_KIND(i2c_answer, answer, i2c_answer),
     {{"command", "PNum"}, {"outcome", "0-3"}, {"bytes", "hex"}},
     "The newest single transfer on the user's I2C bus."},
    {R4_KIND(i2c_bus, bus, i2c_bus),
     {{"outcome", "0-3"}, {"errors", "transfers"}, {"recoveries", "times"}},
     "The state of the user's I2C bus."},
    {R4_KIND(uart, uart, raw.uart),
     {{"position", "bytes"}, {"lost", "bytes"}, {"bytes", "hex"}},
     "The newest bytes that one of the user's UARTs received."},
    {R4_KIND(dac, u16, raw.dac_mv), {{"", "mV"}}, "One of the user's output voltages."},
    {R4_KIND(gpio, u8, gpio), {{"", "bits"}},
     "The spare inputs that are high: bit n-1 is input n."},
    {R4_KIND(fault, fault, fault), {{"chip", "address"}, {"trouble", "bits"}},
     "The chip of the board that has a fault, and which fault."},
};
#undef R4_KIND
// clang-format on

constexpr const StateFieldRow& row_of(StateField field) {
  return state_fields[static_cast<int>(field)];
}
constexpr const FieldKindRow& row_of(FieldKind kind) { return field_kinds[static_cast<int>(kind)]; }
constexpr const FieldKindRow& kind_row_of(StateField field) { return row_of(row_of(field).kind); }

// The field of a channel, from 1. StateField::count if there is none.
R4LINK_API StateField state_field(FieldKind kind, int channel);

// The numbers of a field in the order and units of its kind. Bytes of a device are no numbers: the
// values of FieldForm::reading, answer and uart are the first two.
struct StateNumbers {
  int count;
  double values[most_field_values];
  double operator[](int i) const { return values[i]; }
};
R4LINK_API StateNumbers numbers_of(const State& state, StateField field);
// Writes what numbers_of() reads, rounded to what the field can hold. `present` stays. False, with
// the state unchanged, if a number is outside the range of the field, if the field has not so many
// numbers, or if it has bytes.
R4LINK_API bool set_numbers(State& state, StateField field, const StateNumbers& numbers);

}  // namespace r4
