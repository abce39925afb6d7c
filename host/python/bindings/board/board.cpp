// SPDX-License-Identifier: GPL-3.0-or-later
#include "r4link/board.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../bindings.hpp"
#include "py_board.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/control/loop.hpp"

namespace r4::python {
namespace {

using PyStates = OfThisProcess<States>;

// Null until the constructor has made a board.
PyBoard* board_in(PyObject* self) {
  auto* const instance = reinterpret_cast<py::detail::instance*>(self);
  return instance->simple_layout ? static_cast<PyBoard*>(instance->simple_value_holder[0])
                                 : nullptr;
}

void collect_garbage(PyHeapTypeObject* heap) {
  PyTypeObject& type = heap->ht_type;
  type.tp_flags |= Py_TPFLAGS_HAVE_GC;
  type.tp_traverse = [](PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    const PyBoard* const board = board_in(self);
    return board != nullptr ? board->traverse(visit, arg) : 0;
  };
  // Untracks first, because the garbage collector must not visit a partly destroyed object.
  type.tp_dealloc = [](PyObject* self) {
    PyObject_GC_UnTrack(self);
    py::detail::pybind11_object_dealloc(self);
  };
  type.tp_clear = [](PyObject* self) {
    if (PyBoard* const board = board_in(self)) board->clear();
    return 0;
  };
}

// The GIL is held only for the step, not between steps.
py::tuple run_loop(PyBoard& board, const control::LoopOptions& options, const py::function& step) {
  control::LoopReport report;
  {
    const py::gil_scoped_release free;
    report = control::run_loop(*board.operator->(), options,
                               [&](const control::LoopStep& now) -> std::optional<Setpoints> {
                                 const py::gil_scoped_acquire gil;
                                 const py::object wanted = step(now.state, now.dt_s);
                                 if (wanted.is_none()) return std::nullopt;
                                 return wanted.cast<Setpoints>();
                               });
  }
  return py::make_tuple(report.end, report.why, report.at_rest, report.steps);
}

py::object uart_data(const Board::UartData& data) {
  static const py::handle type =
      py::module_::import("r4link.values").attr("UartData").cast<py::object>().release();
  return type(py::bytes(reinterpret_cast<const char*>(data.bytes.data()), data.bytes.size()),
              data.lost);
}

}  // namespace

BoardOptions options_of(BoardRole role, bool arming, const std::string& fields,
                        const std::optional<std::string>& key, int watch_rate_hz, int heartbeat_ms,
                        int timeout_ms, int command_retry_ms, int stop_retry_ms, int stop_linger_ms,
                        int identify_interval_ms, int callback_limit_ms) {
  BoardOptions options;
  options.role = role;
  options.callback_limit = Ms(callback_limit_ms);
  SessionOptions& session = options.session;
  session.arming = arming ? Arming::required : Arming::off;
  session.fields = fields;
  if (key) session.key = load_key(*key);
  session.watch_rate_hz = watch_rate_hz;
  session.timing = {static_cast<std::uint32_t>(heartbeat_ms),
                    static_cast<std::uint32_t>(timeout_ms)};
  session.command_retry = Ms(command_retry_ms);
  session.stop_retry = Ms(stop_retry_ms);
  session.stop_linger = Ms(stop_linger_ms);
  session.identify_interval = Ms(identify_interval_ms);
  return options;
}

void bind_board(py::module_& module) {
  py::class_<Subscription>(module, "Subscription").def("cancel", &Subscription::cancel, Released());
  py::class_<PyStates>(module, "States")
      .def_property_readonly("ended", [](const PyStates& states) { return states->ended(); })
      .def_property_readonly("missed", [](const PyStates& states) { return states->missed(); });

  py::class_<PyBoard>(module, "Board", py::custom_type_setup(collect_garbage))
      .def(py::init([](const std::string& url, const py::list& transports, const std::string& link,
                       BoardRole role, bool arming, const std::string& fields,
                       const std::optional<std::string>& key, int watch_rate_hz, int heartbeat,
                       int timeout, int command_retry, int stop_retry, int stop_linger,
                       int identify_interval, int callback_limit) {
             return std::make_unique<PyBoard>(
                 url, makers_of(transports), link,
                 options_of(role, arming, fields, key, watch_rate_hz, heartbeat, timeout,
                            command_retry, stop_retry, stop_linger, identify_interval,
                            callback_limit));
           }),
           py::arg("url"), py::kw_only(), py::arg("transports"), py::arg("link"), py::arg("role"),
           py::arg("arming"), py::arg("fields"), py::arg("key"), py::arg("watch_rate_hz"),
           py::arg("heartbeat"), py::arg("timeout"), py::arg("command_retry"),
           py::arg("stop_retry"), py::arg("stop_linger"), py::arg("identify_interval"),
           py::arg("callback_limit"))
      .def("close", &PyBoard::close, Released())
      .def("role", [](PyBoard& board) { return board->role(); })
      .def(
          "take_control", [](PyBoard& board) { board->take_control(); }, Released())
      .def(
          "release_control", [](PyBoard& board, int ms) { board->release_control(Ms(ms)); },
          Released())
      .def(
          "wait_active", [](PyBoard& board, int ms) { board->wait_active(Ms(ms)); }, Released())
      .def(
          "send",
          [](PyBoard& board, const std::string& text, int ms) { board->send(text, Ms(ms)); },
          Released())
      .def(
          "send",
          [](PyBoard& board, const OwnCommand& command, int ms) { board->send(command, Ms(ms)); },
          Released())
      .def(
          "send",
          [](PyBoard& board, const Setpoints& setpoints, int ms) {
            board->send(setpoints, Ms(ms));
          },
          Released())
      .def("post",
           [](PyBoard& board, const OwnCommand& command) { return board->post(command).value(); })
      .def("calibrate_servo",
           [](PyBoard& board, int channel, const ServoCalibration& calibration) {
             board->servo(channel).calibrate(calibration);
           })
      .def("servo_calibration",
           [](PyBoard& board, int channel) { return board->servo(channel).calibration(); })
      .def("transfer",
           [](PyBoard& board, const std::string& text, int ms) {
             const OwnCommand command = parse_command_text(text);
             Board::I2c::Bytes bytes;
             {
               const py::gil_scoped_release free;
               bytes = board->i2c().transfer(command, Ms(ms));
             }
             return py::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
           })
      .def("uart_read",
           [](PyBoard& board, int channel, int ms) {
             Board::UartData data;
             {
               const py::gil_scoped_release free;
               data = board->uart(channel).read(Ms(ms));
             }
             return uart_data(data);
           })
      .def("uart_on_bytes",
           [](PyBoard& board, int channel, py::object function) {
             return board.subscribe(std::move(function), [&](const Callback& each) {
               return board->uart(channel).on_bytes([each](const Board::UartData& data) {
                 const py::gil_scoped_acquire gil;
                 each(uart_data(data));
               });
             });
           })
      .def(
          "attach",
          [](PyBoard& board, const Device& device, int ms) { board->attach(device, Ms(ms)); },
          Released())
      .def("post", [](PyBoard& board,
                      const Setpoints& setpoints) { return board->post(setpoints).value(); })
      .def(
          "arm", [](PyBoard& board, int ms) { board->arm(Ms(ms)); }, Released())
      .def("disarmed_by", [](PyBoard& board) { return board->disarmed_by(); })
      .def(
          "stop", [](PyBoard& board, int ms) { board->stop(Ms(ms)); }, Released())
      .def("stop_async", [](PyBoard& board) { board->stop_async(); })
      .def(
          "link_timing",
          [](PyBoard& board, int timeout, int heartbeat, int ms) {
            board->link_timing(Ms(timeout), Ms(heartbeat), Ms(ms));
          },
          Released())
      .def(
          "identify", [](PyBoard& board, int ms) { return board->identify(Ms(ms)); }, Released())
      .def(
          "wiring", [](PyBoard& board, int ms) { return board->wiring(Ms(ms)); }, Released())
      .def("state", [](PyBoard& board) { return board->state(); })
      .def(
          "next_state", [](PyBoard& board, int ms) { return board->next_state(Ms(ms)); },
          Released())
      .def("link", [](PyBoard& board) { return board->link(); })
      .def(
          "statistics", [](PyBoard& board) { return board->statistics(); }, Released())
      .def(
          "carrier_counters", [](PyBoard& board) { return board->carrier_counters(); }, Released())
      .def("name", [](PyBoard& board) { return board->name(); })
      .def(
          "paths", [](PyBoard& board) { return board->paths(); }, Released())
      .def(
          "record",
          [](PyBoard& board, const std::string& path, std::uint64_t rotate_bytes,
             std::int64_t rotate_after_s, std::uint64_t keep_bytes) {
            board->record(path, {rotate_bytes, std::chrono::seconds(rotate_after_s), keep_bytes});
          },
          Released())
      .def(
          "record", [](PyBoard& board, PyRecording& recording) { board->record(*recording); },
          py::keep_alive<1, 2>(), Released())
      .def(
          "watchdog", [](PyBoard& board, int ms) { board->watchdog(Ms(ms)); }, Released())
      .def("feed", [](PyBoard& board) { board->feed(); })
      .def("run_loop", &run_loop)
      // The states use the board's on_wait(), and call it in take() only.
      .def("states",
           [](PyBoard& board, bool lossless, std::size_t most) {
             return PyStates("the states",
                             std::make_unique<States>(board->states({lossless, most})));
           })
      .def(
          "take", [](PyBoard&, PyStates& states, int ms) { return states->take(Ms(ms)); },
          Released())
      .def("on_state",
           [](PyBoard& board, py::object function) {
             return board.subscribe(std::move(function),
                                    [&](const Callback& each) { return board->on_state(each); });
           })
      .def("on_link",
           [](PyBoard& board, py::object function) {
             return board.subscribe(std::move(function),
                                    [&](const Callback& each) { return board->on_link(each); });
           })
      .def("on_event",
           [](PyBoard& board, py::object function) {
             return board.subscribe(std::move(function),
                                    [&](const Callback& each) { return board->on_event(each); });
           })
      .def("on_path",
           [](PyBoard& board, py::object function) {
             return board.subscribe(std::move(function),
                                    [&](const Callback& each) { return board->on_path(each); });
           })
      .def("on_restart",
           [](PyBoard& board, py::object function) {
             return board.subscribe(std::move(function),
                                    [&](const Callback& each) { return board->on_restart(each); });
           })
      .def("on_arming",
           [](PyBoard& board, py::object function) {
             return board.subscribe(std::move(function),
                                    [&](const Callback& each) { return board->on_arming(each); });
           })
      .def("on_refused", [](PyBoard& board, py::object function) {
        return board.subscribe(std::move(function),
                               [&](const Callback& each) { return board->on_refused(each); });
      });
}

}  // namespace r4::python
