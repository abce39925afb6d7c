// SPDX-License-Identifier: GPL-3.0-or-later
// A state: each field of the board is an attribute, made on request.
#include <chrono>
#include <string>

#include "pickle.hpp"

namespace r4::python {
using F = StateField;

py::object value_of(const State& state, F field) {
  const StateNumbers numbers = numbers_of(state, field);
  const auto whole = [&](int i) { return static_cast<std::uint16_t>(numbers[i]); };
  const int i = row_of(field).channel - 1;
  switch (kind_row_of(field).form) {
    case FieldForm::volts:
      return py::float_(numbers[0]);
    case FieldForm::handle:
      return state.handle == Handle::none ? py::object(py::none()) : py::bool_(state.handle_held());
    case FieldForm::drive:
      return to_python(Drive{whole(0), static_cast<Direction>(whole(1))});
    case FieldForm::bldc:
      return to_python(Bldc{whole(0), static_cast<Direction>(whole(1)), whole(2) != 0});
    case FieldForm::reason:
      return py::cast(state.safe);
    case FieldForm::fault:
      if (!state.fault.any()) return py::none();
      return py::str("{}: {}").format(chip_name(state.fault.address), to_text(state.fault.trouble));
    case FieldForm::reading:
      return to_python(state.raw.i2c[i]);
    case FieldForm::answer:
      return to_python(state.i2c_answer);
    case FieldForm::bus:
      return to_python(state.i2c_bus);
    case FieldForm::uart:
      return to_python(state.raw.uart[i]);
    default:
      return py::int_(static_cast<std::int64_t>(numbers[0]));
  }
}

std::string attribute_of(F field) {
  const Text name = name_of(field);
  std::string lower(name.data(), name.size());
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return lower;
}

namespace {

StateNumbers numbers_from(F field, const py::handle& value) {
  switch (kind_row_of(field).form) {
    case FieldForm::volts:
      return {1, {value.cast<double>()}};
    case FieldForm::drive:
    case FieldForm::bldc: {
      StateNumbers numbers{};
      for (const py::handle each : value.cast<py::tuple>()) {
        if (numbers.count < most_field_values) {
          numbers.values[numbers.count++] = static_cast<double>(each.cast<std::int64_t>());
        }
      }
      return numbers;
    }
    case FieldForm::handle:
      return {1, {value.is_none() ? 2.0 : static_cast<double>(value.cast<bool>())}};
    case FieldForm::reason:
      return {1, {static_cast<double>(value.cast<SafeReason>())}};
    case FieldForm::u32:
    case FieldForm::fault:
    case FieldForm::reading:
    case FieldForm::answer:
    case FieldForm::bus:
    case FieldForm::uart:
      throw Error(ErrorKind::usage, attribute_of(field), "this field cannot be set",
                  "leave it out");
    default:
      return {1, {static_cast<double>(value.cast<std::int64_t>())}};
  }
}

// A state that no board has sent, for tests of programs.
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
      throw Error(ErrorKind::usage, key.cast<std::string>(), "this is not a state field",
                  "give one of r4link.FIELDS");
    }
    if (!set_numbers(state, field, numbers_from(field, value))) {
      throw Error(ErrorKind::usage, attribute_of(field), "the field cannot have this value",
                  "give a value that docs/reference/protocol.md allows");
    }
    state.present.add(field);
    state.reported.add(field);
  }
  return state;
}

// A state without FAULT reports that there is no fault (docs/reference/protocol.md).
bool has_value(const ReceivedState& state, F field) {
  return state.reported.has(field) || field == F::fault;
}

// Throws AttributeError for a field that the board has not reported, because its value would be 0.
void require(const ReceivedState& state, F field) {
  if (has_value(state, field)) return;
  const Text name = name_of(field);
  throw py::attribute_error(
      attribute_of(field) +
      ": the board has not reported this field; request the field: fields('DEFAULT," +
      std::string(name.data(), name.size()) + "')");
}

}  // namespace

void bind_state(py::module_& module) {
  module.def("make_state", &make_state);
  py::class_<ReceivedState> state(module, "State");
  py::list names;
  for (const StateFieldRow& row : state_fields) {
    const std::string name = attribute_of(row.field);
    names.append(name);
    state.def_property_readonly(name.c_str(), [field = row.field](const ReceivedState& self) {
      require(self, field);
      return value_of(self, field);
    });
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
      .def("relay",
           [](const ReceivedState& self, int channel) {
             require(self, F::relays);
             return self.relay(channel);
           })
      .def("__bool__", &ReceivedState::any)
      // Lists only the fields that the state carries, for completion in Python.
      .def("__dir__",
           [](const py::object& self) {
             py::set attributes(py::module_::import("builtins").attr("dir")(py::type::of(self)));
             const auto& reported = self.cast<const ReceivedState&>();
             for (const StateFieldRow& row : state_fields) {
               if (has_value(reported, row.field)) continue;
               attributes.attr("discard")(attribute_of(row.field));
             }
             return attributes;
           })
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
