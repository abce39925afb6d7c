# SPDX-License-Identifier: GPL-3.0-or-later
"""Several boards on one CAN bus. Usage: pytest -m can, with a CAN interface (README.md)."""
import socket
import struct

import pytest

pytestmark = [pytest.mark.can, pytest.mark.r4(transport='can', boards=2)]
EMERGENCY_STOP = 0x010  # docs/reference/can.md: any content, obeyed by every board


@pytest.fixture(name='button')
def a_stop_button(request):
    """Sends the stop as a stop button with a CAN controller, without R4 software."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as controller:
        controller.bind((request.config.getoption('--r4-interface'),))
        yield lambda: controller.send(struct.pack('=IB3x8s', EMERGENCY_STOP, 0, b''))


def test_a_stop_button_on_the_bus_stops_every_board(r4_bus, button):
    for board in r4_bus:
        board.arm(timeout=3)
        board.osmc(1).set_pwm(500, timeout=3)
    button()
    for board in r4_bus:
        board.expect_safe('stop')


def test_each_board_obeys_only_its_own_host(r4_bus):
    left, right = r4_bus
    left.arm(timeout=3)
    left.osmc(1).set_pwm(500, timeout=3)
    left.expect(osmc1=500)
    assert right.robot.look().is_safe
