# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.aio.Board: the same for asyncio.

    async with r4link.aio.Board('udp://192.168.0.125') as board:
        await board.wait_active()
        await board.arm()
        await board.osmc(1).set(0.1)
        async for state in board.states():
            …

Commands of a board go out in the order in which they were begun, each when the one before has ended; stop() waits for
none of them. A task that is cancelled takes its command back: it is sent no more, though it may have been executed.
"""
from __future__ import annotations

import asyncio
import os
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, Coroutine, Iterable, Type, TypeVar

from . import _core, board as blocking, channels
from ._core import (CarrierCounters, Command, Discovery, Event, Identity, LinkStatus, Recording, RefusedPost, Setpoints,
                    State, Statistics, Subscription, PathStatus)
from .devices import Device
from .enums import BoardRole, DisarmCause, PostResult
from .errors import ClosedError
from .values import UartData

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

T = TypeVar('T')


class _Lane:
    """Calls, one after the other, in a thread of their own."""

    def __init__(self, interrupt: Callable[[int], None]) -> None:
        self._thread = ThreadPoolExecutor(1, 'r4link')
        self._process = os.getpid()
        self._interrupt = interrupt
        self._lock = threading.Lock()
        self._running: object = None

    async def call(self, function: Callable[[], T]) -> T:
        if os.getpid() != self._process:  # in a fork its thread is missing
            raise ClosedError('the board', f'it was opened by the process {self._process}, of which this one is a fork',
                              'open it here, after the fork')
        token = object()
        thread = 0

        def run() -> T:
            nonlocal thread
            with self._lock:
                self._running, thread = token, threading.get_ident()
            try:
                return function()
            finally:
                with self._lock:
                    self._running = None
                    self._interrupt(0)

        future = self._thread.submit(run)
        try:
            return await asyncio.wrap_future(future)
        except asyncio.CancelledError:
            with self._lock:
                if self._running is token:
                    self._interrupt(thread)
            raise

    def end(self) -> None:
        if os.getpid() == self._process:
            self._thread.shutdown(wait=False)


class States:
    """The states of a board from now on: `async for state in board.states(): …`, until the board is closed.

    The link leaves them beside the callbacks, so that none is lost where these are slow; the callback of this one
    only tells that there is one.
    """

    def __init__(self, states: blocking.States, news: asyncio.Event, subscription: Subscription) -> None:
        self._states = states
        self._news = news
        self._end = weakref.finalize(self, subscription.cancel)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> State:
        await asyncio.sleep(0)  # the loop has others to look after, however many states wait
        while True:
            self._news.clear()
            state = self._states.take()
            if state is not None:
                return state
            if self._states.ended:
                self._end()
                raise StopAsyncIteration
            await self._news.wait()

    @property
    def dropped(self) -> int:
        """Those that gave way or found no room."""
        return self._states.dropped


class UartStream:
    """What comes in on a UART: `async for data, lost in board.uart[1]: …`, until the board is closed. What waits is in
    the link; the callback of this one only tells that there is something."""

    def __init__(self, uart: channels.Uart, news: asyncio.Event, subscription: Subscription) -> None:
        self._uart = uart
        self._news = news
        self._end = weakref.finalize(self, subscription.cancel)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> UartData:
        await asyncio.sleep(0)  # the loop has others to look after
        while True:
            self._news.clear()
            try:
                received = self._uart.read()
            except ClosedError:
                self._end()
                raise StopAsyncIteration from None
            if received.data or received.lost:
                return received
            await self._news.wait()


class Uart(channels.UartChannel[Coroutine[Any, Any, None], Coroutine[Any, Any, UartData]]):
    """A UART of r4link.aio.Board: `async for data, lost in board.uart[1]: …`."""

    _board: Board

    def __aiter__(self) -> UartStream:
        news = asyncio.Event()
        self._board._news.add(news)
        return UartStream(self._board._board.uart[self._channel], news, self.on_bytes(lambda _: news.set()))


class Board(channels.BoardCommands[Coroutine[Any, Any, None]]):
    """r4link.Board for asyncio; takes the same options. What does not wait is no coroutine there either."""

    def __init__(self, url: str | Iterable[str], **options: Any) -> None:
        self._board = blocking.Board(url, **options)
        self._core = self._board._core
        interrupt = self._core.interrupt
        self._commands = _Lane(interrupt)
        self._waits = _Lane(interrupt)
        self._stops = _Lane(interrupt)
        self._news: weakref.WeakSet[asyncio.Event] = weakref.WeakSet()  # of loops over states and bytes

    def _command(self, call: Callable[[], T]) -> Coroutine[Any, Any, T]:
        return self._commands.call(call)

    def _wait(self, call: Callable[[], T]) -> Coroutine[Any, Any, T]:
        return self._waits.call(call)

    def _callback(self, callback: Callable[..., object]) -> Callable[..., object]:
        return _on_loop(callback)

    @classmethod
    async def first(cls, **options: Any) -> Self:
        """As r4link.Board.first(): `async with await aio.Board.first() as board: …`."""
        return cls((await discover()).only().url, **options)

    async def close(self) -> None:
        """Says farewell; calls that wait raise ClosedError, loops over states and bytes end."""
        await asyncio.get_running_loop().run_in_executor(None, self._board.close)
        for lane in (self._commands, self._waits, self._stops):
            lane.end()
        for news in list(self._news):
            news.set()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                        trace: TracebackType | None) -> None:
        await asyncio.shield(self.close())

    @property
    def role(self) -> BoardRole:
        return self._board.role

    async def take_control(self) -> None:
        """As r4link.Board.take_control()."""
        await self._commands.call(self._board.take_control)

    async def release_control(self, timeout: float = 1.0) -> None:
        """As r4link.Board.release_control(), when the commands that were begun before have ended."""
        await self._commands.call(lambda: self._board.release_control(timeout))

    async def wait_active(self, timeout: float = 3.0) -> None:
        await self._waits.call(lambda: self._board.wait_active(timeout))

    async def next_state(self, timeout: float = 1.0) -> State:
        return await self._waits.call(lambda: self._board.next_state(timeout))

    async def send(self, command: str | Command, timeout: float = 1.0) -> None:
        await self._commands.call(lambda: self._board.send(command, timeout))

    async def apply(self, setpoints: Setpoints, timeout: float = 1.0) -> None:
        await self._commands.call(lambda: self._board.apply(setpoints, timeout))

    async def arm(self, timeout: float = 1.0) -> None:
        await self._commands.call(lambda: self._board.arm(timeout))

    async def identify(self, timeout: float = 1.0) -> Identity:
        return await self._commands.call(lambda: self._board.identify(timeout))

    @property
    def i2c(self) -> channels.I2c[Coroutine[Any, Any, None], Coroutine[Any, Any, bytes], Coroutine[Any, Any, list[int]]]:
        """The devices on the user's I2C bus."""
        return channels.I2c(self)

    @property
    def uart(self) -> channels.Uarts[Uart]:
        """uart[1] and uart[2]."""
        return channels.Uarts(lambda channel: Uart(self, channel))

    async def attach(self, device: Device, timeout: float = 1.0) -> None:
        """As r4link.Board.attach()."""
        await self._commands.call(lambda: self._board.attach(device, timeout))

    async def link_timing(self, board_timeout: float, heartbeat: float, timeout: float = 1.0) -> None:
        await self._commands.call(lambda: self._board.link_timing(board_timeout, heartbeat, timeout))

    async def stop(self, timeout: float = 1.0) -> None:
        """Overtakes all that is under way. It goes on being sent when the task is cancelled."""
        await self._stops.call(lambda: self._board.stop(timeout))

    def stop_async(self) -> None:
        self._board.stop_async()

    def post(self, command: Command | Setpoints) -> PostResult:
        return self._board.post(command)

    @property
    def disarmed_by(self) -> DisarmCause:
        return self._board.disarmed_by

    @property
    def state(self) -> State:
        return self._board.state

    @property
    def link(self) -> LinkStatus:
        return self._board.link

    @property
    def statistics(self) -> Statistics:
        return self._board.statistics

    @property
    def carrier_counters(self) -> CarrierCounters:
        return self._board.carrier_counters

    @property
    def name(self) -> str:
        return self._board.name

    @property
    def paths(self) -> list[PathStatus]:
        return self._board.paths

    def states(self, most: int | None = None, *, lossless: bool = False) -> States:
        """The states from now on, until the board is closed: as those of r4link.Board."""
        news = asyncio.Event()
        self._news.add(news)
        return States(self._board.states(most, lossless=lossless), news,
                      self.on_state(lambda _: news.set()))

    # --- callbacks, on the loop of the task that adds them

    def on_state(self, callback: Callable[[State], object]) -> Subscription:
        return self._board.on_state(_on_loop(callback))

    def on_link(self, callback: Callable[[LinkStatus], object]) -> Subscription:
        return self._board.on_link(_on_loop(callback))

    def on_path(self, callback: Callable[[PathStatus], object]) -> Subscription:
        return self._board.on_path(_on_loop(callback))

    def on_event(self, callback: Callable[[Event], object]) -> Subscription:
        return self._board.on_event(_on_loop(callback))

    def on_restart(self, callback: Callable[[], object]) -> Subscription:
        return self._board.on_restart(_on_loop(callback))

    def on_arming(self, callback: Callable[[DisarmCause], object]) -> Subscription:
        return self._board.on_arming(_on_loop(callback))

    def on_refused(self, callback: Callable[[RefusedPost], object]) -> Subscription:
        return self._board.on_refused(_on_loop(callback))

    def record(self, to: str | os.PathLike[str] | Recording, *, rotate_bytes: int = 0, rotate_after: int = 0,
               keep_bytes: int = 0) -> None:
        self._board.record(to, rotate_bytes=rotate_bytes, rotate_after=rotate_after, keep_bytes=keep_bytes)

    def watchdog(self, period: float) -> None:
        """What gates the heartbeats is feed(), not the loop: feed where the robot is looked after."""
        self._board.watchdog(period)

    def feed(self) -> None:
        self._board.feed()


async def discover(**options: Any) -> Discovery:
    """As r4link.discover(), with the same options. A task that is cancelled does not end the search, 1.3 s at most."""
    return await asyncio.get_running_loop().run_in_executor(None, lambda: _core.discover(**options))


def _on_loop(callback: Callable[..., object]) -> Callable[..., None]:
    loop = asyncio.get_running_loop()

    def call(*arguments: object) -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(callback, *arguments)

    return call
