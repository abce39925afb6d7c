# SPDX-License-Identifier: GPL-3.0-or-later
"""For tests of a robot's program (docs/how-to/testing.md): simulated robots and expectations."""
from __future__ import annotations

import collections
import contextlib
import json
import math
import os
import pathlib
import shutil
import subprocess
import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Type

from . import _core
from ._core import FIELDS, State
from .board import Board
from .enums import LinkState, SafeReason
from .errors import ClosedError, DataError, Error, OpenError, UsageError
from .simulation import Look, SimBoard
from .values import Bldc, Drive

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

TRANSPORTS = ('sim', 'udp', 'pty', 'can')


def make_state(t_ms: int, **fields: Any) -> State:
    """A state that no board has sent, for tests without a board. `t_ms`: the board's clock and, in
    ms, when it was sampled and received: make_state(10, enc1=5, ainsteer=2.5, osmc1=(400, 1))."""
    return _core.make_state(t_ms, t_ms / 1000, fields)


class Robot(Protocol):
    """A simulated board with its motors, sensors and chips."""

    @property
    def url(self) -> str:
        """The URL for a host."""

    def happen(self, words: str) -> None:
        """A line of a scenario (docs/how-to/simulation.md), without its time."""

    def look(self) -> Look:
        """The present pins and sensors."""


class SimProcess:
    """A simulated board in its own process, `r4 sim`: from the variable R4, or on PATH.

    The argument `url` is where the board listens: 'udp://127.0.0.1:0', 'pty:PATH', 'can://vcan0?node=3'.
    The attribute `url` is the URL for a host. Raises OpenError if the board does not listen.
    """

    def __init__(self, url: str, *options: str) -> None:
        command = os.environ.get('R4') or shutil.which('r4')
        if not command:
            raise UsageError('the command r4', 'the command is not on PATH', 'set R4=FILE, such as build/r4')
        self._process = subprocess.Popen(  # pylint: disable=consider-using-with
            [command, 'sim', url, '--json', '--stdin', '--sensors', '0.01', *options], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1)
        assert self._process.stdin and self._process.stdout and self._process.stderr
        self._parent = os.getpid()
        self._lock = threading.Lock()
        self._outputs: dict[str, Any] = {}
        self._sensors: dict[str, Any] = {}
        self.errors: collections.deque[str] = collections.deque(maxlen=100)
        self._reader = threading.Thread(target=self._read, daemon=True)
        first = self._process.stdout.readline()
        told: dict[str, Any] = json.loads(first) if first else {}
        if told.get('type') != 'listening':
            self.close()
            raise OpenError(url, str(told.get('reason', 'r4 sim ended')), str(told.get('fix', 'see r4 sim --help')))
        self._url: str = told['host_url']
        if self._url.startswith('udp:'):
            self._url += '?listen=0'  # parallel tests cannot share the paper's host port
        self._reader.start()

    @property
    def url(self) -> str:
        """The URL for a host."""
        return self._url

    def happen(self, words: str) -> None:
        """A line of a scenario (docs/how-to/simulation.md), without its time. Raises DataError if `r4 sim` has ended."""
        assert self._process.stdin
        self._require_own()
        try:
            self._process.stdin.write(words + '\n')
        except (OSError, ValueError) as error:  # ValueError: after close()
            raise DataError('r4 sim', 'the process has ended', f'exit code {self._process.poll()}') from error

    def look(self) -> Look:
        """The last values of the pins, and sensor values that are at most 10 ms old."""
        self._require_own()
        deadline = time.monotonic() + 5
        while not self._outputs or not self._sensors:  # waits for the first line of each kind
            if time.monotonic() > deadline:
                raise OpenError('r4 sim', 'the process prints nothing', 'check whether the process is stopped')
            time.sleep(0.002)
        with self._lock:
            pins, senses = dict(self._outputs), dict(self._sensors)
        osmc, dhb12 = (tuple(Drive(*each) for each in pins[kind]) for kind in ('osmc', 'dhb'))
        bldc = tuple(Bldc(speed, direction, bool(brake)) for speed, direction, brake in pins['bldc'])
        relays = tuple(bool(pins['relays'] >> i & 1) for i in range(8))
        driven = any(each.pwm for each in osmc + dhb12) or any(pins['servo']) or any(relays) or any(
            each.speed or not each.brake for each in bldc) or any(each[1] for each in pins['stepper'])
        return Look(open=self._process.poll() is None, supply=senses['supply'], handle_held=senses['handle'] == 'held',
                    is_safe=not driven, osmc=osmc, dhb12=dhb12, servo_us=tuple(pins['servo']), relays=relays, bldc=bldc,
                    encoder=tuple(senses['enc']), stepper=tuple(senses['stepper']),
                    volts=tuple(senses['analog'].values()))

    def close(self) -> None:
        """Ends the process. Idempotent. No effect in a fork, because the process belongs to the parent."""
        if os.getpid() != self._parent:
            return
        self._process.kill()
        self._process.wait()
        if self._reader.is_alive():
            self._reader.join()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            with contextlib.suppress(OSError):  # data for an ended process is dropped
                if pipe:
                    pipe.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def _require_own(self) -> None:
        if os.getpid() != self._parent:
            raise ClosedError('r4 sim',
                              f'the process {self._parent} started it, and this process is a fork of that process',
                              'start r4 sim in this process, after the fork')

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            told = json.loads(line)
            with self._lock:
                if told['type'] == 'sensors':
                    self._sensors = told
                elif 'outputs' in told:
                    self._outputs = told['outputs']
                elif told['type'] == 'error':
                    self.errors.append(line)


def make_robot(transport: str, folder: pathlib.Path, *, interface: str = 'vcan0', node: int = 1,
               link: str = '') -> Robot:
    """A simulated robot: 'sim' in this process, else a process on UDP, a pty in `folder` or a CAN
    bus. `link`: as in r4 sim --link. `node`: 0 to 31, its number on the bus."""
    if link and transport == 'sim':
        raise UsageError(f'link {link!r}', "transport 'sim' has no link", "use 'udp', 'pty' or 'can'")
    if transport == 'sim':
        return SimBoard()
    if transport not in TRANSPORTS:
        raise UsageError(f'transport {transport!r}', 'the transport does not exist', f'use one of {", ".join(TRANSPORTS)}')
    where = {'udp': 'udp://127.0.0.1:0', 'pty': f'pty:{folder}/r4-{node}', 'can': f'can://{interface}?node={node}'}
    return SimProcess(where[transport], *(('--link', link) if link else ()))


class TestBoard(Board):
    """A board with expectations. `robot` is the simulated robot around it."""

    __test__ = False  # not a test class
    robot: Robot

    def expect(self, within: float = 0.5, **fields: Any) -> None:
        """Waits for a state with these values: `board.expect(osmc1=358, enc1=lambda n: n > 10)`.

        A number is the pwm of a drive or the speed of a BLDC motor; volts have a tolerance of 0.02.
        Raises AssertionError with the received values.
        """
        for name in fields:
            if name not in FIELDS:
                raise UsageError(f'expect({name}=…)', 'this is not a state field', 'see r4link.FIELDS')
        begin = time.monotonic()
        count = 0
        state = self.state
        while True:
            if state and all(_is(getattr(state, name), wanted) for name, wanted in fields.items()):
                return
            left = begin + within - time.monotonic()
            if left <= 0:
                break
            try:
                state = self.next_state(left)
                count += 1
            except Error as error:
                if self.link.state not in (LinkState.ACTIVE, LinkState.SAFE):
                    raise AssertionError(f'a state did not arrive within {within} s: {error}') from None
        wrong = [f'{name} is {getattr(state, name)!r}, not {_words(wanted)}' for name, wanted in fields.items()
                 if not _is(getattr(state, name), wanted)]
        raise AssertionError(f'after {within} s and {count} states: {"; ".join(wrong)} '
                             f'(link {self.link.state}, reason {self.link.reason}; {state!r})')

    def expect_safe(self, reason: SafeReason | str | None = None, within: float = 1.1) -> None:
        """Waits until the board is safe, for that reason, with no pin of its chips driven."""
        reason = None if reason is None else SafeReason(reason)
        deadline = time.monotonic() + within
        while True:
            link, look = self.link, self.robot.look()
            if link.state is LinkState.SAFE and reason in (None, link.reason) and look.is_safe:
                return
            if time.monotonic() >= deadline:
                raise AssertionError(f'after {within} s the board is not safe{f" ({reason})" if reason else ""}: the '
                                     f'link is {link.state}, its reason {link.reason}, the pins are {look!r}')
            time.sleep(0.002)


def _is(value: Any, wanted: Any) -> bool:
    if callable(wanted):
        return bool(wanted(value))
    if isinstance(value, (Drive, Bldc)) and isinstance(wanted, int):
        return bool(value[0] == wanted)
    if isinstance(value, float):
        return math.isclose(value, wanted, abs_tol=0.02)
    return bool(value == wanted)


def _words(wanted: Any) -> str:
    return 'as it should be' if callable(wanted) else repr(wanted)
