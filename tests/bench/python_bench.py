#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of the Python package with a simulated board on UDP, compared with its limits.

    PYTHONPATH=build/python R4=build/r4 tests/bench/python_bench.py [SECONDS]

Exit code 1 if a limit is exceeded. The processor time is the time of this process: link and interpreter together.
"""
import asyncio
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import zlib

import r4link

BUILD = pathlib.Path(os.environ['R4']).resolve().parent
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 5
READ = '''
import resource, sys, time, r4link, numpy
begin = time.monotonic()
[robot] = r4link.read(sys.argv[1]).boards
print(time.monotonic() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, len(robot.states))
'''
missed = []


def tell(what, value, unit, bar):
    print(f'{what:52} {value:8.2f} {unit:3} bar {bar:g}: {"met" if value <= bar else "MISSED"}')
    if value > bar:
        missed.append(what)


def processor_s():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


class Count:
    """Reads one field of each state, which is the least work of a program."""

    def __init__(self):
        self.number = 0
        self.volts = 0.0

    def __call__(self, state):
        self.number += 1
        self.volts = state.ain24


def processor_share(board, seconds, callback=None):
    subscription = board.on_state(callback) if callback else None
    board.next_state()
    began, used = time.monotonic(), processor_s()
    time.sleep(seconds)
    share = (processor_s() - used) / (time.monotonic() - began)
    if subscription:
        subscription.cancel()
    return share


def receiving(board):
    tell('receiving 100 Hz, share of a core', processor_share(board, SECONDS) * 100, '%', 2)
    tell('the same with a callback', processor_share(board, SECONDS, Count()) * 100, '%', 2)


def callbacks(board):
    """Measures at 1000 Hz, in turns with and without the callback."""
    board.setting('rate', '1000')
    costs = []
    for _ in range(3):
        without = processor_share(board, SECONDS / 3)
        count = Count()
        began = time.monotonic()
        share = processor_share(board, SECONDS / 3, count)
        costs.append((share - without) * 1e6 * (time.monotonic() - began) / count.number)
    tell('a state to a callback, processor time', statistics.median(costs), 'us', 15)
    ages = []
    subscription = board.on_state(lambda state: ages.append(time.monotonic() - state.received))
    time.sleep(SECONDS / 3)
    subscription.cancel()
    ages.sort()
    print(f'from reception to a callback: p50 {ages[len(ages) // 2] * 1e6:.0f} us, '
          f'p99 {ages[len(ages) * 99 // 100] * 1e6:.0f} us')


def blocking_us(url, count):
    with r4link.Board(url) as board:
        board.wait_active()
        us = []
        for i in range(count):
            began = time.perf_counter()
            board.send(r4link.Command.proximity(1, cm=i % 2))
            us.append((time.perf_counter() - began) * 1e6)
    return us


def sending(url):
    """Measures confirmed commands, in turns from Python and from C++."""
    python, native = [], []
    for _ in range(5):
        native.append(float(subprocess.run([BUILD / 'tests/bench/r4_confirmed_send', url, '300'], check=True,
                                           stdout=subprocess.PIPE).stdout))
        python.append(statistics.median(blocking_us(url, 300)))
    print(f'confirmed at 1000 Hz: p50 {statistics.median(python):.0f} us, in C++ {statistics.median(native):.0f} us')
    tell('confirmed send against C++', statistics.median(python) / statistics.median(native), '', 1.1)


async def awaited_us(url, count):
    async with r4link.aio.Board(url) as board:
        await board.wait_active()
        us = []
        for i in range(count):
            began = time.perf_counter()
            await board.send(r4link.Command.proximity(1, cm=i % 2))
            us.append((time.perf_counter() - began) * 1e6)
    return us


def awaiting(url):
    """Measures confirmed commands, in turns awaited and blocking."""
    awaited, blocking = [], []
    for _ in range(5):
        awaited.append(statistics.median(asyncio.run(awaited_us(url, 300))))
        blocking.append(statistics.median(blocking_us(url, 300)))
    tell('confirmed send, asyncio against blocking', statistics.median(awaited) / statistics.median(blocking), '', 1.2)


def reading(folder):
    path = folder / 'hour.r4log'
    with open(path, 'w', encoding='ascii') as log:
        log.write('# r4log 1 by r4 0.1.0\n# path 1 udp://192.168.0.125 left-arm\n')
        for i in range(360_000):
            body = (f'AIN24:24.{i % 40 + 10};AIN12:12.15;AIN5:5.09;AINDMH:12.18;DMHSTA:1;AINSTEER:2.50;DHB1A:0,1;'
                    f'OSMC1:{i % 4096},1;STEP1POS:{i};SERVO1POS:1500;RELAYS:1;SAFE:0;CMD:{i};PNum:{i};T:{i * 10};^')
            log.write(f'{1795468293 + i / 100:.6f} 1< {body}0x{zlib.crc32(body.encode()):x}^\n')
    seconds, mib, states = map(float, subprocess.run([sys.executable, '-c', READ, path], check=True,
                                                     stdout=subprocess.PIPE).stdout.split())
    print(f'an hour of one board: {states:.0f} states, {path.stat().st_size / 1e6:.0f} MB of text')
    tell('r4link.read', seconds, 's', 3)
    tell('r4link.read, memory at most', mib, 'MiB', 200)


def main():
    with r4link.SimBoard('udp://127.0.0.1:0') as sim:
        with r4link.Board(sim.url) as board:
            board.wait_active()
            receiving(board)
            callbacks(board)
        sending(sim.url)
        awaiting(sim.url)
    with tempfile.TemporaryDirectory() as folder:
        reading(pathlib.Path(folder))
    sys.exit(bool(missed))


main()
