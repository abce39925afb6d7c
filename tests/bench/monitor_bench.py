# SPDX-License-Identifier: GPL-3.0-or-later
"""The shares of a processor that a board and its monitor use at 100 Hz. The goal is 2 % for each program.

    R4=build/r4 PYTHONPATH=tests/integration /usr/bin/python3 tests/bench/monitor_bench.py [SECONDS]
"""
import sys

from r4_process import Board, cost_of_watching, monitor

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 10
AIM = 0.02

for url in ('udp://127.0.0.1:0', 'pty:'):
    with Board(url) as board, monitor(board.host_url) as host:
        rate_hz, shares = cost_of_watching(board, host, SECONDS)
    print(f'{url:18} {rate_hz:.0f} Hz, board {shares[0]:.1%} and monitor {shares[1]:.1%} of a core '
          f'(aim {AIM:.0%})', flush=True)
