# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.aio.Board: r4link.Board for asyncio.

    async with r4link.aio.Board('udp://192.168.0.125') as board:
        await board.wait_active()
        await board.arm()
        await board.osmc(1).set(0.1)
        async for state in board.states():
            …

A board's commands are sent in the order in which their coroutines begin. If a task is cancelled, its
command is not sent again, but may have been executed. A stop is sent even if its task is cancelled.
The calls of a board belong to one event loop.
"""
from __future__ import annotations

import asyncio
import weakref
from types import TracebackType
from typing import TYPE_CHECKING, Any, Callable, Coroutine, Iterable, Type

from . import _core, board as blocking, channels
from ._core import BoardWiring, Discovery, Identity, State, Subscription
from .any_board import AnyBoard
from .channels import _ms
from .errors import ClosedError
from .transport import Transport
from .values import UartData

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing


async def _result(call: _core.Call) -> Any:
    """The result of a call. The link's thread makes the descriptor readable when the call ends."""
    loop = asyncio.get_running_loop()
    ended = loop.create_future()
    loop.add_reader(call.fileno(), _end, ended)
    try:
        await ended
    finally:
        loop.remove_reader(call.fileno())
        call.cancel()  # no effect after the call's end
    return call.result()


def _end(ended: asyncio.Future[None]) -> None:
    if not ended.done():
        ended.set_result(None)


class States:
    """The states of a board from now on: `async for state in board.states(): …`, until the board is
    closed. The link queues the states, so slow callbacks lose no state."""

    def __init__(self, states: blocking.States, news: asyncio.Event, subscription: Subscription) -> None:
        self._states = states
        self._news = news
        self._end = weakref.finalize(self, subscription.cancel)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> State:
        await asyncio.sleep(0)  # lets other tasks run while many states wait
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
        """The number of states that a newer state replaced or that found no room."""
        return self._states.dropped


class UartStream:
    """Received bytes of UART `channel`, 1 or 2: `async for data, lost in board.uart[1]: …`."""

    def __init__(self, core: _core.Board, channel: int, news: asyncio.Event, subscription: Subscription) -> None:
        self._core, self._channel = core, channel
        self._news = news
        self._end = weakref.finalize(self, subscription.cancel)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> UartData:
        await asyncio.sleep(0)  # lets other tasks run
        while True:
            self._news.clear()
            try:
                received = self._core.uart_read(self._channel, 0)
            except ClosedError:
                self._end()
                raise StopAsyncIteration from None
            if received.data or received.lost:
                return received
            await self._news.wait()


class Uart(channels.UartChannel[Coroutine[Any, Any, None]]):
    """A UART of r4link.aio.Board: `async for data, lost in board.uart[1]: …`."""

    _board: Board

    def __aiter__(self) -> UartStream:
        news = asyncio.Event()
        self._board._news.add(news)
        return UartStream(self._board._core, self._channel, news, self.on_bytes(lambda _: news.set()))

    async def read(self, timeout: float = 0.0) -> UartData:
        """As Uart.read() of r4link.Board. `timeout`: seconds."""
        received = self._board._core.uart_read(self._channel, 0)
        if received.data or received.lost or _ms(timeout) <= 0:
            return received
        try:
            return await asyncio.wait_for(anext(aiter(self)), timeout)
        except (asyncio.TimeoutError, StopAsyncIteration):
            return self._board._core.uart_read(self._channel, 0)


class Board(AnyBoard[Coroutine[Any, Any, None]]):
    """r4link.Board for asyncio, with the same options. A call that does not wait is not a
    coroutine. Callbacks run on the loop of the task that adds them."""

    def __init__(self, url: str | Transport | Iterable[str] | Iterable[Transport], **options: Any) -> None:
        self._board = blocking.Board(url, **options)
        self._core = self._board._core
        self._calls: Any = _core.Calls(self._core)  # each call returns at once
        self._news: weakref.WeakSet[asyncio.Event] = weakref.WeakSet()  # of `async for` loops

    def _call(self, call: Callable[[_core.Board], Any],
              then: Callable[[Any], Any] = lambda result: result) -> Any:
        async def run() -> Any:
            return then(await _result(call(self._calls)))

        coroutine = run()
        # Python's warning of a forgotten await names the method that made `call`.
        method = call.__qualname__.split('.<locals>')[0].rsplit('.', 1)[-1]
        coroutine.__qualname__ = f'Board.{method}'
        return coroutine

    def stop(self, timeout: float = 1.0) -> Coroutine[Any, Any, None]:
        """As r4link.Board.stop(). The stop begins with this call, even if the coroutine does not run
        or is cancelled. `timeout`: seconds to wait for the confirmation."""
        stop: _core.Call = self._calls.stop(_ms(timeout))
        coroutine: Coroutine[Any, Any, None] = self._call(lambda core: stop)
        return coroutine

    def _callback(self, callback: Callable[..., object]) -> Callable[..., object]:
        return _on_loop(callback)

    @classmethod
    async def first(cls, **options: Any) -> Self:
        """As r4link.Board.first(): `async with await aio.Board.first() as board: …`."""
        return cls((await discover()).only().url, **options)

    async def close(self) -> None:
        """Sends the farewell. Waiting calls raise ClosedError; loops over states and bytes end."""
        await asyncio.get_running_loop().run_in_executor(None, self._board.close)
        for news in list(self._news):
            news.set()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                        trace: TracebackType | None) -> None:
        await asyncio.shield(self.close())

    async def next_state(self, timeout: float = 1.0) -> State:
        """Waits up to `timeout` seconds for a state."""
        try:
            return await asyncio.wait_for(anext(self.states()), _ms(timeout) / 1000)
        except (asyncio.TimeoutError, StopAsyncIteration):
            return self._core.next_state(1)  # raises the error

    def identify(self, timeout: float = 1.0) -> Coroutine[Any, Any, Identity]:
        """Requests the board's identity. `timeout`: seconds to wait for the answer."""
        identity: Coroutine[Any, Any, Identity] = self._call(lambda core: core.identify(_ms(timeout)))
        return identity

    def wiring(self, timeout: float = 1.0) -> Coroutine[Any, Any, BoardWiring]:
        """The wiring that the board keeps. Needs the board's own cable. `timeout`: seconds to wait for the answer."""
        wiring: Coroutine[Any, Any, BoardWiring] = self._call(lambda core: core.wiring(_ms(timeout)))
        return wiring

    @property
    def i2c(self) -> channels.I2c[Coroutine[Any, Any, None], Coroutine[Any, Any, bytes], Coroutine[Any, Any, list[int]]]:
        """The devices on the user's I2C bus."""
        return channels.I2c(self)

    @property
    def uart(self) -> channels.Uarts[Uart]:
        """uart[1] and uart[2]."""
        return channels.Uarts(lambda channel: Uart(self, channel))

    def states(self, most: int | None = None, *, lossless: bool = False) -> States:
        """As r4link.Board.states(), until the board is closed. `most`: 1 or more states wait."""
        news = asyncio.Event()
        self._news.add(news)
        return States(self._board.states(most, lossless=lossless), news,
                      self.on_state(lambda _: news.set()))


async def discover(**options: Any) -> Discovery:
    """As r4link.discover(). The search takes at most 1.3 s. Cancelling the task does not end the search."""
    return await asyncio.get_running_loop().run_in_executor(None, lambda: _core.discover(**options))


def _on_loop(callback: Callable[..., object]) -> Callable[..., None]:
    loop = asyncio.get_running_loop()

    def call(*arguments: object) -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(callback, *arguments)

    return call
