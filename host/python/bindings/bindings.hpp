// SPDX-License-Identifier: GPL-3.0-or-later
// The module r4link._core: r4::Board for Python, with times in milliseconds. The public interface
// is r4link/*.py, above this module. The link's thread never takes the GIL. The callbacks' thread,
// and the thread of a transport in Python, take the GIL for each call.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "enums.hpp"
#include "r4link/board.hpp"
#include "r4link/tables/state_fields.hpp"

namespace r4::python {

namespace py = pybind11;

void bind_enums(py::module_& module);
void bind_errors(py::module_& module);
void bind_values(py::module_& module);
void bind_state(py::module_& module);
void bind_board(py::module_& module);
void bind_calls(py::module_& module);
void bind_commissioning(py::module_& module);
void bind_control(py::module_& module);
void bind_devices(py::module_& module);
void bind_discovery(py::module_& module);
void bind_fleet(py::module_& module);
void bind_bridge(py::module_& module);
void bind_recording(py::module_& module);
void bind_servo(py::module_& module);
void bind_simulation(py::module_& module);
void bind_wiring(py::module_& module);

BoardOptions options_of(BoardRole role, bool arming, const std::string& fields,
                        const std::optional<std::string>& key, int watch_rate_hz, int heartbeat_ms,
                        int timeout_ms, int command_retry_ms, int stop_retry_ms, int stop_linger_ms,
                        int identify_interval_ms, int callback_limit_ms);

// Makers for r4link.Transport objects. The makers keep the objects.
std::vector<CarrierMaker> makers_of(const py::list& transports);

// For error_of() of r4link/errors.py.
py::tuple arguments_of(const Problem& problem);

py::object to_python(Drive drive);
py::object to_python(const Bldc& bldc);
py::object to_python(const I2cReading& reading);
py::object to_python(const I2cAnswer& answer);
py::object to_python(const I2cBusReport& report);
py::object to_python(const UartBytes& received);

// A field's value (state.hpp): float in volts, bool for the handle, Drive, Bldc, I2cReading, int.
py::object value_of(const State& state, StateField field);
std::string attribute_of(StateField field);

}  // namespace r4::python
