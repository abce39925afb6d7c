# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.control: one test per class, and a control loop on a board. tests/host/control has more tests, in C++."""
import math
import time

import pytest

import r4link
from r4link import Command, Setpoints, control
from r4link.testing import make_state


def test_pid_follows_its_gains_and_limits():
    pid = control.Pid(0.5, 2.0, feed_forward=0.1, minimum=-10, maximum=10)
    assert pid.step(4, 3, 0.1) == pytest.approx(1.1)
    assert (pid.output, pid.integral) == pytest.approx((1.1, 0.2))
    pid.take_over(3.0, 1, 1)
    assert pid.step(1, 1, 0.001) == pytest.approx(3.0)
    assert control.Pid(1.0, rate=2).step(9, 0, 0.1) == pytest.approx(0.2)
    with pytest.raises(r4link.UsageError, match='minimum'):
        control.Pid(1.0, minimum=1)
    with pytest.raises(r4link.DataError):
        pid.step(math.nan, 0, 0.1)


def test_kinematics_convert_in_both_directions():
    twist = control.Twist(1.0, 0.5)
    two = control.DifferentialDrive(0.5)
    assert two.wheels(twist) == control.SideSpeeds(0.875, 1.125)
    assert two.twist(two.wheels(twist)) == pytest.approx(twist)
    four = control.FourWheelDrive(0.4, slip=2.0)
    assert four.wheels(twist).rear_right == pytest.approx(1.2)
    assert four.twist(four.wheels(twist)) == pytest.approx(twist)
    car = control.Ackermann(1.0, 0.6, track=0.6, max_speed=2)
    assert car.twist(car.command(twist)) == pytest.approx(twist)
    assert car.command(control.Twist(5.0)).speed == 2 and car.limited_steering(1) == 0.6
    assert car.front_wheels(0.4).left > 0.4 > car.front_wheels(0.4).right
    assert car.rear_wheels(car.command(twist)).right > 1


def test_odometry_computes_the_pose_and_its_covariance():
    odometry = control.Odometry(turn_per_m=0)
    odometry.advance(math.pi, math.pi)
    assert odometry.pose == pytest.approx((0, 2, math.pi)) or odometry.pose.yaw == pytest.approx(-math.pi)
    assert odometry.covariance[8] == pytest.approx(0.0025 * math.pi)
    assert odometry.ros_covariance(7)[35] == odometry.covariance[8] and odometry.ros_covariance(7)[14] == 7
    odometry.reset(control.Pose(1, 2, 0))
    assert odometry.pose == (1, 2, 0) and not any(odometry.covariance)
    assert control.wrapped(3 * math.pi / 2) == pytest.approx(-math.pi / 2)


@pytest.fixture(name='armed')
def a_board_that_may_drive(sim):
    with r4link.Board(sim.url, fields='OSMC1,ENC1,ENC1HZ,AINSTEER') as board:
        board.wait_active()
        board.arm()
        yield board


def osmc(duty):
    return Setpoints(Command.osmc(1, duty=duty))


def test_a_loop_controls_a_speed_and_comes_to_rest(armed, sim):
    wheel = control.Wheel(1, 4000, 1 / math.pi, window=0.05)  # 2 m/s at full duty
    pid = control.Pid(0.5, 2.0, feed_forward=0.3)
    sensor = control.SteeringSensor((4.0, 0.6), (1.0, -0.6))
    passed, way, measured, angles = 0.0, 0.0, 0.0, []

    def step(state, dt):
        nonlocal passed, way, measured
        passed += dt
        way += wheel.advance(state)
        measured = wheel.measured(state)
        angles.append(sensor.angle(state))
        return osmc(pid.step(1.0, wheel.speed, dt)) if passed < 1.2 else None

    report = control.run_loop(armed, step, rest=osmc(0), fields='ENC1,AINSTEER', late=1.0, watchdog=1.0,
                              standstill=[control.Standstill(time=2.0)])
    assert (report.end, report.at_rest) == ('asked', True), report
    assert wheel.speed == pytest.approx(1.0, rel=0.2) and measured == pytest.approx(1.0, rel=0.3)
    assert 0.5 < way < 1.4 and report.steps > 10
    assert angles[-1] == pytest.approx(-0.6, abs=0.1) and sensor.volts(0) == pytest.approx(2.5)
    assert sim.look().osmc[0].pwm == 0


def test_an_error_in_a_step_is_raised_after_the_outputs_rest(armed, sim):
    def step(state, dt):
        if state.enc1 > 5:
            raise RuntimeError('no path')
        return osmc(0.5)

    with pytest.raises(RuntimeError, match='no path'):
        control.run_loop(armed, step, rest=osmc(0), fields='ENC1', late=1.0, watchdog=1.0)
    assert sim.look().osmc[0].pwm == 0
    with pytest.raises(r4link.UsageError, match='rest'):
        control.run_loop(armed, step, rest=Setpoints())


def test_a_loop_ends_when_the_handle_is_released(armed, sim):
    def step(state, dt):
        if state.enc1 > 5:
            sim.handle(False)
        return osmc(0.5)

    report = control.run_loop(armed, step, rest=osmc(0), fields='ENC1', late=1.0, watchdog=1.0)
    assert report.end in ('disarmed', 'not active') and 'handle' in report.why and report.at_rest
    assert sim.look().is_safe


def test_a_loop_guard_ends_a_custom_loop_that_is_late(armed):
    guard = control.LoopGuard(fields='ENC1', late=0.2)
    guard.start(time.monotonic())
    state = armed.next_state()
    now = state.sampled
    assert guard.on_state(state, armed.disarmed_by, now) == 0.0
    guard.on_commanded(osmc(0.5))
    assert guard.deadline == pytest.approx(now + 0.2, abs=0.001)
    assert guard.check('active', 'none', now + 0.1) == 'none'
    assert guard.check('active', 'none', now + 0.3) == 'late'
    assert guard.ended == 'late' and '200 ms' in guard.why
    with pytest.raises(r4link.UsageError):
        guard.check('well', 'none', now)


def test_make_state_builds_states_for_tests():
    made = make_state(10, enc1=-5, enc3hz=7, ainsteer=2.5, osmc1=(400, 1), dhb2b=(5, 0), us4=9, dmhsta=True, safe='handle',
                      servo3pos=1500, bldc2=(1, 0, True), relays=3, step2pos=-4, enc4idx=1, ain6=0.5)
    assert made.as_dict() == {
        'pnum': 0, 't_ms': 10, 'enc1': -5, 'enc3hz': 7, 'ainsteer': 2.5, 'osmc1': (400, 1), 'dhb2b': (5, 0), 'us4': 9,
        'dmhsta': True, 'safe': 'handle', 'servo3pos': 1500, 'bldc2': (1, 0, True), 'relays': 3, 'step2pos': -4,
        'enc4idx': 1, 'ain6': 0.5}
    assert made.received == made.sampled == 0.01
    wheel = control.Wheel(1, 1000, 0.5 / math.pi)
    wheel.advance(make_state(0, enc1=0))
    assert wheel.advance(make_state(10, enc1=20)) == pytest.approx(0.02) and wheel.speed == pytest.approx(2)
    with pytest.raises(r4link.UsageError, match='enc9'):
        make_state(0, enc9=1)
    with pytest.raises(r4link.UsageError, match='cmd'):
        make_state(0, cmd=1)
    for field, value in {'osmc1': (4096, 1), 'bldc1': (1, 1), 'relays': 256, 'servo1pos': -1, 'ain24': math.nan}.items():
        with pytest.raises(r4link.UsageError, match=field):
            make_state(0, **{field: value})
    assert make_state(0, dac2=3300, gpio=255).as_dict() == {'pnum': 0, 't_ms': 0, 'dac2': 3300, 'gpio': 255}
