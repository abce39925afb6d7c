# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a command on this kernel if it has CAN: makes vcan0 and a vxcan pair if they are missing.

The last program that uses the interfaces removes the interfaces that were made.
"""
import fcntl
import os
import shutil
import signal
import subprocess
import time

from trouble import Trouble

KILL_AFTER_S = 2  # after the time limit's SIGTERM
TIME_LIMIT_EXIT = 124  # as timeout(1)
INTERFACES = {'vcan0': 'link add dev vcan0 type vcan',
              'vxcan0': 'link add dev vxcan0 type vxcan peer name vxcan1'}
UP = 'mtu 72 txqueuelen 1000 up'
SI_KERNEL = 0x80  # origin of a signal from a terminal, which the command also gets
PASSED_ON = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1,
             signal.SIGUSR2}


def ip(order):
    """True if ip succeeded."""
    return subprocess.run(['ip', *order.split()], stdin=subprocess.DEVNULL, check=False,
                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0


def is_there(interface):
    return os.path.exists(f'/sys/class/net/{interface}')


def is_up(interface):
    try:
        with open(f'/sys/class/net/{interface}/flags', encoding='ascii') as flags:
            return bool(int(flags.read(), 16) & 1)
    except OSError:
        return False


class Interfaces:
    """Provides vcan0 and the pair while this object exists. Leaves existing interfaces as they are."""

    def __init__(self):
        # A network namespace has its own interfaces, so it has its own locks.
        name = f'/run/lock/r4-with-can.{os.stat("/proc/self/ns/net").st_ino}'
        self._changing = self._users = None
        if os.geteuid() != 0 or shutil.which('ip') is None:
            return
        self._changing = os.open(name + '.changing', os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self._users = os.open(name + '.users', os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_APPEND,
                              0o600)
        fcntl.flock(self._changing, fcntl.LOCK_EX)
        for interface, order in INTERFACES.items():
            if not is_there(interface) and ip(order):
                os.write(self._users, interface.encode() + b'\n')
                for each in ('vxcan0', 'vxcan1') if interface == 'vxcan0' else (interface,):
                    ip(f'link set {each} {UP}')
        fcntl.flock(self._users, fcntl.LOCK_SH)
        fcntl.flock(self._changing, fcntl.LOCK_UN)

    def usable(self):
        return is_up('vcan0')

    def close(self):
        if self._users is None:
            return
        fcntl.flock(self._changing, fcntl.LOCK_EX)
        try:
            fcntl.flock(self._users, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return  # another program uses the interfaces
        for interface in os.pread(self._users, 4096, 0).decode().split():
            ip(f'link del {interface}')
        os.ftruncate(self._users, 0)
        os.close(self._users)
        os.close(self._changing)


def run(command, limit):
    """Runs the command; returns its exit status, or None if it cannot have CAN on this kernel."""
    interfaces = Interfaces()
    try:
        return status_of(command, limit) if interfaces.usable() else None
    finally:
        interfaces.close()


def status_of(command, limit):
    # Signals are handled one by one below; the command gets the original signal mask.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, PASSED_ON | {signal.SIGCHLD})
    try:
        child = subprocess.Popen(
            command, preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, mask))
    except OSError as error:
        raise Trouble(command[0], error.strerror, 'give a program to run', 126) from error
    deadline = None if limit is None else time.monotonic() + limit
    passed = False
    while child.poll() is None:
        if deadline is None:
            info = signal.sigwaitinfo(PASSED_ON | {signal.SIGCHLD})
        else:
            info = signal.sigtimedwait(PASSED_ON | {signal.SIGCHLD},
                                       max(0, deadline - time.monotonic()))
        if info is None:
            child.send_signal(signal.SIGKILL if passed else signal.SIGTERM)
            deadline = None if passed else time.monotonic() + KILL_AFTER_S
            passed = True
        elif info.si_signo != signal.SIGCHLD and info.si_code != SI_KERNEL:
            child.send_signal(info.si_signo)
    if passed:
        return TIME_LIMIT_EXIT
    return child.returncode if child.returncode >= 0 else 128 - child.returncode
