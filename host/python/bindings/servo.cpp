// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl.h>

#include <optional>
#include <utility>

#include "pickle.hpp"
#include "r4link/commands/servo_calibration.hpp"

namespace r4::python {
namespace {

Degrees degrees_of(const py::object& degrees) {
  if (PyBool_Check(degrees.ptr())) throw py::type_error("degrees must be a number");
  const double value = PyFloat_AsDouble(degrees.ptr());
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  return Degrees(value);
}

}  // namespace

template <>
inline ServoCalibration blank<ServoCalibration>() {
  return {{Microseconds(1), Degrees(0)}, {Microseconds(2), Degrees(1)}};
}

void bind_servo(py::module_& module) {
  py::class_<ServoCalibration>(module, "ServoCalibration")
      .def(py::init(
               [](const std::pair<int, int>& us, const std::pair<py::object, py::object>& degrees) {
                 return ServoCalibration({Microseconds(us.first), degrees_of(degrees.first)},
                                         {Microseconds(us.second), degrees_of(degrees.second)});
               }),
           py::kw_only(), py::arg("us"), py::arg("degrees"))
      .def(
          "pulse",
          [](const ServoCalibration& calibration, const py::object& degrees) {
            return calibration.pulse(degrees_of(degrees)).value;
          },
          py::kw_only(), py::arg("degrees"))
      .def(
          "degrees",
          [](const ServoCalibration& calibration, int us) -> std::optional<double> {
            const auto angle = calibration.degrees(us);
            return angle ? std::optional(angle->value) : std::nullopt;
          },
          py::kw_only(), py::arg("us"))
      .def(pickled<ServoCalibration>("ServoCalibration"))
      .def("__repr__", [](const ServoCalibration& calibration) {
        const ServoCalibration::End& one = calibration.one();
        const ServoCalibration::End& other = calibration.other();
        return py::str("ServoCalibration(us=({}, {}), degrees=({}, {}))")
            .format(one.pulse.value, other.pulse.value, one.angle.value, other.angle.value);
      });
}

}  // namespace r4::python
