// SPDX-License-Identifier: GPL-3.0-or-later
// Commands, setpoints and the small values of link and statistics.
#include <pybind11/stl.h>

#include "record.hpp"

namespace r4::python {
namespace {

Direction direction_of(int number) {
  if (number != 0 && number != 1) {
    throw Error(ErrorKind::usage, "direction " + std::to_string(number),
                "the direction does not exist", "give Direction.FORWARD or Direction.REVERSE");
  }
  return static_cast<Direction>(number);
}

Duty duty_of(const py::object& duty) {
  if (PyBool_Check(duty.ptr())) throw py::type_error("duty must be a number from -1 to 1");
  const double value = PyFloat_AsDouble(duty.ptr());
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  return checked_duty(value);
}

void bind_drive(py::class_<OwnCommand>& commands, const char* name,
                Command (*by_duty)(Channel, Duty), Command (*by_pwm)(Channel, Pwm, Direction)) {
  commands.def_static(
      name,
      [by_duty](int channel, const py::object& duty) {
        return OwnCommand(by_duty(channel, duty_of(duty)));
      },
      py::arg("channel"), py::kw_only(), py::arg("duty"));
  commands.def_static(
      name,
      [by_pwm](int channel, int pwm, int direction) {
        return OwnCommand(by_pwm(channel, Pwm(pwm), direction_of(direction)));
      },
      py::arg("channel"), py::kw_only(), py::arg("pwm"),
      py::arg("direction") = static_cast<int>(Direction::forward));
}

void bind_commands(py::module_& module) {
  py::class_<OwnCommand> commands(module, "Command");
  bind_drive(commands, "osmc", &Command::osmc, &Command::osmc);
  bind_drive(commands, "dhb12", &Command::dhb12, &Command::dhb12);
  commands
      .def_static(
          "bldc",
          [](int channel, const py::object& duty, bool brake) {
            return OwnCommand(Command::bldc(channel, duty_of(duty), brake));
          },
          py::arg("channel"), py::kw_only(), py::arg("duty"), py::arg("brake") = false)
      .def_static(
          "bldc",
          [](int channel, int pwm, int direction, bool brake) {
            return OwnCommand(Command::bldc(channel, Pwm(pwm), direction_of(direction), brake));
          },
          py::arg("channel"), py::kw_only(), py::arg("pwm"),
          py::arg("direction") = static_cast<int>(Direction::forward), py::arg("brake") = false)
      .def_static(
          "servo",
          [](int channel, int us) { return OwnCommand(Command::servo(channel, Microseconds(us))); },
          py::arg("channel"), py::kw_only(), py::arg("us"))
      .def_static(
          "relay", [](int channel, bool on) { return OwnCommand(Command::relay(channel, on)); },
          py::arg("channel"), py::kw_only(), py::arg("on"))
      .def_static(
          "stepper",
          [](int channel, std::int32_t position, int speed) {
            return OwnCommand(Command::stepper(channel, Steps(position), StepsPerSecond(speed)));
          },
          py::arg("channel"), py::kw_only(), py::arg("position"),
          py::arg("speed") = stepper_speed_default)
      .def_static(
          "zero", [](int channel) { return OwnCommand(Command::zero(channel)); },
          py::arg("channel"))
      .def_static(
          "dac",
          [](int channel, int millivolts) {
            return OwnCommand(Command::dac(channel, Millivolts(millivolts)));
          },
          py::arg("channel"), py::kw_only(), py::arg("millivolts"))
      .def_static(
          "proximity",
          [](int channel, int cm) {
            return OwnCommand(Command::proximity(channel, Centimetres(cm)));
          },
          py::arg("channel"), py::kw_only(), py::arg("cm"))
      .def_static("stop", [] { return OwnCommand(Command::stop()); })
      .def_static("clear", [] { return OwnCommand(Command::clear()); })
      .def_static("parse", &parse_command_text, py::arg("text"))
      .def("describe", [](const OwnCommand& command) { return describe(command); })
      .def("__str__", [](const OwnCommand& command) { return to_text(command); })
      .def(pickled<OwnCommand>("Command"));
  py::class_<Setpoints>(module, "Setpoints")
      .def(py::init([](const py::args& given) {
        Setpoints setpoints;
        for (const py::handle each : given) {
          if (!py::isinstance<OwnCommand>(each)) {
            throw py::type_error("Setpoints() takes commands, such as Command.osmc(1, duty=0.1)");
          }
          setpoints.add(each.cast<const OwnCommand&>());
        }
        return setpoints;
      }))
      .def(pickled<Setpoints>("Setpoints"))
      .def(
          "add",
          [](Setpoints& setpoints, const OwnCommand& command) -> Setpoints& {
            return setpoints.add(command);
          },
          py::return_value_policy::reference_internal)
      .def("__len__", &Setpoints::size);
}

}  // namespace

py::object to_python(Drive drive) {
  static const py::handle type =
      py::module_::import("r4link.values").attr("Drive").cast<py::object>().release();
  return type(drive.pwm, static_cast<int>(drive.direction));
}
py::object to_python(const Bldc& bldc) {
  static const py::handle type =
      py::module_::import("r4link.values").attr("Bldc").cast<py::object>().release();
  return type(bldc.speed, static_cast<int>(bldc.direction), bldc.brake);
}

template <int most>
static py::bytes bytes_of(const DeviceBytes<most>& data) {
  return {reinterpret_cast<const char*>(data.bytes), data.size};
}
static py::handle named(const char* name) {
  return py::module_::import("r4link.values").attr(name).cast<py::object>().release();
}
py::object to_python(const I2cReading& reading) {
  static const py::handle type = named("I2cReading");
  return type(reading.t_ms, reading.errors, bytes_of(reading.data));
}
py::object to_python(const I2cAnswer& answer) {
  static const py::handle type = named("I2cAnswer");
  return type(answer.pnum, answer.outcome, bytes_of(answer.data));
}
py::object to_python(const I2cBusReport& report) {
  static const py::handle type = named("I2cBusReport");
  return type(report.newest, report.errors, report.recoveries);
}

py::object to_python(const UartBytes& received) {
  static const py::handle type = named("UartBytes");
  return type(received.position, received.lost, bytes_of(received.data));
}

void bind_values(py::module_& module) {
  bind_commands(module);
  Record<LinkStatus>(module, "LinkStatus")
      .has("state", &LinkStatus::state)
      .has("reason", &LinkStatus::reason)
      .has("causes",
           [](const LinkStatus& link) {
             py::list causes;
             for (const LinkCause cause : link.causes) causes.append(cause);
             return py::tuple(causes);
           })
      .has("cause", [](const LinkStatus& link) { return link.cause(); })
      .has("busy", [](const LinkStatus& link) { return link.causes.has(LinkCause::busy); })
      .has("gated", [](const LinkStatus& link) { return link.gated(); })
      .has("in_control", &LinkStatus::in_control)
      .has("carrying",
           [](const LinkStatus& link) {
             py::list paths;
             for (int i = 0; link.carrying >> i != 0; ++i) {
               if ((link.carrying >> i & 1) != 0) paths.append(i);
             }
             return py::tuple(paths);
           })
      .has("chip", [](const LinkStatus& link) -> py::object {
        if (!link.chip.any()) return py::none();
        return py::str("{}: {}").format(chip_name(link.chip.address), to_text(link.chip.trouble));
      });
  Record<PathStatus>(module, "PathStatus")
      .has("name", &PathStatus::name)
      .has("state", &PathStatus::state)
      .has("busy", &PathStatus::busy)
      .has("board_id", &PathStatus::board_id)
      .has("received", [](const PathStatus& path) { return path.packets.received; })
      .has("lost", [](const PathStatus& path) { return path.packets.lost; })
      .has("loss", [](const PathStatus& path) { return path.loss(); })
      .has("copies", &PathStatus::copies)
      .has("round_trip_us", &PathStatus::round_trip_us)
      .has("age_us", &PathStatus::age_us);
  Record<BoardIdentity>(module, "Identity")
      .has("firmware", &BoardIdentity::firmware)
      .has("board_id", &BoardIdentity::board_id)
      .has("capabilities",
           [](const BoardIdentity& identity) {
             return py::tuple(py::str(identity.capabilities).attr("split")("+"));
           })
      .has("name", &BoardIdentity::name);
  Record<Statistics>(module, "Statistics")
      .has("received", &Statistics::received)
      .has("states", &Statistics::states)
      .has("damaged", &Statistics::damaged)
      .has("packets_received", [](const Statistics& all) { return all.packets.received; })
      .has("lost", [](const Statistics& all) { return all.packets.lost; })
      .has("duplicate", [](const Statistics& all) { return all.packets.duplicate; })
      .has("late", [](const Statistics& all) { return all.packets.late; })
      .has("old", [](const Statistics& all) { return all.packets.old; })
      .has("restarts", [](const Statistics& all) { return all.packets.restarts; })
      .has("loss", [](const Statistics& all) { return all.loss(); })
      .has("state_rate_hz", &Statistics::state_rate_hz)
      .has("round_trip_us", &Statistics::round_trip_us)
      .has("round_trip_min_us", &Statistics::round_trip_min_us)
      .has("round_trip_mean_us", &Statistics::round_trip_mean_us)
      .has("jitter_us", &Statistics::jitter_us)
      .has("state_age_us", &Statistics::state_age_us)
      .has("clock_drift_ppm", &Statistics::clock_drift_ppm)
      .has("clock_drift_error_ppm", &Statistics::clock_drift_error_ppm)
      .has("heartbeats", &Statistics::heartbeats)
      .has("commands", &Statistics::commands)
      .has("retries", &Statistics::retries)
      .has("confirmed", &Statistics::confirmed)
      .has("refused", &Statistics::refused)
      .has("timed_out", &Statistics::timed_out);
  Record<CarrierCounters>(module, "CarrierCounters")
      .has("rx_datagrams", &CarrierCounters::rx_datagrams)
      .has("rx_bytes", &CarrierCounters::rx_bytes)
      .has("rx_oversize", &CarrierCounters::rx_oversize)
      .has("rx_foreign", &CarrierCounters::rx_foreign)
      .has("rx_overflows", &CarrierCounters::rx_overflows)
      .has("tx_datagrams", &CarrierCounters::tx_datagrams)
      .has("tx_bytes", &CarrierCounters::tx_bytes)
      .has("tx_dropped", &CarrierCounters::tx_dropped)
      .has("tx_errors", &CarrierCounters::tx_errors)
      .has("downs", &CarrierCounters::downs)
      .has("ups", &CarrierCounters::ups);
  Record<CarrierEvent>(module, "Event")
      .has("kind", &CarrierEvent::kind)
      .has("thing", [](const CarrierEvent& event) { return printable(event.problem.thing); })
      .has("reason", [](const CarrierEvent& event) { return printable(event.problem.reason); })
      .has("fix", [](const CarrierEvent& event) { return printable(event.problem.fix); });
  Record<RefusedPost>(module, "RefusedPost")
      .has("refusal", &RefusedPost::code)
      .has("why", [](const RefusedPost& post) { return post.why.value(); })
      .has("at", [](const RefusedPost& post) { return static_cast<int>(post.at); })
      .has("group", [](const RefusedPost& post) { return static_cast<int>(post.group); });
}

}  // namespace r4::python
