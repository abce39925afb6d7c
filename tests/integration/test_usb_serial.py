# SPDX-License-Identifier: GPL-3.0-or-later
"""The serial transport on a USB serial port with its real driver, in the guest of tools/with-can.

The board at the far end of the cable is simulated, outside. Inside runs usb_serial_inside.py.
"""
import pathlib
import subprocess

from r4_process import Board

HERE = pathlib.Path(__file__).resolve().parent
WITH_CAN = HERE.parents[1] / 'tools' / 'with-can'


def test_listed_streamed_unplugged_under_way_and_found_again_by_its_serial_number(tmp_path):
    path = tmp_path / 'board'
    with Board(f'pty:{path}'):
        inside = subprocess.run(
            [WITH_CAN, '--usb-serial', path, '--time', '60', '/usr/bin/python3',
             HERE / 'usb_serial_inside.py'], stdin=subprocess.DEVNULL, capture_output=True,
            text=True, timeout=300, check=False)
    print(inside.stdout)
    assert inside.returncode == 0, inside.stderr
