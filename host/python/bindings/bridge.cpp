// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/bridge.hpp"

#include <pybind11/stl.h>

#include <chrono>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "process.hpp"
#include "r4link/options.hpp"

namespace r4::python {
namespace {

using Released = py::call_guard<py::gil_scoped_release>;
// The members of BridgeEnd, with the counters in the order of BridgeCounters.
using End = std::tuple<std::string, bool, std::vector<std::uint64_t>>;

End end_of(const BridgeEnd& end) {
  const BridgeCounters& from = end.from;
  return {end.name,
          end.up,
          {from.passed, from.stops, from.damaged, from.misdirected, from.kept_out, from.refused,
           from.late, from.undelivered, from.outdated}};
}

using PyBridge = OfThisProcess<Bridge>;

PyBridge opened_bridge(const std::string& hosts, const std::string& board, int timeout_ms,
                       const std::vector<std::string>& keys, bool open) {
  BridgeOptions options;
  options.timeout = std::chrono::milliseconds(timeout_ms);
  options.open = open;
  const py::gil_scoped_release free;
  for (const std::string& path : keys) options.keys.push_back(load_key(path));
  return {"the bridge", std::make_unique<Bridge>(hosts, board, std::move(options))};
}

std::vector<std::pair<End, End>> status_of(const PyBridge& bridge) {
  std::vector<std::pair<End, End>> all;
  for (const BridgeStatus& each : bridge->status()) {
    all.emplace_back(end_of(each.hosts), end_of(each.board));
  }
  return all;
}

}  // namespace

void bind_bridge(py::module_& module) {
  py::class_<PyBridge>(module, "Bridge")
      .def(py::init(&opened_bridge), py::arg("hosts"), py::arg("board"), py::kw_only(),
           py::arg("timeout"), py::arg("keys"), py::arg("open"))
      .def(
          "close", [](PyBridge& bridge) { bridge.if_here([](Bridge& here) { here.close(); }); },
          Released())
      .def("status", &status_of, Released());
}

}  // namespace r4::python
