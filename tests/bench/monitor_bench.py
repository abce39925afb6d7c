# SPDX-License-Identifier: GPL-3.0-or-later
"""What a board and its monitor cost at 100 Hz: their shares of a processor. The aim is 2 % each.

    R4=build/r4 PYTHONPATH=tests/integration /usr/bin/python3 tests/bench/monitor_bench.py [SECONDS]
"""
import sys
import time

from r4_process import Board, is_state, monitor

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 10
AIM = 0.02

for url in ('udp://127.0.0.1:0', 'pty:'):
    with Board(url) as board, monitor(board.host_url) as host:
        host.next(is_state)
        before = [each.cpu_seconds() for each in (board, host)]
        until = time.monotonic() + SECONDS
        states = 0
        while time.monotonic() < until:
            host.next(is_state)
            states += 1
        shares = [(each.cpu_seconds() - cpu) / SECONDS for each, cpu in zip((board, host), before)]
    print(f'{url:18} {states / SECONDS:.0f} Hz, board {shares[0]:.1%} and monitor {shares[1]:.1%} of a core '
          f'(aim {AIM:.0%})', flush=True)
