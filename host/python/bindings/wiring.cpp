// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/wiring/wiring.hpp"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <string>
#include <tuple>
#include <vector>

#include "r4link/wiring/wiring_file.hpp"
#include "r4link/wiring/wiring_value.hpp"
#include "record.hpp"

namespace r4::python {
namespace {

std::vector<std::string> signals_of_a_board() {
  std::vector<std::string> names;
  names.reserve(signal_count);
  for (int i = 0; i < signal_count; ++i) names.push_back(signal_name(i));
  return names;
}

std::vector<std::tuple<std::string, std::string, std::string>> differences(const Wiring& a,
                                                                           const Wiring& b) {
  std::vector<std::tuple<std::string, std::string, std::string>> all;
  for (int i = 0; i < signal_count; ++i) {
    if (a.places[i] == b.places[i]) continue;
    all.emplace_back(signal_name(i), place_name(i, a.places[i]), place_name(i, b.places[i]));
  }
  return all;
}

}  // namespace

void bind_wiring(py::module_& module) {
  py::class_<Wiring>(module, "Wiring")
      .def_static("plan", plan_wiring)
      .def_static("read", read_wiring, py::arg("text"), py::arg("name") = "wiring")
      .def_static(
          "load", [](const std::filesystem::path& path) { return load_wiring(path.string()); },
          py::arg("path"))
      .def_property_readonly_static(
          "SIGNALS", [](const py::object&) { return py::tuple(py::cast(signals_of_a_board())); })
      .def("__getitem__",
           [](const Wiring& wiring, const std::string& signal) {
             const int index = signal_named(signal);
             return place_name(index, wiring.places[index]);
           })
      .def("__setitem__",
           [](Wiring& wiring, const std::string& signal, const std::string& place) {
             const int index = signal_named(signal);
             wiring.places[index] = place_named(index, place);
           })
      .def("check",
           [](const Wiring& wiring) {
             const WiringCheck found = check(wiring);
             if (found.fault != WiringFault::none) throw Error(problem_of(wiring, found));
           })
      .def_property_readonly("setting",
                             [](const Wiring& wiring) {
                               char value[max_wiring_value];
                               const Text text = write_wiring_value(wiring, value);
                               return std::string(text.data(), text.size());
                             })
      .def("differences", differences, py::arg("other"))
      .def("__eq__", [](const Wiring& a, const Wiring& b) { return a == b; })
      .def("__str__", write_wiring)
      .def(pickled<Wiring>("Wiring"));
  Record<BoardWiring>(module, "BoardWiring")
      .has("source", [](const BoardWiring& kept) { return to_text(kept.source); })
      .has("in_use", &BoardWiring::in_use)
      .has("wiring", &BoardWiring::wiring);
}

}  // namespace r4::python
