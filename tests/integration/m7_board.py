# SPDX-License-Identifier: GPL-3.0-or-later
"""A running tools/m7, watchers of its board, and a relay between the board and a host."""
import collections
import json
import os
import pathlib
import queue
import re
import select
import signal
import socket
import subprocess
import threading
import time
import tty

from r4_process import PATIENCE_S

M7 = str(pathlib.Path(__file__).resolve().parents[2] / 'tools/m7')
FIRST_BUILD_S = 240  # includes the installation of packages, if tools/test has not installed them


def m7(*arguments):
    return subprocess.run([M7, *arguments], capture_output=True, text=True, timeout=FIRST_BUILD_S,
                          check=False)


def steps_of(states, period_ms):
    """Checks and returns the steps of T, which are multiples of the period. A board that was never late (LATE) leaves
    no state out. On a busy machine the board leaves out each late period. Each late period may cost one more state,
    because a newer state replaces a state that waits to be sent."""
    steps = [(later['t'] - earlier['t']) % 2**32 for earlier, later in zip(states, states[1:])]
    assert all(step != 0 and step % period_ms == 0 for step in steps), steps
    missing = sum(steps) // period_ms - len(steps)
    late = states[-1]['fields']['LATE'] - states[0]['fields']['LATE']
    print(f'{len(states)} states, {missing} missing, {late} late; steps of T: {collections.Counter(steps)}')
    assert late <= missing <= 2 * late
    return steps


class M7Board:
    """A board on the emulated M7. With --pins the board reports its pins."""

    def __init__(self, *options):
        self.process = subprocess.Popen([M7, *options], stdout=subprocess.PIPE, text=True)
        self.serial = self.process.stdout.readline().strip()
        self.udp = self.process.stdout.readline().strip()
        self.events = queue.Queue()
        self.log = []  # all events taken from the queue
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.events.put(json.loads(line))

    def pins(self, is_it, timeout=PATIENCE_S):
        """Returns the next event for which `is_it` is true."""
        deadline = time.monotonic() + timeout
        while True:
            try:
                event = self.events.get(timeout=max(0, deadline - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f'the pins have not done that in {timeout} s: {self.log[-3:]}') from None
            self.log.append(event)
            if is_it(event):
                return event

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        assert self.process.wait(PATIENCE_S) == 0
        self.reader.join()
        self.process.stdout.close()


def fields_of(datagram):
    return dict(re.findall(r'(\w+):([^;]*);', datagram))


class Watcher:
    """A UDP socket from which the board has received, and to which the board sends its broadcasts."""

    def __init__(self, url):
        address, port = re.match(r'udp://(.+):(\d+)', url).groups()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect((address, int(port)))
        self.ask()

    def ask(self):
        self.socket.send(b'T:1;^0x1ef9abf^')  # valid, but without a command

    def next(self, is_it):
        while True:
            datagram = self.socket.recv(2048).decode()
            fields = fields_of(datagram)
            if is_it(fields):
                return fields

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()


class LineWatcher:
    """The host's end of the board's serial line, to which the board also sends its broadcasts."""

    def __init__(self, url):
        self.file = os.open(url[len('serial://'):], os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.file)
        self.pending = b''

    def next(self, is_it):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            line, end, rest = self.pending.partition(b'\r\n')
            if end:
                self.pending = rest
                fields = fields_of(line.decode())
                if is_it(fields):
                    return fields
            elif select.select([self.file], [], [], PATIENCE_S)[0]:
                self.pending += os.read(self.file, 4096)
        raise AssertionError(f'nothing of that kind in {PATIENCE_S} s: {self.pending}')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.file)


class Relay(threading.Thread):
    """Relays between a host and the board, and records the board's time when the board last received from the host."""

    def __init__(self, url):
        super().__init__(daemon=True)
        address, port = re.match(r'udp://(.+):(\d+)', url).groups()
        self.to_board = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.to_board.connect((address, int(port)))
        self.to_host = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.to_host.bind(('127.0.0.1', 0))
        self.url = 'udp://127.0.0.1:%d?listen=0' % self.to_host.getsockname()[1]
        self.heartbeat_t = self.safe = self.host = None
        self.went_safe = threading.Event()
        self.going = True

    def run(self):
        t = None
        while self.going:
            for each in select.select([self.to_board, self.to_host], [], [], 0.1)[0]:
                if each is self.to_host:
                    datagram, self.host = each.recvfrom(2048)
                    if datagram.startswith(b'H:'):
                        self.heartbeat_t = t
                    self.to_board.send(datagram)
                    continue
                datagram = each.recv(2048)
                fields = fields_of(datagram.decode())
                if int(fields['T']) != 0:
                    t = int(fields['T'])
                if fields.get('H') and fields.get('SAFE') == '1' and not self.safe:
                    self.safe = fields
                    self.went_safe.set()
                if self.host:
                    self.to_host.sendto(datagram, self.host)

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.going = False
        self.join()
        self.to_board.close()
        self.to_host.close()
