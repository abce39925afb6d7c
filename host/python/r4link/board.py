# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Board: a board, opened by URL. Blocking calls with timeouts, and callbacks.

Times are seconds. A call that waits releases the GIL and obeys Ctrl-C. Callbacks run on a thread of their own, one
at a time; one that does not return within `callback_limit` stops the heartbeats, so that the board goes safe.
"""
from __future__ import annotations

import atexit
import os
import weakref
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, Iterable, Iterator, Type, TypeVar

from . import _core
from ._core import (CarrierCounters, Command, Event, Identity, LinkStatus, Recording, RefusedPost, Setpoints, State,
                    Statistics, Subscription, PathStatus)
from .channels import BoardCommands, I2c, Uart, Uarts, _ms
from .devices import Device
from .enums import BoardRole, DisarmCause, PostResult
from .errors import UsageError

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

F = TypeVar('F', bound=Callable[..., Any])
_open: weakref.WeakSet[_core.Board] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """Farewells are said while the interpreter is whole."""
    for board in list(_open):
        board.close()


class States:
    """The states of a board from now on: `for state in board.states(): …`, until the board is closed. Keeps it open.
    """

    def __init__(self, board: Board, most: int | None, timeout: float, lossless: bool) -> None:
        if most is not None and most < 1:
            raise UsageError(f'states(most={most})', 'at least one has to wait', 'give 1 or more')
        self._board = board._core
        self._states = self._board.states(lossless, most or 0)
        self._timeout_ms = _ms(timeout)

    def __iter__(self) -> Iterator[State]:
        return self

    def __next__(self) -> State:
        """Raises RefusedError when none comes within the timeout, DataError where one was lost of which none should
        be; the next call goes on behind it."""
        while (state := self._board.take(self._states, self._timeout_ms)) is None:
            if self._states.ended:
                raise StopIteration
            self._board.next_state(1)  # says why there is none
        return state

    def take(self) -> State | None:
        """The next one if it is there already."""
        return self._board.take(self._states, 0)

    @property
    def ended(self) -> bool:
        """The board was closed, and none waits."""
        return self._states.ended

    @property
    def dropped(self) -> int:
        """Those that gave way or found no room."""
        return self._states.missed


class Board(BoardCommands[None]):
    """A board, opened by URL (docs/transports.md), or with_link(); see the options of include/r4link/options.hpp.

    Returns without waiting for the board: wait_active(). `role` is BoardRole.CONTROL, or BoardRole.WATCH for a program
    that only looks, and may stop the board, until take_control(). `key` is the path of a key file (`~` is yours). Raises
    UsageError, OpenError, DeniedError.

        with r4link.Board('udp://192.168.0.125') as board:
            board.wait_active()
            board.arm()                 # closes relay 1, the motor supply
            board.osmc(1).set(0.1)      # the board's own state has confirmed it

    Several URLs are paths to the one board (docs/redundancy.md): r4link.Board(['serial:auto', 'udp://192.168.0.125']).
    """

    def __init__(self, url: str | Iterable[str], *, role: BoardRole | str = BoardRole.CONTROL, arming: bool = True,
                 fields: str = 'DEFAULT', key: str | os.PathLike[str] | None = None, watch_rate_hz: int = 100,
                 heartbeat: float = 0.1, timeout: float = 1.0, command_retry: float = 0.05, stop_retry: float = 0.02,
                 stop_linger: float = 0.2, identify_interval: float = 1.0, callback_limit: float = 0.5) -> None:
        paths = [url] if isinstance(url, str) else list(url)
        link = next((bad for bad in (getattr(each, 'link', '') for each in paths) if bad), '')
        if link and (len(paths) > 1):
            raise UsageError(f'a bad link {link}', 'it is for a board of one path', 'open that URL alone')
        self._core = _core.Board(
            '+'.join(paths), link=link, role=role, arming=arming, fields=fields,
            key=None if key is None else os.path.expanduser(os.fspath(key)),
            watch_rate_hz=watch_rate_hz, heartbeat=_ms(heartbeat), timeout=_ms(timeout),
            command_retry=_ms(command_retry), stop_retry=_ms(stop_retry), stop_linger=_ms(stop_linger),
            identify_interval=_ms(identify_interval), callback_limit=_ms(callback_limit))
        _open.add(self._core)

    @classmethod
    def first(cls, **options: Any) -> Self:
        """Opens the only board that r4link.discover() finds, which takes 1.3 s at most. Raises OpenError if there is no
        board, with what was searched, and UsageError with the URLs of several."""
        return cls(_core.discover().only().url, **options)

    def _command(self, call: Callable[[], Any]) -> Any:
        return call()

    def _wait(self, call: Callable[[], Any]) -> Any:
        return call()

    def _callback(self, callback: Callable[..., object]) -> Callable[..., object]:
        return callback

    def close(self) -> None:
        """Says farewell and closes the transport: the board goes safe at once. Calls that wait in other threads
        raise ClosedError. Idempotent; a callback may call it."""
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f'<r4link.Board {self.name}: {self.link.state}>'

    @property
    def role(self) -> BoardRole:
        """What this program is to the board at the moment."""
        return self._core.role()

    def take_control(self) -> None:
        """From now on this program controls the board; callbacks and recordings stay. It begins disarmed: wait_active(),
        arm(). Raises RefusedError if another program of this computer controls it, which `holder` names; then this one
        watches on."""
        self._core.take_control()

    def release_control(self, timeout: float = 1.0) -> None:
        """Disarms, says farewell until the board has answered, so that it is safe and free, and watches from then on.
        Raises NotConfirmedError if it does not answer in time: it goes safe by its own timeout, and this program watches
        all the same. Commands that other threads wait for raise CancelledError."""
        self._core.release_control(_ms(timeout))

    def wait_active(self, timeout: float = 3.0) -> None:
        """Until the board is under our control or, where we only watch, is heard. Raises RefusedError that says what
        it is instead."""
        self._core.wait_active(_ms(timeout))

    # --- commands: each returns when the board's own state confirms it, raises RefusedError otherwise

    def send(self, command: str | Command, timeout: float = 1.0) -> None:
        """A command, or its text: 'O:358,1,1'; 'O:358,1,1;O:358,1,2' is a group."""
        self._core.send(command, _ms(timeout))

    def post(self, command: Command | Setpoints) -> PostResult:
        """Sends once, without waiting or confirmation. on_refused() tells of what the board refuses."""
        return self._core.post(command)

    def apply(self, setpoints: Setpoints, timeout: float = 1.0) -> None:
        """All of them in one pass, confirmed as one, or none."""
        self._core.apply(setpoints, _ms(timeout))

    def arm(self, timeout: float = 1.0) -> None:
        """Before the first output command, and again after whatever made the outputs safe but a lost link.

        Clears a stop, a watchdog or a fault that came while this program controlled the board, and closes relay 1. One
        that may have come before the program began is not cleared: NotArmedError says so, and clear() clears it.
        """
        self._core.arm(_ms(timeout))

    @property
    def disarmed_by(self) -> DisarmCause:
        """Why output commands are refused; DisarmCause.NONE when armed."""
        return self._core.disarmed_by()

    def stop(self, timeout: float = 1.0) -> None:
        """Every output safe, at once, repeated until the board confirms it; latched until clear()."""
        self._core.stop(_ms(timeout))

    def stop_async(self) -> None:
        """The same, without waiting."""
        self._core.stop_async()

    @property
    def i2c(self) -> I2c[None, bytes, list[int]]:
        """The devices on the user's I2C bus."""
        return I2c(self)

    @property
    def uart(self) -> Uarts[Uart]:
        """uart[1] and uart[2]."""
        return Uarts(lambda channel: Uart(self, channel))

    def attach(self, device: Device, timeout: float = 1.0) -> None:
        """Sets a described device up (r4link.devices): is it the one? Then what is to be written, which takes arm(), and
        the board's readings, until our session ends. Raises RefusedError if it does not answer, or is another device. To
        be done again after on_restart() and a lost link. `timeout`: for each step. Raises UsageError if another device,
        of another address or name, has one of its slots: i2c.poll_off() of that slot gives the other up."""
        self._core.attach(device._core, _ms(timeout))

    def link_timing(self, board_timeout: float, heartbeat: float, timeout: float = 1.0) -> None:
        """The board's timeout and heartbeat interval together."""
        self._core.link_timing(_ms(board_timeout), _ms(heartbeat), _ms(timeout))

    # --- what the board says

    def identify(self, timeout: float = 1.0) -> Identity:
        return self._core.identify(_ms(timeout))

    @property
    def state(self) -> State:
        """The newest; false while none has come. `received` is when, on the clock of time.monotonic()."""
        return self._core.state()

    def next_state(self, timeout: float = 1.0) -> State:
        return self._core.next_state(_ms(timeout))

    def states(self, most: int | None = None, timeout: float = 1.0, *, lossless: bool = False) -> States:
        """The states from now on, for a loop. The newest at a time; with `most` up to so many wait, then the oldest
        give way. With `lossless` none does: 65536 wait (eleven minutes at 100 Hz) or `most`, and what found no room is
        a DataError at its place."""
        return States(self, most, timeout, lossless)

    @property
    def link(self) -> LinkStatus:
        return self._core.link()

    @property
    def statistics(self) -> Statistics:
        return self._core.statistics()

    @property
    def carrier_counters(self) -> CarrierCounters:
        """What the transport has carried."""
        return self._core.carrier_counters()

    @property
    def name(self) -> str:
        """The transport, for people; of several paths all of them."""
        return self._core.name()

    @property
    def paths(self) -> list[PathStatus]:
        """How each of its paths does, in the order of the URLs."""
        return self._core.paths()

    # --- callbacks: each is told first what there is already. As functions or as decorators.

    def on_state(self, callback: Callable[[State], object]) -> Subscription:
        return self._core.on_state(callback)

    def on_link(self, callback: Callable[[LinkStatus], object]) -> Subscription:
        return self._core.on_link(callback)

    def on_path(self, callback: Callable[[PathStatus], object]) -> Subscription:
        """A path has begun to carry, or ceased to."""
        return self._core.on_path(callback)

    def on_event(self, callback: Callable[[Event], object]) -> Subscription:
        """The transport went up or down, or something is to be warned of."""
        return self._core.on_event(callback)

    def on_restart(self, callback: Callable[[], object]) -> Subscription:
        """The board has begun again: what it was told is gone."""
        return self._core.on_restart(callback)

    def on_arming(self, callback: Callable[[DisarmCause], object]) -> Subscription:
        """Armed (DisarmCause.NONE), or not any more, and why."""
        return self._core.on_arming(callback)

    def on_refused(self, callback: Callable[[RefusedPost], object]) -> Subscription:
        """A command that was posted was refused: by the board, or on its way there."""
        return self._core.on_refused(callback)

    def record(self, to: str | os.PathLike[str] | Recording, *, rotate_bytes: int = 0, rotate_after: int = 0,
               keep_bytes: int = 0) -> None:
        """Every datagram from now on, in both directions, into a file (docs/recordings.md)."""
        if isinstance(to, Recording):
            self._core.record(to)
        else:
            self._core.record(os.fspath(to), rotate_bytes, rotate_after, keep_bytes)

    def watchdog(self, period: float) -> None:
        """Without feed() for so long our heartbeats stop and the board goes safe; 0 turns it off."""
        self._core.watchdog(_ms(period))

    def feed(self) -> None:
        self._core.feed()


