// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl.h>

#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "bindings.hpp"
#include "r4link/devices/device.hpp"

namespace r4::python {
namespace {

using Reading = std::tuple<std::optional<double>, std::uint32_t, std::uint32_t>;

Reading reading_of(const DeviceReading& reading) {
  return {reading.number, reading.t_ms, reading.errors};
}

}  // namespace

void bind_devices(py::module_& module) {
  module.def("shipped_devices", &DeviceDescription::shipped);
  module.def("load_device", [](const std::string& text, int first_slot) {
    return Device::from(std::string_view(text), first_slot);
  });
  module.def("parse_device",
             [](const std::string& text, std::optional<int> address, int first_slot) {
               DeviceDescription description = DeviceDescription::parse(text);
               const int usual = description.addresses.front();
               return Device(std::move(description), address.value_or(usual), first_slot);
             });
  py::class_<Device>(module, "Device")
      .def("__str__", &Device::text)
      .def_property_readonly("name", [](const Device& self) { return self.description().name; })
      .def_property_readonly("title", [](const Device& self) { return self.description().title; })
      .def_property_readonly("role", [](const Device& self) { return self.description().role; })
      .def_property_readonly("address", &Device::address)
      .def_property_readonly("fields", &Device::fields)
      .def_property_readonly("units",
                             [](const Device& self) {
                               py::dict units;
                               for (const DeviceValue& value : self.description().values) {
                                 units[py::str(value.name)] = value.unit;
                               }
                               return units;
                             })
      .def("is_set_up",
           [](const Device& self, const ReceivedState& state) { return self.is_set_up(state); })
      .def("reading",
           [](const Device& self, const ReceivedState& state, const std::string& value) {
             return reading_of(self.reading(state, value));
           })
      .def("readings", [](const Device& self, const ReceivedState& state) {
        py::dict readings;
        for (std::size_t i = 0; i < self.description().values.size(); ++i) {
          readings[py::str(self.description().values[i].name)] = reading_of(self.reading(state, i));
        }
        return readings;
      });
}

}  // namespace r4::python
