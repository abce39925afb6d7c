# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of browsers: the share of a processor and the memory of r4 web, with eight simulated boards at 100 Hz.

    R4=build/r4 PYTHONPATH=tests/integration /usr/bin/python3 tests/bench/web_bench.py [SECONDS]
"""
import contextlib
import selectors
import sys
import time

from r4_process import Board
from web_client import PONG, Web, WebSocket

BOARDS = 8
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 5
ALIVE_S = 5  # r4 web drops a browser that is silent for more than 20 s


def drain(clients, seconds):
    """Reads and ignores the data of all browsers. Returns bytes a second."""
    selector = selectors.DefaultSelector()
    for each in clients:
        each.socket.setblocking(False)
        selector.register(each.socket, selectors.EVENT_READ)
    received = 0
    until = time.monotonic() + seconds
    alive = time.monotonic() + ALIVE_S
    while (left := until - time.monotonic()) > 0:
        for key, _ in selector.select(min(left, ALIVE_S)):
            with contextlib.suppress(BlockingIOError):
                part = key.fileobj.recv(1 << 20)
                assert part, 'r4 web has dropped a browser'
                received += len(part)
        if time.monotonic() > alive:
            alive += ALIVE_S
            for each in clients:
                each.send(b'', PONG)
    selector.close()
    return received / seconds


def measure(boards, count):
    with Web(*(each.host_url for each in boards)) as web, contextlib.ExitStack() as stack:
        clients = [stack.enter_context(WebSocket(web.port)) for _ in range(count)]
        drain(clients, 1)
        before, cpu = web.resident_kib(), web.cpu_seconds()
        rate = drain(clients, SECONDS)
        share = (web.cpu_seconds() - cpu) / SECONDS
        print(f'{len(boards)} boards, {count:2} browsers: {share:6.1%} of a core, {rate / 1e6:5.2f} MB/s, '
              f'{web.resident_kib()} KiB, {web.resident_kib() - before:+} KiB in {SECONDS} s', flush=True)


with contextlib.ExitStack() as all_boards:
    simulated = [all_boards.enter_context(Board('udp://127.0.0.1:0')) for _ in range(BOARDS)]
    for number in (0, 1, 50):
        measure(simulated, number)
    for number in (0, 1):
        measure(simulated[:1], number)
