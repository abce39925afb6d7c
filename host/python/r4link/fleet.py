# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Fleet: many boards on one thread, opened by URLs and patterns of URLs (docs/how-to/fleet.md).

    with r4link.Fleet('can://can0?node=0-7', 'udp://10.0.0.{1-250}?listen=0') as fleet:
        fleet.wait_active()
        fleet.arm().require()
        fleet.post({0: left, 1: right})
        for health in fleet.health(): ...
        fleet.stop()

Boards count from 0, in the order of the URLs. A board may be named by its index, URL, name or board
id. Times are seconds. A call that waits releases the GIL and obeys Ctrl-C.
"""
from __future__ import annotations

import atexit
import os
import weakref
from types import TracebackType
from typing import TYPE_CHECKING, Iterable, Iterator, Mapping, NamedTuple, Sequence, Type

from . import _core
from ._core import BoardHealth, Command, Event, FleetResult, LinkStatus, Recording, RefusedPost, Setpoints, State
from .channels import _ms
from .enums import BoardRole, DisarmCause, FleetEventKind, PostResult, SafeReason
from .errors import Error, RefusedError, UsageError, error_of

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

_open: weakref.WeakSet[Fleet] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """Sends the farewells before the interpreter ends."""
    for fleet in list(_open):
        fleet.close()


class FleetEvent(NamedTuple):
    """An event of one board."""
    kind: FleetEventKind
    board: int
    what: LinkStatus | Event | DisarmCause | None | RefusedPost | int  # by `kind`


class FleetResults(Sequence[FleetResult]):
    """The results of a command at several boards, in the given order. True if all boards confirmed
    the command."""

    def __init__(self, results: list[FleetResult]) -> None:
        self._results = results

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self._results[index]

    def __len__(self) -> int:
        return len(self._results)

    def __bool__(self) -> bool:
        return all(each.confirmed for each in self._results)

    @property
    def failed(self) -> list[int]:
        """The boards that did not confirm the command."""
        return [each.board for each in self._results if not each.confirmed]

    def error(self, index: int) -> Error | None:
        """Why a board did not confirm the command. `index`: from 0, in the order of the results."""
        each = self._results[index]
        return None if each.confirmed else error_of(*each.problem)

    def require(self) -> None:
        """Raises the error of the first unconfirmed board, with the number of other such boards."""
        first = next((place for place, each in enumerate(self._results) if not each.confirmed), None)
        if first is None:
            return
        kind, thing, reason, fix, outcome, refusal, at = self._results[first].problem
        others = len(self.failed) - 1
        raise error_of(kind, thing, reason + (f' (and {others} other boards)' if others else ''), fix, outcome, refusal,
                       at)


class Fleet:
    def __init__(self, *urls: str, role: BoardRole | str = BoardRole.CONTROL, arming: bool = True,
                 key: str | os.PathLike[str] | None = None, fields: str = 'DEFAULT', watch_rate_hz: int = 100,
                 heartbeat: float = 0.1, timeout: float = 1.0,
                 command_retry: float = 0.05, stop_retry: float = 0.02, stop_linger: float = 0.2,
                 identify_interval: float = 1.0) -> None:
        """Opens all transports and begins the links. Does not wait for the boards.

        Each of `urls` is a URL or a pattern of many URLs: 'can://can0?node=0-7'. Raises UsageError,
        OpenError or DeniedError if a URL cannot be opened. The options are those of Board:
        `watch_rate_hz` is 1 to 1000 states a second; `heartbeat`, `command_retry`, `stop_retry`,
        `stop_linger` and `identify_interval` are seconds.
        """
        for url in urls:
            if not isinstance(url, str):
                raise UsageError(f'a fleet of {url!r}', 'each URL must be a separate text',
                                 "write r4link.Fleet(*urls); several paths to one board are 'URL+URL'")
            if getattr(url, 'link', ''):
                raise UsageError(url, 'with_link() is only for a Board, not for a board of a Fleet',
                                 'open the URL with Board, or give the simulated board a bad link (r4 sim --link)')
        self._core = _core.Fleet(list(urls), role=role, arming=arming, fields=fields,
                                 key=None if key is None else os.path.expanduser(os.fspath(key)),
                                 watch_rate_hz=watch_rate_hz, heartbeat=_ms(heartbeat), timeout=_ms(timeout),
                                 command_retry=_ms(command_retry), stop_retry=_ms(stop_retry),
                                 stop_linger=_ms(stop_linger), identify_interval=_ms(identify_interval))
        _open.add(self)

    def close(self) -> None:
        """Ends heartbeats and sends farewells: all boards go safe at once. Idempotent."""
        _open.discard(self)
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._core)

    def __repr__(self) -> str:
        return f'<r4link.Fleet of {len(self)} boards>'

    def index(self, board: int | str) -> int:
        """The index of a board, from 0. `board`: its URL, name, board id, or index."""
        return self._core.find(board) if isinstance(board, str) else board

    def url(self, board: int) -> str:
        """The URL of a board. `board`: its index, from 0."""
        return self._core.url(board)

    def wait_active(self, timeout: float = 3.0) -> None:
        """Waits until this program controls all boards or, as a watcher, receives their states."""
        missing = self._core.wait_active(_ms(timeout))
        if missing:
            others = f' (and {len(missing) - 1} other boards)' if len(missing) > 1 else ''
            health = self._core.health()[missing[0]]
            state = f'is {health.link.state}' + ('' if health.link.reason is SafeReason.NONE else f', {health.link.reason}')
            raise RefusedError(health.url, state + others, 'check health(), and that the boards are on and connected')

    def health(self) -> list[BoardHealth]:
        """The health of each board, in the order of the URLs."""
        return self._core.health()

    def states(self) -> list[State]:
        """The newest state of each board, at one instant."""
        return self._core.states()

    def send(self, command: str | Command | Mapping[int | str, Setpoints], timeout: float = 1.0, *,
             boards: Iterable[int | str] | None = None) -> FleetResults:
        """Sends a command to all boards, or to `boards`; each board's own state confirms it. A
        mapping gives each of its boards its own setpoints."""
        if isinstance(command, Mapping):
            if boards is not None:
                raise TypeError('the mapping names its boards: leave `boards` out')
            return FleetResults(self._core.send(self._pairs(command), _ms(timeout)))
        return FleetResults(self._core.send(command, self._indices(boards), _ms(timeout)))

    def arm(self, timeout: float = 1.0, *, boards: Iterable[int | str] | None = None) -> FleetResults:
        """Arms all boards, or `boards`, as Board.arm() does."""
        return FleetResults(self._core.arm(self._indices(boards), _ms(timeout)))

    def stop(self, timeout: float = 1.0) -> FleetResults:
        """Makes every output of every board safe at once; on a CAN bus by one frame. Does not raise
        if boards do not confirm the stop: then cut the power."""
        return FleetResults(self._core.stop(_ms(timeout)))

    def stop_async(self) -> None:
        """Begins a stop as stop() does, and returns at once."""
        self._core.stop_async()

    def post(self, setpoints: Mapping[int | str, Setpoints]) -> list[PostResult]:
        """Sends setpoints of several boards once, in one pass, without confirmation: for
        streams."""
        return self._core.post(self._pairs(setpoints))

    def next_event(self, timeout: float = 0.0) -> FleetEvent | None:
        """The oldest event that was not taken yet; None if no event arrives within `timeout`."""
        event = self._core.next_event(_ms(timeout))
        return None if event is None else FleetEvent(*event)

    def events(self) -> Iterator[FleetEvent]:
        """The events since the last call."""
        while (event := self.next_event()) is not None:
            yield event

    def record(self, recording: Recording) -> None:
        """Adds every datagram of every board to `recording`."""
        self._core.record(recording)

    def watchdog(self, period: float) -> None:
        """After `period` seconds without feed() heartbeats stop, and all boards go safe; 0: off."""
        self._core.watchdog(_ms(period))

    def feed(self) -> None:
        """Reports that the program works, which restarts the period of watchdog()."""
        self._core.feed()

    def _indices(self, boards: Iterable[int | str] | None) -> list[int] | None:
        return None if boards is None else [self.index(each) for each in boards]

    def _pairs(self, setpoints: Mapping[int | str, Setpoints]) -> list[tuple[int, Setpoints]]:
        return [(self.index(board), each) for board, each in setpoints.items()]
