# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated board, with the robot around it, for tests of what drives it."""
from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Literal, Mapping, NamedTuple, Type

from . import _core
from .errors import DataError, UsageError
from .values import Bldc, Drive

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

    from .testing import SimProcess


class Look(NamedTuple):
    """What the chips and the robot do, whatever the state says. Channel n is element n-1."""
    open: bool  # a link to the board is open; if not, this is what was last
    supply: bool  # the motors have a supply: relay 1 is closed, the handle held
    handle_held: bool
    is_safe: bool  # no output drives anything
    osmc: tuple[Drive, ...]
    dhb12: tuple[Drive, ...]
    servo_us: tuple[int, ...]
    relays: tuple[bool, ...]
    bldc: tuple[Bldc, ...]
    encoder: tuple[int, ...]  # counts since power came
    stepper: tuple[int, ...]  # steps that the motors took since then
    volts: tuple[float, ...]  # AIN24, AIN12, AIN5, AINDMH, AINSTEER, AIN6


class LinkedUrl(str):
    """A URL of a board behind a bad link."""
    link: str


def with_link(url: str, link: str) -> LinkedUrl:
    """A board behind a bad link, whatever transport it is on:

        r4link.Board(r4link.with_link('udp://192.168.0.125', 'loss=5%,delay=20ms±10,seed=7'))

    Raises UsageError for words that docs/simulation.md does not have.
    """
    _core.check_link(url, link)
    linked = LinkedUrl(url)
    linked.link = link
    return linked


class SimBoard:
    """A simulated board and what is around it.

    In this process, switched on afresh each time its URL is opened:

        sim = r4link.SimBoard()
        with r4link.Board(sim.url) as board:
            board.wait_active()
            sim.happen('handle released')       # a line of a scenario (docs/simulation.md), without its time
            sim.look().osmc[0].pwm

    Or, with a URL to listen on, in a process of its own until close(), for any program: 'udp://127.0.0.1:0' (a free
    port), 'pty:', 'can://vcan0?node=3'. That is the command r4, by the variable R4 or on PATH.

    `link` is what is wrong with the link: 'loss=5%,seed=7'. `settings` are those of a board with a URL, as of
    `r4 sim --set`: {'name': 'left', 'key': '1:<64 hexadecimal digits>'}.
    """

    def __init__(self, url: str | None = None, *, link: str = '', settings: Mapping[str, str] | None = None) -> None:
        self._robot: _core.SimulatedRobot | SimProcess
        if url is None:
            if settings:
                raise UsageError(f'settings={dict(settings)}', 'a board in this process has none',
                                 "give a URL to listen on, such as 'udp://127.0.0.1:0'")
            self._robot = _core.SimulatedRobot()
            self._url = with_link(self._robot.url, link) if link else self._robot.url
        else:
            from .testing import SimProcess
            options = [word for key, value in (settings or {}).items() for word in ('--set', f'{key},{value}')]
            self._robot = SimProcess(url, *options, *(('--link', link) if link else ()))
            self._url = self._robot.url

    @property
    def url(self) -> str:
        """What a host opens. In this process: for one link at a time, while this object lives."""
        return self._url

    def close(self) -> None:
        """Ends the process, where it has one. Idempotent."""
        if not isinstance(self._robot, _core.SimulatedRobot):
            self._robot.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def look(self) -> Look:
        """No older than 10 ms."""
        if isinstance(self._robot, _core.SimulatedRobot):
            return Look(**self._robot.look())
        return self._robot.look()

    def happen(self, words: str) -> None:
        """'us 1 15', 'handle released', 'chip dac off'. Raises DataError for words that say nothing of the kind."""
        if not isinstance(self._robot, _core.SimulatedRobot):
            try:
                _core.SimulatedRobot().happen(words)  # the process would tell later
            except DataError as error:
                raise DataError(words, error.reason, error.fix) from None
        self._robot.happen(words)

    # --- the same, with types

    def handle(self, held: bool) -> None:
        """The dead-man's handle."""
        self.happen(f'handle {"held" if held else "released"}')

    def obstacle(self, sensor: int, cm: int | None) -> None:
        """What an ultrasonic `sensor`, 1 to 4, measures: `cm` centimetres, 0: nothing, None: its cable is off."""
        self.happen(f'us {sensor} {"off" if cm is None else cm}')

    def turn(self, encoder: int, counts: int) -> None:
        """Somebody turns `encoder`, 1 to 4, to so many `counts`, 1000 a millisecond."""
        self.happen(f'enc {encoder} {counts}')

    def analog(self, name: str, volts: float) -> None:
        """An analog input, 'AIN24', stays at `volts`, to 0.01 V."""
        self.happen(f'analog {name.upper()} {volts:.2f}')

    def motor(self, osmc: int, stalled: bool) -> None:
        """The motor of `osmc`, 1 to 4, is held fast, or free."""
        self.happen(f'motor {osmc} {"stalled" if stalled else "free"}')

    def chip(self, name: Literal['osmc', 'dhb', 'servo', 'expander', 'dac'],
             supply: Literal['off', 'on', 'reset']) -> None:
        """It acknowledges nothing while it is off; reset: it loses its supply for a moment."""
        self.happen(f'chip {name} {supply}')

    def i2c(self, held: bool) -> None:
        """A chip holds the bus."""
        self.happen(f'i2c {"held" if held else "free"}')

    def hang(self, seconds: float) -> None:
        """The firmware's loop stands still for `seconds`, to 1 ms."""
        self.happen(f'hang {seconds:.3f}')

    def reboot(self) -> None:
        """Power off and on again."""
        self.happen('reboot')
