// SPDX-License-Identifier: GPL-3.0-or-later
// r4::control for r4link/control.py: small structures as tuples, times in seconds.
#include <pybind11/stl.h>

#include <chrono>
#include <string>
#include <tuple>

#include "bindings.hpp"
#include "r4link/control/kinematics.hpp"
#include "r4link/control/loop.hpp"
#include "r4link/control/odometry.hpp"
#include "r4link/control/pid.hpp"
#include "r4link/control/sensors.hpp"

namespace r4::python {
namespace {

using control::Ackermann;
using control::DifferentialDrive;
using control::FourWheelDrive;
using control::LoopGuard;
using control::LoopOptions;
using control::Odometry;
using control::Pid;
using control::Pose;
using control::SteeringSensor;
using control::Twist;
using control::Wheel;
using Ms = std::chrono::milliseconds;
using Pair = std::tuple<double, double>;
using Clock = LoopGuard::Clock;

// `seconds`: as from time.monotonic().
Clock::time_point at(double seconds) {
  return Clock::time_point(
      std::chrono::round<Clock::duration>(std::chrono::duration<double>(seconds)));
}

CommandKind drive_kind(const std::string& name) {
  if (name == "osmc") return CommandKind::osmc;
  if (name == "dhb12") return CommandKind::dhb12;
  if (name == "bldc") return CommandKind::bldc;
  throw Error(ErrorKind::usage, "drive '" + name + "'", "the output does not exist",
              "give 'osmc', 'dhb12' or 'bldc'");
}

void bind_pid_and_sensors(py::module_& module) {
  py::class_<Pid>(module, "Pid")
      .def(py::init([](double kp, double ki, double kd, double feed_forward, double minimum,
                       double maximum, double rate, double derivative_filter) {
        return Pid({kp, ki, kd, feed_forward, minimum, maximum, rate, derivative_filter});
      }))
      .def("step", &Pid::step)
      .def("reset", &Pid::reset)
      .def("take_over", &Pid::take_over)
      .def_property_readonly("output", &Pid::output)
      .def_property_readonly("integral", &Pid::integral);
  py::class_<Wheel>(module, "Wheel")
      .def(py::init([](int encoder, double counts_a_turn, double radius, bool reversed,
                       std::uint32_t window_ms, double max_speed) {
        return Wheel({encoder, counts_a_turn, radius, reversed}, window_ms, max_speed);
      }))
      .def("advance", [](Wheel& self, const ReceivedState& state) { return self.advance(state); })
      .def("measured",
           [](const Wheel& self, const ReceivedState& state) { return self.measured_m_s(state); })
      .def("reset", &Wheel::reset)
      .def_property_readonly("speed", &Wheel::speed_m_s);
  py::class_<SteeringSensor>(module, "SteeringSensor")
      .def(py::init([](const Pair& left, const Pair& right, double margin) {
        return SteeringSensor(
            {std::get<0>(left), std::get<1>(left), std::get<0>(right), std::get<1>(right), margin});
      }))
      .def("angle", [](const SteeringSensor& self,
                       const ReceivedState& state) { return self.angle_rad(state); })
      .def("volts", &SteeringSensor::volts);
}

void bind_kinematics(py::module_& module) {
  py::class_<DifferentialDrive>(module, "DifferentialDrive")
      .def(py::init([](double separation, double max_wheel) {
        return DifferentialDrive({separation, max_wheel});
      }))
      .def("wheels",
           [](const DifferentialDrive& self, double forward, double turn) {
             const auto wheels = self.wheels({forward, turn});
             return Pair{wheels.left_m_s, wheels.right_m_s};
           })
      .def("twist", [](const DifferentialDrive& self, double left, double right) {
        const Twist twist = self.twist({left, right});
        return Pair{twist.forward_m_s, twist.turn_rad_s};
      });
  py::class_<FourWheelDrive>(module, "FourWheelDrive")
      .def(py::init([](double track, double slip, double max_wheel) {
        return FourWheelDrive({track, slip, max_wheel});
      }))
      .def("wheels",
           [](const FourWheelDrive& self, double forward, double turn) {
             const auto wheels = self.wheels({forward, turn});
             return std::tuple{wheels.front_left_m_s, wheels.rear_left_m_s, wheels.front_right_m_s,
                               wheels.rear_right_m_s};
           })
      .def("twist", [](const FourWheelDrive& self, double front_left, double rear_left,
                       double front_right, double rear_right) {
        const Twist twist = self.twist({front_left, rear_left, front_right, rear_right});
        return Pair{twist.forward_m_s, twist.turn_rad_s};
      });
  py::class_<Ackermann>(module, "Ackermann")
      .def(py::init([](double wheelbase, double track, double max_steering, double max_speed) {
        return Ackermann({wheelbase, track, max_steering, max_speed});
      }))
      .def("command",
           [](const Ackermann& self, double forward, double turn) {
             const auto command = self.command({forward, turn});
             return Pair{command.speed_m_s, command.steering_rad};
           })
      .def("twist",
           [](const Ackermann& self, double speed, double steering) {
             const Twist twist = self.twist({speed, steering});
             return Pair{twist.forward_m_s, twist.turn_rad_s};
           })
      .def("limited_steering", &Ackermann::limited_steering)
      .def("front_wheels",
           [](const Ackermann& self, double steering) {
             const auto wheels = self.front_wheels(steering);
             return Pair{wheels.left_rad, wheels.right_rad};
           })
      .def("rear_wheels", [](const Ackermann& self, double speed, double steering) {
        const auto wheels = self.rear_wheels({speed, steering});
        return Pair{wheels.left_m_s, wheels.right_m_s};
      });
  py::class_<Odometry>(module, "Odometry")
      .def(py::init([](double length_per_m, double turn_per_m, double turn_per_rad) {
        return Odometry({length_per_m, turn_per_m, turn_per_rad});
      }))
      .def("advance", &Odometry::advance)
      .def("reset",
           [](Odometry& self, double x, double y, double yaw,
              const Odometry::Covariance& covariance) {
             self.reset({x, y, yaw}, covariance);
           })
      .def_property_readonly("pose",
                             [](const Odometry& self) {
                               const Pose& pose = self.pose();
                               return std::tuple{pose.x_m, pose.y_m, pose.yaw_rad};
                             })
      .def_property_readonly(
          "covariance", [](const Odometry& self) { return py::tuple(py::cast(self.covariance())); })
      .def("ros_covariance", [](const Odometry& self, double unknown) {
        return py::tuple(py::cast(self.ros_covariance(unknown)));
      });
}

}  // namespace

void bind_control(py::module_& module) {
  bind_pid_and_sensors(module);
  bind_kinematics(module);
  py::class_<LoopOptions>(module, "LoopOptions")
      .def(py::init([](const std::string& fields, int late_ms, int first_ms, const Setpoints& rest,
                       int rest_timeout_ms, int watchdog_ms, bool arming) {
        LoopOptions options;
        options.fields = fields;
        options.late = Ms(late_ms);
        options.first = Ms(first_ms);
        options.rest = rest;
        options.rest_timeout = Ms(rest_timeout_ms);
        options.watchdog = Ms(watchdog_ms);
        options.arming = arming ? Arming::required : Arming::off;
        return options;
      }))
      .def("add_standstill", [](LoopOptions& self, int encoder, const std::string& drive,
                                int channel, int pwm, int counts, int time_ms) {
        self.standstill.push_back({encoder, drive_kind(drive), channel, pwm, counts, Ms(time_ms)});
      });
  py::class_<LoopGuard>(module, "LoopGuard")
      .def(py::init<LoopOptions>())
      .def("start", [](LoopGuard& self, double now) { self.start(at(now)); })
      .def("on_state", [](LoopGuard& self, const ReceivedState& state, DisarmCause disarmed_by,
                          double now) { return self.on_state(state, disarmed_by, at(now)); })
      .def("on_commanded", &LoopGuard::on_commanded)
      .def("check", [](LoopGuard& self, HostLinkState link, DisarmCause disarmed_by,
                       double now) { return self.check(link, disarmed_by, at(now)); })
      .def_property_readonly(
          "deadline",
          [](const LoopGuard& self) {
            return std::chrono::duration<double>(self.deadline().time_since_epoch()).count();
          })
      .def_property_readonly("ended", &LoopGuard::ended)
      .def_property_readonly("why", &LoopGuard::why);
  module.def("wrapped", &control::wrapped);
}

}  // namespace r4::python
