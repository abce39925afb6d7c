# SPDX-License-Identifier: GPL-3.0-or-later
"""slcan_bus (tests/transports/can/kernel/slcan_bus.cpp) with its nodes as interfaces slcan0 and slcan1 of this kernel."""
import fcntl
import json
import os
import pathlib
import queue
import struct
import subprocess
import termios
import threading
import time

from r4_process import PATIENCE_S, R4

PROGRAM = os.environ.get('R4_SLCAN_BUS') or pathlib.Path(R4).parent / 'tests/slcan_bus'
N_SLCAN = 17
SIOCGIFNAME = 0x8910
BITRATE = 500000


def ip(*arguments):
    subprocess.run(['ip', *arguments], check=True)


class SlcanBus:
    """One bus. `interfaces` are the nodes in order."""

    def __init__(self, txqueuelen=1000):
        self.process = subprocess.Popen([PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.answers = queue.Queue()
        self.states = queue.Queue()
        self.ptys = json.loads(self.process.stdout.readline())['ptys']
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        self.interfaces = [f'slcan{number}' for number in range(len(self.ptys))]
        for interface, pty in zip(self.interfaces, self.ptys):
            ip('link', 'set', self.attach(pty), 'name', interface)
            ip('link', 'set', interface, 'txqueuelen', str(txqueuelen), 'type', 'can', 'bitrate', str(BITRATE))
            ip('link', 'set', interface, 'up')

    @staticmethod
    def attach(pty):
        tty = os.open(pty, os.O_RDWR | os.O_NOCTTY)
        try:
            fcntl.ioctl(tty, termios.TIOCSETD, struct.pack('i', N_SLCAN))
            name = bytearray(16)
            fcntl.ioctl(tty, SIOCGIFNAME, name)
            return name.partition(b'\0')[0].decode()
        finally:
            os.close(tty)  # slcan_bus keeps the terminal open

    def _read(self):
        for line in self.process.stdout:
            each = json.loads(line)
            each['came'] = time.monotonic()
            (self.states if each['type'] == 'state' else self.answers).put(each)

    def order(self, *words):
        self.process.stdin.write(' '.join(map(str, words)) + '\n')
        self.process.stdin.flush()
        answer = self.answers.get(timeout=PATIENCE_S)
        assert answer['type'] != 'error', answer
        return answer

    def status(self):
        return self.order('status')

    def state(self, node, state, timeout=PATIENCE_S):
        """Waits until the node changes to `state`."""
        deadline = time.monotonic() + timeout
        while True:
            each = self.states.get(timeout=max(0, deadline - time.monotonic()))
            if each['node'] == node and each['state'] == state:
                return each

    def reset(self, node):
        """Restarts an slcan controller that is bus-off, in the only way that Linux offers."""
        ip('link', 'set', self.interfaces[node], 'down')
        ip('link', 'set', self.interfaces[node], 'up')

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for interface in self.interfaces:  # before slcan_bus ends, because slcan_bus has to answer the kernel
            subprocess.run(['ip', 'link', 'set', interface, 'down'], check=False)
        self.process.stdin.close()
        self.process.wait(PATIENCE_S)
        self.reader.join()
        self.process.stdout.close()
