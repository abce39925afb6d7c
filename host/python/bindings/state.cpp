// SPDX-License-Identifier: GPL-3.0-or-later
// A state: each field of the board an attribute, made when it is asked for.
#include <chrono>
#include <cmath>
#include <string>

#include "pickle.hpp"

namespace r4::python {
namespace {

using F = StateField;

// Which of its kind a field is, from 0; -1: it is not of that kind. The board sends the first of some kinds
// in the paper's set, before all others.
int nth(F field, F first, F last) {
  const int n = static_cast<int>(field) - static_cast<int>(first);
  return n >= 0 && field <= last ? n : -1;
}
int nth(F field, F first, F second, F last) {
  if (field == first) return 0;
  const int n = nth(field, second, last);
  return n < 0 ? -1 : n + 1;
}

}  // namespace

Form form_of(F field) {
  if (nth(field, F::ain24, F::aindmh) >= 0 || field == F::ainsteer || field == F::ain6) {
    return Form::volts;
  }
  if (nth(field, F::osmc1, F::osmc2, F::osmc4) >= 0 ||
      nth(field, F::dhb1a, F::dhb1b, F::dhb2b) >= 0) {
    return Form::drive;
  }
  if (nth(field, F::bldc1, F::bldc4) >= 0) return Form::bldc;
  if (field == F::dmhsta) return Form::flag;
  if (field == F::safe) return Form::safe;
  if (nth(field, F::i2c1, F::i2c8) >= 0) return Form::reading;
  if (field == F::i2cx) return Form::answer;
  if (field == F::i2cbus) return Form::bus;
  if (nth(field, F::uart1, F::uart2) >= 0) return Form::uart;
  return field == F::fault ? Form::fault : Form::number;
}

Numbers numbers_of(const State& state, F field) {
  if (const int n = nth(field, F::ain24, F::aindmh); n >= 0) return {state.raw.analog_cv[n]};
  if (const int n = nth(field, F::osmc1, F::osmc2, F::osmc4); n >= 0) {
    return {state.raw.osmc[n].pwm, static_cast<int>(state.raw.osmc[n].direction)};
  }
  if (const int n = nth(field, F::dhb1a, F::dhb1b, F::dhb2b); n >= 0) {
    return {state.raw.dhb12[n].pwm, static_cast<int>(state.raw.dhb12[n].direction)};
  }
  if (const int n = nth(field, F::bldc1, F::bldc4); n >= 0) {
    const Bldc& bldc = state.raw.bldc[n];
    return {bldc.speed, static_cast<int>(bldc.direction), bldc.brake ? 1 : 0};
  }
  if (const int n = nth(field, F::step1pos, F::step2pos, F::step4pos); n >= 0) {
    return {state.raw.stepper_steps[n]};
  }
  if (const int n = nth(field, F::servo1pos, F::servo2pos, F::servo16pos); n >= 0) {
    return {state.raw.servo_us[n]};
  }
  if (const int n = nth(field, F::enc1, F::enc4); n >= 0) return {state.raw.encoder_counts[n]};
  if (const int n = nth(field, F::enc1hz, F::enc4hz); n >= 0) return {state.raw.encoder_hz[n]};
  if (const int n = nth(field, F::enc1idx, F::enc4idx); n >= 0) {
    return {state.raw.encoder_index_counts[n]};
  }
  if (const int n = nth(field, F::us1, F::us4); n >= 0) return {state.raw.ultrasonic_cm[n]};
  if (const int n = nth(field, F::i2c1, F::i2c8); n >= 0) {
    return {state.raw.i2c[n].t_ms, state.raw.i2c[n].errors};
  }
  if (const int n = nth(field, F::uart1, F::uart2); n >= 0) {
    return {state.raw.uart[n].position, state.raw.uart[n].lost};
  }
  if (const int n = nth(field, F::dac1, F::dac2); n >= 0) return {state.raw.dac_mv[n]};
  switch (field) {
    case F::gpio:
      return {state.gpio};
    case F::ainsteer:
      return {state.raw.analog_cv[static_cast<int>(Analog::ainsteer)]};
    case F::ain6:
      return {state.raw.analog_cv[static_cast<int>(Analog::ain6)]};
    case F::dmhsta:
      return {state.handle_held ? 1 : 0};
    case F::relays:
      return {state.relays};
    case F::safe:
      return {static_cast<int>(state.safe)};
    case F::cmd:
      return {state.last_command};
    case F::rxok:
      return {state.rx_ok};
    case F::rxcrc:
      return {state.rx_crc};
    case F::rxlost:
      return {state.rx_lost};
    case F::rxdup:
      return {state.rx_duplicate};
    case F::rxref:
      return {state.rx_refused};
    case F::late:
      return {state.late};
    case F::i2cx:
      return {state.i2c_answer.pnum, static_cast<int>(state.i2c_answer.outcome)};
    case F::i2cbus:
      return {static_cast<int>(state.i2c_bus.newest), state.i2c_bus.errors,
              state.i2c_bus.recoveries};
    case F::fault:
      return {state.fault.address, static_cast<int>(state.fault.trouble)};
    default:
      return {};
  }
}

py::object value_of(const State& state, F field) {
  const Numbers numbers = numbers_of(state, field);
  switch (form_of(field)) {
    case Form::volts:
      return py::float_(static_cast<double>(numbers[0]) / 100.0);
    case Form::flag:
      return py::bool_(numbers[0] != 0);
    case Form::drive:
      return to_python(
          Drive{static_cast<std::uint16_t>(numbers[0]), static_cast<Direction>(numbers[1])});
    case Form::bldc:
      return to_python(Bldc{static_cast<std::uint16_t>(numbers[0]),
                            static_cast<Direction>(numbers[1]), numbers[2] != 0});
    case Form::safe:
      return py::cast(state.safe);
    case Form::fault:
      if (!state.fault.any()) return py::none();
      return py::str("{}: {}").format(chip_name(state.fault.address), to_text(state.fault.trouble));
    case Form::reading:
      return to_python(state.raw.i2c[nth(field, F::i2c1, F::i2c8)]);
    case Form::answer:
      return to_python(state.i2c_answer);
    case Form::bus:
      return to_python(state.i2c_bus);
    case Form::uart:
      return to_python(state.raw.uart[nth(field, F::uart1, F::uart2)]);
    case Form::number:
      break;
  }
  return py::int_(numbers[0]);
}

std::string attribute_of(F field) {
  const Text name = name_of(field);
  std::string lower(name.data(), name.size());
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

namespace {

// What numbers_of() reads.
void set_numbers(State& state, F field, const Numbers& to) {
  const auto whole = [&](std::size_t i) { return static_cast<std::int32_t>(to[i]); };
  const auto drive = [&] {
    return Drive{static_cast<std::uint16_t>(to[0]), static_cast<Direction>(to[1] != 0)};
  };
  if (int n = nth(field, F::ain24, F::aindmh); n >= 0) {
    state.raw.analog_cv[n] = whole(0);
  } else if (n = nth(field, F::osmc1, F::osmc2, F::osmc4); n >= 0) {
    state.raw.osmc[n] = drive();
  } else if (n = nth(field, F::dhb1a, F::dhb1b, F::dhb2b); n >= 0) {
    state.raw.dhb12[n] = drive();
  } else if (n = nth(field, F::bldc1, F::bldc4); n >= 0) {
    state.raw.bldc[n] = {drive().pwm, drive().direction, to[2] != 0};
  } else if (n = nth(field, F::step1pos, F::step2pos, F::step4pos); n >= 0) {
    state.raw.stepper_steps[n] = whole(0);
  } else if (n = nth(field, F::servo1pos, F::servo2pos, F::servo16pos); n >= 0) {
    state.raw.servo_us[n] = static_cast<std::uint16_t>(to[0]);
  } else if (n = nth(field, F::enc1, F::enc4); n >= 0) {
    state.raw.encoder_counts[n] = whole(0);
  } else if (n = nth(field, F::enc1hz, F::enc4hz); n >= 0) {
    state.raw.encoder_hz[n] = whole(0);
  } else if (n = nth(field, F::enc1idx, F::enc4idx); n >= 0) {
    state.raw.encoder_index_counts[n] = whole(0);
  } else if (n = nth(field, F::us1, F::us4); n >= 0) {
    state.raw.ultrasonic_cm[n] = static_cast<std::uint16_t>(to[0]);
  } else if (field == F::ainsteer || field == F::ain6) {
    state.raw.analog_cv[static_cast<int>(field == F::ain6 ? Analog::ain6 : Analog::ainsteer)] =
        whole(0);
  } else if (field == F::dmhsta) {
    state.handle_held = to[0] != 0;
  } else if (field == F::relays) {
    state.relays = static_cast<std::uint8_t>(to[0]);
  } else if (field == F::safe) {
    state.safe = to_safe_reason(static_cast<std::uint32_t>(to[0]));
  } else {
    throw Error(ErrorKind::usage, attribute_of(field), "it cannot be made up", "leave it out");
  }
}

Numbers numbers_from(F field, const py::handle& value) {
  switch (form_of(field)) {
    case Form::volts:
      return {std::lround(100 * value.cast<double>())};
    case Form::drive:
    case Form::bldc: {
      Numbers numbers{};
      std::size_t i = 0;
      for (const py::handle each : value.cast<py::tuple>()) {
        if (i < numbers.size()) numbers[i++] = each.cast<std::int64_t>();
      }
      return numbers;
    }
    case Form::safe:
      return {static_cast<int>(value.cast<SafeReason>())};
    case Form::flag:
    case Form::number:
    case Form::fault:
      break;
    case Form::reading:
    case Form::answer:
    case Form::bus:
    case Form::uart:
      return {};  // set_numbers() tells that
  }
  return {value.cast<std::int64_t>()};
}

// A state that no board has sent, for tests of what is done with states.
ReceivedState make_state(std::uint32_t t_ms, double at, const py::dict& fields) {
  ReceivedState state;
  state.t_ms = t_ms;
  state.received = state.sampled = ReceivedState::Clock::time_point(
      std::chrono::round<ReceivedState::Clock::duration>(std::chrono::duration<double>(at)));
  state.sampled_error = ReceivedState::Clock::duration(0);
  for (const auto& [key, value] : fields) {
    std::string name = key.cast<std::string>();
    for (char& c : name) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    const F field = state_field(Text(name));
    if (field == F::count) {
      throw Error(ErrorKind::usage, key.cast<std::string>(), "there is no such state field",
                  "give one of r4link.FIELDS");
    }
    set_numbers(state, field, numbers_from(field, value));
    state.present.add(field);
  }
  return state;
}

}  // namespace

void bind_state(py::module_& module) {
  module.def("make_state", &make_state);
  py::class_<ReceivedState> state(module, "State");
  py::list names;
  for (int i = 0; i < state_field_count; ++i) {
    const F field = static_cast<F>(i);
    const std::string name = attribute_of(field);
    names.append(name);
    state.def_property_readonly(
        name.c_str(), [field](const ReceivedState& self) { return value_of(self, field); });
  }
  module.attr("FIELDS") = py::tuple(names);
  state.def(pickled<ReceivedState>("State"))
      .def_readonly("pnum", &ReceivedState::pnum)
      .def_readonly("t_ms", &ReceivedState::t_ms)
      .def_property_readonly("present",
                             [](const ReceivedState& self) {
                               py::list present;
                               for (const F field : self.present)
                                 present.append(attribute_of(field));
                               return py::tuple(present);
                             })
      .def("relay", &ReceivedState::relay)
      .def("__bool__", &ReceivedState::any)
      // On the clock of time.monotonic().
      .def_property_readonly(
          "received",
          [](const ReceivedState& self) -> py::object {
            if (!self.any()) return py::none();
            return py::float_(
                std::chrono::duration<double>(self.received.time_since_epoch()).count());
          })
      .def_property_readonly(
          "sampled",
          [](const ReceivedState& self) -> py::object {
            if (!self.any()) return py::none();
            return py::float_(
                std::chrono::duration<double>(self.sampled.time_since_epoch()).count());
          })
      .def_property_readonly(
          "sampled_error",
          [](const ReceivedState& self) -> py::object {
            if (self.sampled_error == ReceivedState::unknown) return py::none();
            return py::float_(std::chrono::duration<double>(self.sampled_error).count());
          })
      .def_property_readonly(
          "sampled_utc",
          [](const ReceivedState& self) -> py::object {
            if (!self.any()) return py::none();
            const auto since_1970 = self.sampled_at_wall_time().time_since_epoch();
            const py::module_ datetime = py::module_::import("datetime");
            return datetime.attr("datetime")
                .attr("fromtimestamp")(std::chrono::duration<double>(since_1970).count(),
                                       datetime.attr("timezone").attr("utc"));
          })
      .def("as_dict",
           [](const ReceivedState& self) {
             py::dict dict;
             dict["pnum"] = self.pnum;
             dict["t_ms"] = self.t_ms;
             for (const F field : self.present) {
               dict[py::str(attribute_of(field))] = value_of(self, field);
             }
             return dict;
           })
      .def("__repr__", [](const py::object& self) {
        const py::dict dict = self.attr("as_dict")();
        py::list parts;
        for (const auto& [name, value] : dict) parts.append(py::str("{}={!r}").format(name, value));
        return py::str("State({})").format(py::str(", ").attr("join")(parts));
      });
}

}  // namespace r4::python
