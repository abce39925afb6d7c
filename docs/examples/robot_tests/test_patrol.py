# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests as in the repository of a robot team. If r4link is installed, pytest finds the fixtures by itself."""
import threading
import time

import patrol
import pytest


def until(done, within=3.0):
    deadline = time.monotonic() + within
    while not done():
        assert time.monotonic() < deadline, 'it did not happen'
        time.sleep(0.002)


def test_the_robot_reverses_near_an_obstacle(r4_robot):
    program = threading.Thread(target=patrol.patrol, args=(r4_robot.url,))
    program.start()
    until(lambda: r4_robot.look().osmc[0].duty > 0.2)
    r4_robot.happen('us 1 15')  # a wall
    until(lambda: r4_robot.look().osmc[0].duty < -0.2)
    r4_robot.happen('us 1 0')
    program.join(5)
    assert not program.is_alive()


def test_a_released_handle_stops_the_robot(r4_board):
    r4_board.arm(timeout=3)
    r4_board.osmc(1).set_pwm(358, timeout=3)
    r4_board.expect(osmc1=358, ain24=lambda volts: volts > 20)
    r4_board.robot.happen('handle released')
    r4_board.expect_safe('handle', within=0.5)


@pytest.mark.r4(boards=3, arming=False)
def test_the_wheels_of_three_boards_turn(r4_bus):
    for board in r4_bus:
        board.relay(1).set(True, timeout=3)
        board.osmc(1).set_pwm(2000, timeout=3)
    for board in r4_bus:
        board.expect(osmc1=2000)
        until(lambda board=board: board.robot.look().encoder[0] > 10)


@pytest.mark.r4(link='loss=10%,delay=10ms±10,duplicate=5%,corrupt=5%,seed=7')
def test_the_robot_drives_over_a_bad_link(r4_link):
    r4_link.arm(timeout=3)
    for pwm in (100, 200, 300):
        r4_link.osmc(1).set_pwm(pwm, timeout=3)
        r4_link.expect(osmc1=pwm)


@pytest.mark.r4(link='cut=2s+1.3s')
def test_the_motors_are_off_while_the_link_is_cut(r4_link):
    r4_link.arm(timeout=3)
    r4_link.osmc(1).set_pwm(300, timeout=3)
    until(lambda: r4_link.robot.look().osmc[0] == (300, 1))
    until(lambda: r4_link.robot.look().is_safe, within=5)
    until(lambda: r4_link.robot.look().osmc[0] == (300, 1))  # the link resumes with the last setpoints (recovery=last)


@pytest.mark.r4(transport='pty', link='corrupt=10%,seed=3')
def test_damage_on_a_serial_line_is_counted(r4_link):
    r4_link.arm(timeout=3)
    for pwm in (100, 200, 300):
        r4_link.osmc(1).set_pwm(pwm, timeout=3)
        r4_link.expect(osmc1=pwm)
    until(lambda: r4_link.statistics.damaged > 0)


@pytest.mark.r4(transport='pty')
def test_a_board_is_driven_and_stopped_over_a_serial_line(r4_board):
    r4_board.arm(timeout=3)
    r4_board.servo(3).set(us=1500, timeout=3)
    r4_board.expect(relays=1)
    r4_board.stop()
    r4_board.expect_safe('stop')
