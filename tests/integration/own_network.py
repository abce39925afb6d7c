# SPDX-License-Identifier: GPL-3.0-or-later
"""Gives each test file its own loopback network, so that files that run at the same time do not share UDP ports."""
import ctypes
import fcntl
import os
import pathlib
import socket
import struct

CLONE_NEWNET, SIOCSIFFLAGS, IFF_UP = 0x40000000, 0x8914, 0x1
LOCK = pathlib.Path(__file__).resolve().parents[2] / 'build/network.lock'
held = []


def enter():
    """Called once, before any test. Only root may make a network, so for other users the files run one after the other.

    In the guest of tools/with-can this does nothing, because a new network would not have the guest's CAN interfaces.
    """
    if 'R4_CAN_GUEST' in os.environ:
        return
    if ctypes.CDLL(None).unshare(CLONE_NEWNET) != 0:
        LOCK.parent.mkdir(exist_ok=True)
        held.append(open(LOCK, 'w', encoding='ascii'))
        fcntl.flock(held[0], fcntl.LOCK_EX)
        return
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack('16sH22x', b'lo', IFF_UP))
