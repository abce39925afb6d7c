// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/fleet.hpp"

#include <pybind11/stl.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "pickle.hpp"
#include "process.hpp"

namespace r4::python {
namespace {

using Ms = std::chrono::milliseconds;
using Released = py::call_guard<py::gil_scoped_release>;
using Boards = Fleet::Boards;

using PyFleet = OfThisProcess<Fleet>;

PyFleet opened(const std::vector<std::string>& urls, BoardOptions options) {
  options.on_wait = [] {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  };
  const py::gil_scoped_release free;
  return {"the fleet", std::make_unique<Fleet>(urls, std::move(options))};
}

Boards boards_of(PyFleet& fleet, const std::optional<Boards>& boards) {
  if (boards) return *boards;
  Boards all(fleet->size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  return all;
}

std::vector<BoardSetpoints> setpoints_of(
    const std::vector<std::pair<std::size_t, Setpoints>>& all) {
  std::vector<BoardSetpoints> setpoints;
  setpoints.reserve(all.size());
  for (const auto& [board, each] : all) setpoints.push_back({board, each});
  return setpoints;
}

py::object subject_of(const FleetEvent& event) {
  switch (event.kind) {
    case FleetEvent::Kind::link:
      return py::cast(event.link);
    case FleetEvent::Kind::transport:
      return py::cast(event.transport);
    case FleetEvent::Kind::arming:
      return py::cast(event.disarmed_by);
    case FleetEvent::Kind::refused:
      return py::cast(event.refused);
    case FleetEvent::Kind::missed:
      return py::int_(event.count);
    case FleetEvent::Kind::restart:
      break;
  }
  return py::none();
}

}  // namespace

void bind_fleet(py::module_& module) {
  py::class_<BoardHealth>(module, "BoardHealth")
      .def(pickled<BoardHealth>("BoardHealth"))
      .def_readonly("board", &BoardHealth::board)
      .def_readonly("url", &BoardHealth::url)
      .def_readonly("identity", &BoardHealth::identity)
      .def_readonly("link", &BoardHealth::link)
      .def_readonly("in_control", &BoardHealth::in_control)
      .def_readonly("disarmed_by", &BoardHealth::disarmed_by)
      .def_readonly("statistics", &BoardHealth::statistics)
      .def_readonly("paths", &BoardHealth::paths)
      .def_property_readonly("well", &BoardHealth::well);

  py::class_<FleetResult>(module, "FleetResult")
      .def(pickled<FleetResult>("FleetResult"))
      .def_readonly("board", &FleetResult::board)
      .def_property_readonly("outcome",
                             [](const FleetResult& result) { return result.result.outcome; })
      .def_property_readonly("elapsed",
                             [](const FleetResult& result) {
                               return std::chrono::duration<double>(result.result.elapsed).count();
                             })
      .def_property_readonly("confirmed", &FleetResult::confirmed)
      .def_property_readonly(
          "problem", [](const FleetResult& result) { return arguments_of(result.problem); });

  using Results = std::vector<FleetResult>;
  const auto list = [](const FleetResults& results) {
    return Results(results.begin(), results.end());
  };
  py::class_<PyFleet>(module, "Fleet")
      .def(py::init([](const std::vector<std::string>& urls, BoardRole role, bool arming,
                       const std::string& fields, const std::optional<std::string>& key,
                       int watch_rate_hz, int heartbeat, int timeout, int command_retry,
                       int stop_retry, int stop_linger, int identify_interval) {
             constexpr int no_callbacks = 0;
             return opened(urls, options_of(role, arming, fields, key, watch_rate_hz, heartbeat,
                                            timeout, command_retry, stop_retry, stop_linger,
                                            identify_interval, no_callbacks));
           }),
           py::arg("urls"), py::kw_only(), py::arg("role"), py::arg("arming"), py::arg("fields"),
           py::arg("key"), py::arg("watch_rate_hz"), py::arg("heartbeat"), py::arg("timeout"),
           py::arg("command_retry"), py::arg("stop_retry"), py::arg("stop_linger"),
           py::arg("identify_interval"))
      .def(
          "close", [](PyFleet& fleet) { fleet.if_here([](Fleet& here) { here.close(); }); },
          Released())
      .def("__len__", [](PyFleet& fleet) { return fleet->size(); })
      .def("url", [](PyFleet& fleet, std::size_t board) { return fleet->url(board); })
      .def(
          "find", [](PyFleet& fleet, const std::string& name) { return fleet->find(name); },
          Released())
      .def(
          "wait_active", [](PyFleet& fleet, int ms) { return fleet->wait_active(Ms(ms)); },
          Released())
      .def(
          "health", [](PyFleet& fleet) { return fleet->health(); }, Released())
      .def(
          "states", [](PyFleet& fleet) { return fleet->states(); }, Released())
      .def(
          "send",
          [list](PyFleet& fleet, const std::string& command, const std::optional<Boards>& boards,
                 int ms) { return list(fleet->send(boards_of(fleet, boards), command, Ms(ms))); },
          Released())
      .def(
          "send",
          [list](PyFleet& fleet, const OwnCommand& command, const std::optional<Boards>& boards,
                 int ms) { return list(fleet->send(boards_of(fleet, boards), command, Ms(ms))); },
          Released())
      .def(
          "arm",
          [list](PyFleet& fleet, const std::optional<Boards>& boards, int ms) {
            return list(fleet->arm(boards_of(fleet, boards), Ms(ms)));
          },
          Released())
      .def(
          "stop", [list](PyFleet& fleet, int ms) { return list(fleet->stop(Ms(ms))); }, Released())
      .def("stop_async", [](PyFleet& fleet) { fleet->stop_async(); })
      .def(
          "send",
          [list](PyFleet& fleet, const std::vector<std::pair<std::size_t, Setpoints>>& setpoints,
                 int ms) { return list(fleet->send(setpoints_of(setpoints), Ms(ms))); },
          Released())
      .def(
          "post",
          [](PyFleet& fleet, const std::vector<std::pair<std::size_t, Setpoints>>& setpoints) {
            std::vector<PostResult::Value> results;
            for (const PostResult each : fleet->post(setpoints_of(setpoints))) {
              results.push_back(each.value());
            }
            return results;
          },
          Released())
      .def("next_event",
           [](PyFleet& fleet, int ms) -> py::object {
             std::optional<FleetEvent> event;
             {
               const py::gil_scoped_release free;
               event = fleet->next_event(Ms(ms));
             }
             if (!event) return py::none();
             return py::make_tuple(event->kind, event->board, subject_of(*event));
           })
      .def(
          "record", [](PyFleet& fleet, PyRecording& recording) { fleet->record(*recording); },
          py::keep_alive<1, 2>(), Released())
      .def(
          "watchdog", [](PyFleet& fleet, int ms) { fleet->watchdog(Ms(ms)); }, Released())
      .def("feed", [](PyFleet& fleet) { fleet->feed(); });
}

}  // namespace r4::python
