// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.hpp"

PYBIND11_MODULE(_core, module) {
  module.doc() = "r4::Board for Python; see r4link";
  module.attr("__version__") = R4LINK_VERSION;
  r4::python::bind_enums(module);
  r4::python::bind_errors(module);
  r4::python::bind_values(module);
  r4::python::bind_state(module);
  r4::python::bind_control(module);
  r4::python::bind_devices(module);
  r4::python::bind_servo(module);
  r4::python::bind_discovery(module);
  r4::python::bind_board(module);
  r4::python::bind_calls(module);
  r4::python::bind_commissioning(module);
  r4::python::bind_recording(module);
  r4::python::bind_simulation(module);
  r4::python::bind_wiring(module);
  r4::python::bind_fleet(module);
  r4::python::bind_bridge(module);
}
