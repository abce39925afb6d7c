# SPDX-License-Identifier: GPL-3.0-or-later
"""The serial transport on a USB serial port with its real driver, in the guest of tools/with-can.

The board at the far end of the cable is simulated, outside of the guest. usb_serial_inside.py runs in the guest. The
input and output of this program are another path to the board.
"""
import json
import os
import pathlib
import subprocess
import threading
import tty

from host_on_paths import require_executed_as_told
from r4_process import Board

HERE = pathlib.Path(__file__).resolve().parent
WITH_CAN = HERE.parents[1] / 'tools' / 'with-can'


def carry(source, destination):
    """Copies all bytes, in a new thread, until either end is closed."""
    def run():
        try:
            while received := os.read(source, 4096):
                os.write(destination, received)
        except OSError:
            pass
    threading.Thread(target=run, daemon=True).start()


def test_a_usb_serial_board_is_found_again_after_unplugging(tmp_path):
    cable, other, told, commands = (tmp_path / name for name in ('board', 'other', 'told', 'commands'))
    with Board(f'pty:{cable}', f'pty:{other}') as board, open(told, 'wb') as errors:
        end = os.open(other, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(end)
        with subprocess.Popen([WITH_CAN, '--usb-serial', cable, '--time', '600', '/usr/bin/python3',
                               HERE / 'usb_serial_inside.py', commands], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, stderr=errors) as inside:
            carry(end, inside.stdin.fileno())
            carry(inside.stdout.fileno(), end)
            status = inside.wait(timeout=660)
        print(told.read_text())
        log = board.rest()
        os.close(end)
        if status:
            print(*({name: value for name, value in each.items() if name != 'outputs'} for each in log[-100:]), sep='\n')
        assert status == 0
    require_executed_as_told(json.loads(commands.read_text()), log)
