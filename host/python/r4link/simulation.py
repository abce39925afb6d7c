# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated board and robot, for tests of programs that drive a robot."""
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
    """The chips and the robot, independent of the reported state. Channel n is element n-1."""
    open: bool  # a link to the board is open; if not, these are the last values
    supply: bool  # the motors have a supply: relay 1 is closed, the handle held
    handle_held: bool
    is_safe: bool  # no output drives anything
    osmc: tuple[Drive, ...]
    dhb12: tuple[Drive, ...]
    servo_us: tuple[int, ...]
    relays: tuple[bool, ...]
    bldc: tuple[Bldc, ...]
    encoder: tuple[int, ...]  # counts since power on
    stepper: tuple[int, ...]  # steps of the motors since power on
    volts: tuple[float, ...]  # AIN24, AIN12, AIN5, AINDMH, AINSTEER, AIN6


class LinkedUrl(str):
    """A URL of a board behind a bad link."""
    link: str


def with_link(url: str, link: str) -> LinkedUrl:
    """A board behind a bad link, on any transport:

        r4link.Board(r4link.with_link('udp://192.168.0.125', 'loss=5%,delay=20ms±10,seed=7'))

    Raises UsageError for words that are not in docs/how-to/simulation.md.
    """
    _core.check_link(url, link)
    linked = LinkedUrl(url)
    linked.link = link
    return linked


class SimBoard:
    """A simulated board and its surroundings.

    In this process, powered on each time its URL is opened:

        sim = r4link.SimBoard()
        with r4link.Board(sim.url) as board:
            board.wait_active()
            sim.happen('handle released')       # a line of a scenario (docs/how-to/simulation.md), without its time
            sim.look().osmc[0].pwm

    With a URL to listen on, in its own process until close(), for any program: 'udp://127.0.0.1:0'
    (a free port), 'pty:', 'can://vcan0?node=3'. This starts the command r4, from the variable R4 or
    PATH.

    `link`: faults of the link, 'loss=5%,seed=7'. `settings`: for a board with a URL, as in `r4 sim
    --set`: {'name': 'left', 'key': '1:<64 hexadecimal digits>'}.
    """

    def __init__(self, url: str | None = None, *, link: str = '', settings: Mapping[str, str] | None = None) -> None:
        self._robot: _core.SimulatedRobot | SimProcess
        if url is None:
            if settings:
                raise UsageError(f'settings={dict(settings)}', 'a board in this process has no settings',
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
        """The URL for a host. In this process: for one link at a time, while this object exists."""
        return self._url

    def close(self) -> None:
        """Ends the process, if there is one. Idempotent."""
        if not isinstance(self._robot, _core.SimulatedRobot):
            self._robot.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def look(self) -> Look:
        """The present Look, at most 10 ms old."""
        if isinstance(self._robot, _core.SimulatedRobot):
            return Look(**self._robot.look())
        return self._robot.look()

    def happen(self, words: str) -> None:
        """Simulates an event: 'us 1 15', 'handle released', 'chip dac off'. Raises DataError for
        unknown words."""
        if not isinstance(self._robot, _core.SimulatedRobot):
            try:
                _core.SimulatedRobot().happen(words)  # the process would report wrong words later
            except DataError as error:
                raise DataError(words, error.reason, error.fix) from None
        self._robot.happen(words)

    # --- happen() with typed arguments

    def handle(self, held: bool) -> None:
        """Holds or releases the dead-man's handle."""
        self.happen(f'handle {"held" if held else "released"}')

    def obstacle(self, sensor: int, cm: int | None) -> None:
        """Sets ultrasonic `sensor`, 1 to 4, to `cm` centimetres; 0: no obstacle; None: cable off."""
        self.happen(f'us {sensor} {"off" if cm is None else cm}')

    def turn(self, encoder: int, counts: int) -> None:
        """Turns `encoder`, 1 to 4, to the position `counts`, at 1000 counts a millisecond."""
        self.happen(f'enc {encoder} {counts}')

    def analog(self, name: str, volts: float) -> None:
        """Keeps an analog input, 'AIN24', at `volts`, to 0.01 V."""
        self.happen(f'analog {name.upper()} {volts:.2f}')

    def motor(self, osmc: int, stalled: bool) -> None:
        """Holds the motor of `osmc`, 1 to 4, or releases it."""
        self.happen(f'motor {osmc} {"stalled" if stalled else "free"}')

    def chip(self, name: Literal['osmc', 'dhb', 'servo', 'expander', 'dac'],
             supply: Literal['off', 'on', 'reset']) -> None:
        """A chip that is off acknowledges nothing. `reset`: the chip loses its supply for a moment."""
        self.happen(f'chip {name} {supply}')

    def i2c(self, held: bool) -> None:
        """Makes a chip hold the bus, or releases it."""
        self.happen(f'i2c {"held" if held else "free"}')

    def hang(self, seconds: float) -> None:
        """Stops the firmware's loop for `seconds`, to 1 ms."""
        self.happen(f'hang {seconds:.3f}')

    def reboot(self) -> None:
        """Switches the power off and on."""
        self.happen('reboot')
