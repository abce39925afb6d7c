// SPDX-License-Identifier: GPL-3.0-or-later
// A state: each field of the board an attribute, made when it is asked for.
#include <chrono>
#include <string>

#include "bindings.hpp"

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

py::object volts(const State& state, Analog input) { return py::float_(state.volts(input)); }

}  // namespace

py::object value_of(const State& state, F field) {
  if (const int n = nth(field, F::ain24, F::aindmh); n >= 0) {
    return volts(state, static_cast<Analog>(n));
  }
  if (const int n = nth(field, F::osmc1, F::osmc2, F::osmc4); n >= 0)
    return to_python(state.osmc[n]);
  if (const int n = nth(field, F::dhb1a, F::dhb1b, F::dhb2b); n >= 0)
    return to_python(state.dhb12[n]);
  if (const int n = nth(field, F::bldc1, F::bldc4); n >= 0) return to_python(state.bldc[n]);
  if (const int n = nth(field, F::step1pos, F::step2pos, F::step4pos); n >= 0) {
    return py::int_(state.stepper_steps[n]);
  }
  if (const int n = nth(field, F::servo1pos, F::servo2pos, F::servo16pos); n >= 0) {
    return py::int_(state.servo_us[n]);
  }
  if (const int n = nth(field, F::enc1, F::enc4); n >= 0) return py::int_(state.encoder_counts[n]);
  if (const int n = nth(field, F::enc1hz, F::enc4hz); n >= 0) return py::int_(state.encoder_hz[n]);
  if (const int n = nth(field, F::enc1idx, F::enc4idx); n >= 0) {
    return py::int_(state.encoder_index_counts[n]);
  }
  if (const int n = nth(field, F::us1, F::us4); n >= 0) return py::int_(state.ultrasonic_cm[n]);
  switch (field) {
    case F::ainsteer:
      return volts(state, Analog::ainsteer);
    case F::ain6:
      return volts(state, Analog::ain6);
    case F::dmhsta:
      return py::bool_(state.handle_held);
    case F::relays:
      return py::int_(state.relays);
    case F::safe:
      return py::str(to_text(state.safe));
    case F::cmd:
      return py::int_(state.last_command);
    case F::rxok:
      return py::int_(state.rx_ok);
    case F::rxcrc:
      return py::int_(state.rx_crc);
    case F::rxlost:
      return py::int_(state.rx_lost);
    case F::rxdup:
      return py::int_(state.rx_duplicate);
    case F::rxref:
      return py::int_(state.rx_refused);
    case F::late:
      return py::int_(state.late);
    case F::fault:
      if (!state.fault.any()) return py::none();
      return py::str("{}: {}").format(chip_name(state.fault.address), to_text(state.fault.trouble));
    default:
      return py::none();
  }
}

std::string attribute_of(F field) {
  const Text name = name_of(field);
  std::string lower(name.data(), name.size());
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

void bind_state(py::module_& module) {
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
  state.def_readonly("pnum", &ReceivedState::pnum)
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
