# SPDX-License-Identifier: GPL-3.0-or-later
"""Computers on a separate network: each is a network namespace, with TAP interfaces on one hub.

No frame reaches the networks of this machine. The network needs /dev/net/tun, and root or a kernel that lets users
make namespaces.
"""
import contextlib
import ctypes
import fcntl
import os
import pathlib
import select
import socket
import struct
import subprocess
import sys
import threading
import time

LIBC = ctypes.CDLL(None, use_errno=True)
TUNSETIFF, TUNSETCARRIER, IFF_TAP, IFF_NO_PI = 0x400454ca, 0x400454e2, 0x0002, 0x1000
RTMGRP_LINK = 1
INTERFACE = 'r4lan'
PATIENCE_S = 10
FRAME = 2048


def interface(number):
    return f'{INTERFACE}{number or ""}'


def _be_a_computer(handed_over, *addresses):
    """Runs in the namespace: makes the interfaces, passes their descriptors on, and waits until standard input ends."""
    taps = []
    subprocess.run(['ip', 'link', 'set', 'lo', 'up'], check=True)
    # Each interface answers only for its own address, even if several interfaces are on one network.
    for name, value in ('arp_ignore', '1'), ('arp_announce', '2'):
        pathlib.Path(f'/proc/sys/net/ipv4/conf/all/{name}').write_text(value)
    for number, address in enumerate(addresses):
        taps.append(os.open('/dev/net/tun', os.O_RDWR | os.O_CLOEXEC))
        fcntl.ioctl(taps[-1], TUNSETIFF, struct.pack('16sH22x', interface(number).encode(), IFF_TAP | IFF_NO_PI))
        for order in f'addr add {address}/24 dev {interface(number)}', f'link set {interface(number)} up':
            subprocess.run(['ip', *order.split()], check=True)
    reports = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
    reports.bind((0, RTMGRP_LINK))
    with socket.socket(fileno=handed_over) as to_lan:
        socket.send_fds(to_lan, [b'.'], [*taps, reports.fileno()])
    sys.stdin.read()


class Computer:
    """A computer on the network. `inside`: arguments that start a process there, as in run(…, **computer.inside)."""

    def __init__(self, *addresses):
        ours, theirs = socket.socketpair()
        privileges = [] if os.geteuid() == 0 else ['--user', '--map-root-user']
        self._process = subprocess.Popen(
            ['unshare', *privileges, '--net', sys.executable, __file__, str(theirs.fileno()), *addresses],
            stdin=subprocess.PIPE, stderr=subprocess.PIPE, pass_fds=[theirs.fileno()])
        theirs.close()
        with ours:
            _, self.taps, _, _ = socket.recv_fds(ours, 1, len(addresses) + 1)
        if not self.taps:
            raise AssertionError('a network of our own cannot be made: ' +
                                 self._process.communicate()[1].decode())
        self._reports = socket.socket(fileno=self.taps.pop())
        self.addresses = list(addresses)
        names = (['user'] if privileges else []) + ['net']
        self._spaces = [os.open(f'/proc/{self._process.pid}/ns/{name}', os.O_RDONLY | os.O_CLOEXEC)
                        for name in names]
        self.inside = {'preexec_fn': self._enter}

    def _enter(self):
        for space in self._spaces:
            if LIBC.setns(space, 0) != 0:
                raise OSError(ctypes.get_errno(), 'setns')

    def move(self, address):
        """Changes the address, as a new DHCP lease does."""
        for order in (f'addr del {self.addresses[0]}/24 dev {INTERFACE}', f'addr add {address}/24 dev {INTERFACE}'):
            subprocess.run(['ip', *order.split()], check=True, **self.inside)
        self.addresses[0] = address

    def switch(self, number, state):
        """Sets the interface 'up' or 'down', and returns the time of the kernel's report."""
        return self._reported(number, lambda: subprocess.run(['ip', 'link', 'set', interface(number), state], check=True,
                                                             **self.inside))

    def plug(self, number, there):
        """Pulls or plugs in the cable, and returns the time of the kernel's report (at most one report a second)."""
        return self._reported(number, lambda: fcntl.ioctl(self.taps[number], TUNSETCARRIER, struct.pack('i', there)))

    def _reported(self, number, change):
        self._reports.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while self._reports.recv(65536):
                pass
        change()
        self._reports.settimeout(PATIENCE_S)
        while f'\0{interface(number)}\0'.encode() not in self._reports.recv(65536):
            pass
        return time.monotonic()

    def close(self):
        self._process.stdin.close()
        self._process.wait()
        self._process.stderr.close()
        self._reports.close()
        for descriptor in (*self.taps, *self._spaces):
            os.close(descriptor)


class Lan:
    """The hub: each frame goes to all other computers."""

    def __init__(self):
        self._computers = []
        self._waking, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._carry)
        self._thread.start()

    def computer(self, *addresses):
        computer = Computer(*addresses)
        self._computers = [*self._computers, computer]
        os.write(self._wake, b'+')
        return computer

    def _carry(self):
        while True:
            taps = [tap for each in self._computers for tap in each.taps]
            ready, _, _ = select.select([self._waking, *taps], [], [])
            if self._waking in ready and os.read(self._waking, 1) != b'+':
                return
            for tap in set(ready) - {self._waking}:
                with contextlib.suppress(OSError):
                    frame = os.read(tap, FRAME)
                    for other in taps:
                        if other != tap:
                            with contextlib.suppress(OSError):  # the interface is down
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
    _be_a_computer(int(sys.argv[1]), *sys.argv[2:])
