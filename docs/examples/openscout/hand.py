# SPDX-License-Identifier: GPL-3.0-or-later
"""Manual driving by the keyboard, or by a gamepad through the kernel's evdev (/dev/input/event*)."""
import contextlib
import fcntl
import os
import select
import struct
import sys
import termios
import time
import tty
from typing import Protocol

from r4link import control
from scout import ARM_REST, Wish

SPEED = 0.5  # m/s
TURN = 1.5  # rad/s
ARM_STEP = 20  # microseconds per key press
HOLD = 0.7  # s; the terminal repeats a held key, the first time after 0.5 s


class Hand(Protocol):
    ended: bool  # the person ended the drive, or the device is disconnected
    stop: bool  # the person requests an emergency stop

    def begin(self) -> None: ...  # the board is armed; earlier input is ignored, except a stop

    def wish(self) -> Wish: ...


class Keyboard:
    """w s a d drive, while a key is held; u j, i k, o l move the arm; space stops; q ends."""
    KEYS = {'w': control.Twist(SPEED), 's': control.Twist(-SPEED), 'a': control.Twist(0, TURN),
            'd': control.Twist(0, -TURN)}
    ARM = {'u': (0, 1), 'j': (0, -1), 'i': (1, 1), 'k': (1, -1), 'o': (2, 1), 'l': (2, -1)}

    def __init__(self) -> None:
        self.ended = self.stop = False
        self._arm = list(ARM_REST)
        self._twist = control.Twist(0)
        self._until = 0.0
        self._before = termios.tcgetattr(sys.stdin) if sys.stdin.isatty() else None
        if self._before:
            tty.setcbreak(sys.stdin)

    def close(self) -> None:
        if self._before:
            with contextlib.suppress(termios.error):  # the terminal is closed
                termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def begin(self) -> None:
        self.wish()
        self._until = 0.0

    def wish(self) -> Wish:
        while not self.ended and select.select([sys.stdin], [], [], 0)[0]:
            key = os.read(sys.stdin.fileno(), 1).decode(errors='replace')
            self.ended = self.ended or key in ('', 'q')
            self.stop = self.stop or key == ' '
            if key in self.ARM:
                joint, way = self.ARM[key]
                self._arm[joint] = max(600, min(2400, self._arm[joint] + way * ARM_STEP))
            else:
                self._twist, self._until = self.KEYS.get(key, control.Twist(0)), time.monotonic() + HOLD
        twist = self._twist if time.monotonic() < self._until else control.Twist(0)
        return Wish(twist, (self._arm[0], self._arm[1], self._arm[2]))


class Gamepad:
    """The left stick drives while the right shoulder button is held; the right stick and the triggers' cross move the
    arm; the lower button (A) stops, Start ends.

    If the kernel's buffer overflows, the kernel sends SYN_DROPPED, and the events until the next SYN_REPORT are
    incomplete (Documentation/input/event-codes.rst). The position of the shoulder button is then unknown: the button
    counts as released until it is pressed again, and each axis as centred until it moves."""
    EVENT = struct.Struct('llHHi')  # input_event of the kernel
    EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
    SYN_REPORT, SYN_DROPPED = 0, 3
    ABS_X, ABS_Y, ABS_RX, ABS_RY, ABS_HAT0Y = 0, 1, 3, 4, 17
    SHOULDER, LOWER, START = 0x137, 0x130, 0x13B

    def __init__(self, path: str) -> None:
        self.ended = self.stop = False
        self._arm = [float(each) for each in ARM_REST]
        self._axes: dict[int, float] = {}
        self._held = False
        self._dropped = False  # True from SYN_DROPPED until the next SYN_REPORT
        self._last = time.monotonic()
        self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        self._ranges = {axis: self._range(axis) for axis in (self.ABS_X, self.ABS_Y, self.ABS_RX, self.ABS_RY,
                                                             self.ABS_HAT0Y)}

    def close(self) -> None:
        os.close(self._file)

    def begin(self) -> None:
        self.wish()
        self._held = False

    def _range(self, axis: int) -> tuple[int, int]:
        try:
            told = fcntl.ioctl(self._file, 0x80184540 + axis, bytes(24))  # EVIOCGABS
        except OSError:
            return (-1, 1) if axis == self.ABS_HAT0Y else (-32768, 32767)
        _, low, high, *_ = struct.unpack('6i', told)
        return low, max(high, low + 1)

    def _take(self, kind: int, code: int, value: int) -> None:
        if kind == self.EV_SYN and code == self.SYN_DROPPED:
            self._dropped, self._held = True, False
            self._axes.clear()
        elif self._dropped:
            self._dropped = not (kind == self.EV_SYN and code == self.SYN_REPORT)
        elif kind == self.EV_ABS and code in self._ranges:
            low, high = self._ranges[code]
            share = max(-1.0, min(1.0, 2 * (value - low) / (high - low) - 1))
            self._axes[code] = share if abs(share) > 0.1 else 0.0  # the rest position of a stick is never exactly 0
        elif kind == self.EV_KEY:
            if code == self.SHOULDER and value != 2:  # 2: a repeat
                self._held = value == 1
            self.stop = self.stop or (code == self.LOWER and value == 1)
            self.ended = self.ended or (code == self.START and value == 1)

    def wish(self) -> Wish:
        try:
            while len(event := os.read(self._file, self.EVENT.size)) == self.EVENT.size:
                self._take(*self.EVENT.unpack(event)[2:])
            self.ended = True  # end of the file
        except BlockingIOError:
            pass
        except OSError:  # unplugged
            self.ended = True
        now = time.monotonic()
        passed, self._last = min(0.1, now - self._last), now
        for joint, axis in enumerate((self.ABS_RX, self.ABS_RY, self.ABS_HAT0Y)):
            self._arm[joint] = max(600, min(2400, self._arm[joint] + 600 * passed * self._axes.get(axis, 0)))
        drives = self._held and not self.ended
        twist = control.Twist(-SPEED * self._axes.get(self.ABS_Y, 0), -TURN * self._axes.get(self.ABS_X, 0))
        return Wish(twist if drives else control.Twist(0), (round(self._arm[0]), round(self._arm[1]), round(self._arm[2])))
