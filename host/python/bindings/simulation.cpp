// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/simulation.hpp"

#include <memory>
#include <string>

#include "process.hpp"

namespace r4::python {
namespace {

using Robot = sim::SimulatedRobot;
using PyRobot = OfThisProcess<Robot>;

template <class Value, std::size_t count, class Make>
py::tuple tuple_of(const Value (&values)[count], Make make) {
  py::tuple result(count);
  for (std::size_t i = 0; i < count; ++i) result[i] = make(values[i]);
  return result;
}

py::dict look(const PyRobot& robot) {
  const Robot::Look look = [&] {
    const py::gil_scoped_release free;
    return robot->look();
  }();
  const auto number = [](auto value) { return py::int_(value); };
  py::dict all;
  all["open"] = look.open;
  all["supply"] = look.motors_have_supply;
  all["handle_held"] = look.handle_held;
  all["osmc"] = tuple_of(look.pins.osmc, [](Drive drive) { return to_python(drive); });
  all["dhb12"] = tuple_of(look.pins.dhb12, [](Drive drive) { return to_python(drive); });
  all["servo_us"] = tuple_of(look.pins.servo_us, number);
  all["bldc"] = tuple_of(look.pins.bldc, [](const Bldc& bldc) { return to_python(bldc); });
  py::tuple relays(relay_channels);
  for (std::size_t i = 0; i < relay_channels; ++i) {
    relays[i] = py::bool_((look.pins.relays >> i & 1) != 0);
  }
  all["relays"] = relays;
  all["encoder"] = tuple_of(look.encoder, number);
  all["stepper"] = tuple_of(look.stepper, number);
  all["volts"] = tuple_of(look.analog_cv, [](std::int32_t cv) { return py::float_(cv / 100.0); });
  all["is_safe"] = look.pins.is_safe();
  return all;
}

}  // namespace

void bind_simulation(py::module_& module) {
  py::class_<PyRobot>(module, "SimulatedRobot")
      .def(py::init([] { return PyRobot("the simulated board", std::make_unique<Robot>()); }))
      .def_property_readonly("url", [](const PyRobot& robot) { return robot->url(); })
      .def(
          "happen", [](const PyRobot& robot, const std::string& words) { robot->happen(words); },
          py::call_guard<py::gil_scoped_release>())
      .def("look", &look);
  module.def("check_link", [](const std::string& url, const std::string& link) {
    static_cast<void>(sim::with_link(url, link));
  });
}

}  // namespace r4::python
