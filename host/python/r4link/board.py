# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Board: a board, opened by URL. Blocking calls with timeouts, and callbacks.

Times are seconds. A call that waits releases the GIL and obeys Ctrl-C. Callbacks run on their own
thread, one at a time. If a callback does not return within `callback_limit`, the heartbeats stop,
and the board goes safe.
"""
from __future__ import annotations

import atexit
import os
import weakref
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, Type

from . import _core
from ._core import BoardWiring, Identity, State
from .any_board import AnyBoard
from .channels import I2c, Uart, Uarts, _ms
from .enums import BoardRole
from .errors import UsageError
from .events import log_events
from .transport import Transport

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

_open: weakref.WeakSet[_core.Board] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """Sends the farewells before the interpreter ends."""
    for board in list(_open):
        board.close()


class States:
    """The states of a board from now on: `for state in board.states(): …`, until the board is
    closed. Keeps the board open. `most`: 1 or more states wait."""

    def __init__(self, board: Board, most: int | None, timeout: float, lossless: bool) -> None:
        if most is not None and most < 1:
            raise UsageError(f'states(most={most})', 'the queue needs room for a state', 'give 1 or more')
        self._board = board._core
        self._states = self._board.states(lossless, most or 0)
        self._timeout_ms = _ms(timeout)

    def __iter__(self) -> Iterator[State]:
        return self

    def __next__(self) -> State:
        """Raises RefusedError if no state arrives within the timeout. If lossless, raises DataError
        where states were lost; the next call returns the first state after the loss."""
        while (state := self._board.take(self._states, self._timeout_ms)) is None:
            if self._states.ended:
                raise StopIteration
            self._board.next_state(1)  # raises the error
        return state

    def take(self) -> State | None:
        """The next waiting state, or None."""
        return self._board.take(self._states, 0)

    @property
    def ended(self) -> bool:
        """True if the board was closed, and no state waits."""
        return self._states.ended

    @property
    def dropped(self) -> int:
        """The number of states that a newer state replaced or that found no room."""
        return self._states.missed


class Board(AnyBoard[None]):
    """A board, opened by URL (docs/reference/transports.md), or with_link(). See the options in
    include/r4link/options.hpp.

    Does not wait for the board: call wait_active(). `role` is BoardRole.CONTROL or
    BoardRole.WATCH. A watcher only reads states, and may stop the board, until take_control().
    `key` is the path of a key file (`~` is your home). Raises UsageError, OpenError, DeniedError.

        with r4link.Board('udp://192.168.0.125') as board:
            board.wait_active()
            board.arm()                 # closes relay 1, the motor supply
            board.osmc(1).set(0.1)      # the board's own state has confirmed it

    Several URLs are paths to one board (docs/how-to/redundancy.md): r4link.Board(['serial:auto',
    'udp://192.168.0.125']). Board also takes one or several Transports of your own, instead of URLs.

    `watch_rate_hz`: 1 to 1000 states a second for a watcher. `heartbeat`: seconds between
    heartbeats. `timeout`: seconds of silence after which the link is lost. `command_retry`,
    `stop_retry`: seconds between repetitions of a command or a stop. `stop_linger`: seconds for
    which a confirmed stop is repeated. `identify_interval`: seconds between questions for the
    board's identity; 0: never. `callback_limit`: seconds that a callback may take; 0: no limit.
    """

    def __init__(self, url: str | Transport | Iterable[str] | Iterable[Transport], *, role: BoardRole | str = BoardRole.CONTROL, arming: bool = True,
                 fields: str = 'DEFAULT', key: str | os.PathLike[str] | None = None, watch_rate_hz: int = 100,
                 heartbeat: float = 0.1, timeout: float = 1.0, command_retry: float = 0.05, stop_retry: float = 0.02,
                 stop_linger: float = 0.2, identify_interval: float = 1.0, callback_limit: float = 0.5) -> None:
        paths = [url] if isinstance(url, (str, Transport)) else list(url)
        own = [each for each in paths if isinstance(each, Transport)]
        urls = [each for each in paths if isinstance(each, str)]
        if len(own) != len(paths) and own:
            raise UsageError('URLs and transports for one board', 'a board has URLs or transports, not both',
                             'give URLs only, or transports only')
        link = next((bad for bad in (getattr(each, 'link', '') for each in urls) if bad), '')
        if link and (len(paths) > 1):
            raise UsageError(f'a bad link {link}', 'a bad link is possible only with one path',
                             'open the URL of the bad link alone')
        self._core = _core.Board(
            '+'.join(urls), transports=own, link=link, role=role, arming=arming, fields=fields,
            key=None if key is None else os.path.expanduser(os.fspath(key)),
            watch_rate_hz=watch_rate_hz, heartbeat=_ms(heartbeat), timeout=_ms(timeout),
            command_retry=_ms(command_retry), stop_retry=_ms(stop_retry), stop_linger=_ms(stop_linger),
            identify_interval=_ms(identify_interval), callback_limit=_ms(callback_limit))
        _open.add(self._core)
        log_events(self)

    @classmethod
    def first(cls, **options: Any) -> Self:
        """Opens the only board that r4link.discover() finds within 1.3 s. Raises OpenError without
        a board, and UsageError with the URLs if there are two boards or more."""
        return cls(_core.discover().only().url, **options)

    def _call(self, call: Callable[[_core.Board], Any],
              then: Callable[[Any], Any] = lambda result: result) -> Any:
        return then(call(self._core))

    def _callback(self, callback: Callable[..., object]) -> Callable[..., object]:
        return callback

    def close(self) -> None:
        """Sends the farewell and closes the transport: the board goes safe at once. Waiting calls
        in other threads raise ClosedError. Idempotent; a callback may call close()."""
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f'<r4link.Board {self.name}: {self.link.state}>'

    @property
    def i2c(self) -> I2c[None, bytes, list[int]]:
        """The devices on the user's I2C bus."""
        return I2c(self)

    @property
    def uart(self) -> Uarts[Uart]:
        """uart[1] and uart[2]."""
        return Uarts(lambda channel: Uart(self, channel))

    def identify(self, timeout: float = 1.0) -> Identity:
        """Requests the board's identity. `timeout`: seconds to wait for the answer."""
        return self._core.identify(_ms(timeout))

    def wiring(self, timeout: float = 1.0) -> BoardWiring:
        """The wiring that the board keeps. Needs the board's own cable. `timeout`: seconds to wait for the answer."""
        return self._core.wiring(_ms(timeout))

    def next_state(self, timeout: float = 1.0) -> State:
        """Waits up to `timeout` seconds for a state."""
        return self._core.next_state(_ms(timeout))

    def states(self, most: int | None = None, timeout: float = 1.0, *, lossless: bool = False) -> States:
        """The states from now on, for a loop that waits up to `timeout` seconds for each state. By
        default only the newest state waits. With `most`, up to that number of states (1 or more)
        wait, and newer states replace the oldest. With `lossless`, `most` states wait (default:
        65536, eleven minutes at 100 Hz), and a loss raises DataError at its place."""
        return States(self, most, timeout, lossless)
