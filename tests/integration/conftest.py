# SPDX-License-Identifier: GPL-3.0-or-later
"""A failure while the machine stood still is repeated: it says nothing about r4.

Bounds of real time are what r4 promises, so they are tested; a virtual machine that is paused breaks
them all. A thread that only looks at the clock tells; a failure without a standstill counts at once.
Each repeat is a line of build/results/repeats.txt, and they are counted at the end of a run.
"""
import pathlib
import signal
import threading
import time

import pytest
from _pytest.runner import runtestprotocol

import own_network

# What the tests run is interrupted; under nohup, or in the background of a shell, it would ignore that.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

own_network.enter()

LOOK_S = 0.025  # seldom enough for the emulated machine of tools/with-can
STANDSTILL_S = 0.02 + LOOK_S  # as exact as the promises are
MOST_RUNS = 3
LONGEST_S = 80  # what takes longer runs in the guest, and has this rule there
REPEATS = pathlib.Path(__file__).resolve().parents[2] / 'build/results/repeats.txt'
repeated = []


class Watch:
    """The longest that this process was kept from running while it is entered, in seconds."""

    def __enter__(self):
        self.longest = 0.0
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._done.set()
        self._thread.join()

    def _look(self):
        before = time.monotonic()
        done = False
        while not done:
            done = self._done.wait(LOOK_S)
            now = time.monotonic()
            self.longest = max(self.longest, now - before)
            before = now


def note_repeat(line):
    repeated.append(line)
    REPEATS.parent.mkdir(parents=True, exist_ok=True)
    with open(REPEATS, 'a', encoding='utf-8') as file:
        file.write(line + '\n')


def pytest_terminal_summary(terminalreporter):
    if repeated:
        terminalreporter.write_line(f'{len(repeated)} repeated because the machine stood still: {", ".join(repeated)}')


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for run in range(1, MOST_RUNS + 1):
        began = time.monotonic()
        with Watch() as watch:
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
        failed = [each for each in reports if each.failed]
        took = time.monotonic() - began
        if not failed or watch.longest < STANDSTILL_S or run == MOST_RUNS or took > LONGEST_S:
            break
        note_repeat(f'{item.nodeid}: {watch.longest * 1000:.0f} ms')
        item.config.pluginmanager.get_plugin('terminalreporter').write(
            f'\n{item.nodeid}: The machine stood still for {watch.longest * 1000:.0f} ms: run again. It said\n'
            f'{failed[0].longreprtext}\n')
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True
