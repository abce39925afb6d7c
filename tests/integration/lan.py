# SPDX-License-Identifier: GPL-3.0-or-later
"""Computers on a network of their own: a network namespace each, with a TAP interface on one hub.

Nothing of it reaches the networks of this machine. It takes root, or a kernel that gives users namespaces
of their own, and /dev/net/tun.
"""
import contextlib
import ctypes
import fcntl
import os
import select
import socket
import struct
import subprocess
import sys
import threading

LIBC = ctypes.CDLL(None, use_errno=True)
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454ca, 0x0002, 0x1000
INTERFACE = 'r4lan'
FRAME = 2048


def _be_a_computer(address, handed_over):
    """In the namespace: makes the interface, gives it away, and stays until standard input ends."""
    tap = os.open('/dev/net/tun', os.O_RDWR | os.O_CLOEXEC)
    fcntl.ioctl(tap, TUNSETIFF, struct.pack('16sH22x', INTERFACE.encode(), IFF_TAP | IFF_NO_PI))
    for order in ('link set lo up', f'addr add {address}/24 dev {INTERFACE}', f'link set {INTERFACE} up'):
        subprocess.run(['ip', *order.split()], check=True)
    with socket.socket(fileno=handed_over) as to_lan:
        socket.send_fds(to_lan, [b'.'], [tap])
    sys.stdin.read()


class Computer:
    """One of them. `inside` is for what starts a process: run(…, **computer.inside)."""

    def __init__(self, address):
        ours, theirs = socket.socketpair()
        privileges = [] if os.geteuid() == 0 else ['--user', '--map-root-user']
        self._process = subprocess.Popen(
            ['unshare', *privileges, '--net', sys.executable, __file__, address, str(theirs.fileno())],
            stdin=subprocess.PIPE, stderr=subprocess.PIPE, pass_fds=[theirs.fileno()])
        theirs.close()
        with ours:
            _, descriptors, _, _ = socket.recv_fds(ours, 1, 1)
        if not descriptors:
            raise AssertionError('a network of our own cannot be made: ' +
                                 self._process.communicate()[1].decode())
        self.tap = descriptors[0]
        self.address = address
        names = (['user'] if privileges else []) + ['net']
        self._spaces = [os.open(f'/proc/{self._process.pid}/ns/{name}', os.O_RDONLY | os.O_CLOEXEC)
                        for name in names]
        self.inside = {'preexec_fn': self._enter}

    def _enter(self):
        for space in self._spaces:
            if LIBC.setns(space, 0) != 0:
                raise OSError(ctypes.get_errno(), 'setns')

    def move(self, address):
        """It has another address, as after a new lease of DHCP."""
        for order in (f'addr del {self.address}/24 dev {INTERFACE}', f'addr add {address}/24 dev {INTERFACE}'):
            subprocess.run(['ip', *order.split()], check=True, **self.inside)
        self.address = address

    def close(self):
        self._process.stdin.close()
        self._process.wait()
        self._process.stderr.close()
        for descriptor in (self.tap, *self._spaces):
            os.close(descriptor)


class Lan:
    """The hub: each frame goes to all other computers."""

    def __init__(self):
        self._computers = []
        self._waking, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def computer(self, address):
        computer = Computer(address)
        self._computers = [*self._computers, computer]
        os.write(self._wake, b'+')
        return computer

    def _carry(self):
        while True:
            taps = [each.tap for each in self._computers]
            ready, _, _ = select.select([self._waking, *taps], [], [])
            if self._waking in ready and os.read(self._waking, 1) != b'+':
                return
            for tap in set(ready) - {self._waking}:
                with contextlib.suppress(OSError):
                    frame = os.read(tap, FRAME)
                    for other in taps:
                        if other != tap:
                            os.write(other, frame)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.write(self._wake, b'-')
        self._thread.join()
        for computer in self._computers:
            computer.close()
        os.close(self._waking)
        os.close(self._wake)


if __name__ == '__main__':
    _be_a_computer(sys.argv[1], int(sys.argv[2]))
