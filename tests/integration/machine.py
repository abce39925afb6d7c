# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounds of real time on a machine that also does other work.

A program can keep a bound of milliseconds only while it has a processor. So within() adds to a bound the time that the
programs of the test waited for a processor. On an idle machine this time is 0.
"""
import contextlib
import math
import os
import threading
import time

# Sanitizers make programs slower and bigger, so bounds of time and memory are for release builds.
SANITIZED = 'R4_SANITIZER' in os.environ
# True if a test can rely on bounds of milliseconds. False with a sanitizer, and in the guest of
# tools/with-can, which emulates its processor. If false, a test asserts only the order of events,
# and that no event occurs too early.
PROMPT = not SANITIZED and 'R4_CAN_GUEST' not in os.environ
LOOK_S = 0.1  # a wait between the last look at a program and its end is not counted


def waits_of(process, waits):
    """Puts into `waits` how long each thread of a process and its descendants has waited for a processor, in ns."""
    with contextlib.suppress(OSError):
        for thread in os.listdir(f'/proc/{process}/task'):
            folder = f'/proc/{process}/task/{thread}'
            with contextlib.suppress(OSError), open(f'{folder}/schedstat', encoding='ascii') as waited, \
                    open(f'{folder}/children', encoding='ascii') as children:
                waits[thread] = int(waited.read().split()[1])
                for child in children.read().split():
                    waits_of(child, waits)


class Account:
    """The time that the machine kept the programs of one test waiting, since begin()."""

    def __init__(self):
        self.standstill_s = 0.0  # the longest time that this thread was kept from running
        self._lock = threading.Lock()
        self._before = {}
        self._waits = {}
        self._thread = threading.Thread(target=self._look, daemon=True)

    def begin(self):
        with self._lock:
            self.standstill_s, self._before = 0.0, {}
            if PROMPT:
                waits_of(os.getpid(), self._before)
            self._waits = dict(self._before)
        if not self._thread.is_alive():
            self._thread.start()

    def waited_s(self):
        """The sum over all threads, including those of programs that have ended."""
        with self._lock:
            if PROMPT:
                waits_of(os.getpid(), self._waits)
            return sum(waited - self._before.get(thread, 0) for thread, waited in self._waits.items()) / 1e9

    def _look(self):
        while True:
            began = time.monotonic()
            time.sleep(LOOK_S)
            self.standstill_s = max(self.standstill_s, time.monotonic() - began - LOOK_S)
            self.waited_s()


account = Account()


def within(seconds):
    """A bound of real time for the programs of this test, in seconds."""
    return seconds + max(account.waited_s(), account.standstill_s) if PROMPT else math.inf


def within_ms(milliseconds):
    return 1000 * within(milliseconds / 1000)
