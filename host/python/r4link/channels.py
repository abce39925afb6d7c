# SPDX-License-Identifier: GPL-3.0-or-later
"""What a board has: its channels, the user's I2C bus and UARTs; and Setpoints, of several channels together.

Times are seconds.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Callable, Iterator

from . import _core
from ._core import Command, Subscription
from .errors import ClosedError, UsageError
from .values import Direction, PostResult, UartData

if TYPE_CHECKING:
    from .board import Board

_MOST_S = 24 * 3600.0


def _ms(seconds: float) -> int:
    """Whole milliseconds, rounded up: a timeout of a little is not one of nothing."""
    if math.isnan(seconds):
        raise UsageError('a time of nan seconds', 'it is no number', 'give seconds')
    return math.ceil(max(-_MOST_S, min(seconds, _MOST_S)) * 1000)


class Setpoints:
    """Output commands that a board executes together, in one pass over its chips, or not at all.

        board.apply(r4link.Setpoints().osmc(1, 358, FORWARD).osmc(2, 358, FORWARD).servo(3, 1500))
    """

    def __init__(self) -> None:
        self._core = _core.Setpoints()

    def add(self, command: Command) -> Setpoints:
        """Any output command."""
        self._core.add(command)
        return self

    def osmc(self, channel: int, pwm: int, direction: int = Direction.FORWARD) -> Setpoints:
        return self.add(Command.osmc(channel, pwm, direction))

    def dhb12(self, channel: int, pwm: int, direction: int = Direction.FORWARD) -> Setpoints:
        return self.add(Command.dhb12(channel, pwm, direction))

    def servo(self, channel: int, pulse_us: int) -> Setpoints:
        return self.add(Command.servo(channel, pulse_us))

    def relay(self, channel: int, on: bool) -> Setpoints:
        return self.add(Command.relay(channel, on))

    def stepper(self, channel: int, position: int, speed: int = 1000) -> Setpoints:
        return self.add(Command.stepper(channel, position, speed))

    def zero(self, channel: int) -> Setpoints:
        return self.add(Command.zero(channel))

    def bldc(self, channel: int, speed: int, direction: int = Direction.FORWARD, brake: bool = False) -> Setpoints:
        return self.add(Command.bldc(channel, speed, direction, brake))

    def dac(self, channel: int, millivolts: int) -> Setpoints:
        return self.add(Command.dac(channel, millivolts))

    def __len__(self) -> int:
        return len(self._core)


class _Channel:
    def __init__(self, board: Board, channel: int) -> None:
        self._board = board
        self._channel = channel


class DriveChannel(_Channel):
    """An H-bridge: pwm 0-4095."""

    def __init__(self, board: Board, channel: int, make: Callable[[int, int, int], Command]) -> None:
        super().__init__(board, channel)
        self._make = make

    def set(self, pwm: int, direction: int = Direction.FORWARD, timeout: float = 1.0) -> None:
        self._board.send(self._make(self._channel, pwm, direction), timeout)

    def post(self, pwm: int, direction: int = Direction.FORWARD) -> PostResult:
        return self._board.post(self._make(self._channel, pwm, direction))


class ServoChannel(_Channel):
    """A servo: pulse width in microseconds, 0 (off) to 2500."""

    def set(self, pulse_us: int, timeout: float = 1.0) -> None:
        self._board.send(Command.servo(self._channel, pulse_us), timeout)

    def post(self, pulse_us: int) -> PostResult:
        return self._board.post(Command.servo(self._channel, pulse_us))


class RelayChannel(_Channel):
    """A relay; 1 is the motor supply."""

    def set(self, on: bool, timeout: float = 1.0) -> None:
        self._board.send(Command.relay(self._channel, on), timeout)

    def post(self, on: bool) -> PostResult:
        return self._board.post(Command.relay(self._channel, on))


class StepperChannel(_Channel):
    """A stepper: position in steps, speed in steps a second (1-20000)."""

    def move_to(self, position: int, speed: int = 1000, timeout: float = 1.0) -> None:
        self._board.send(Command.stepper(self._channel, position, speed), timeout)

    def post(self, position: int, speed: int = 1000) -> PostResult:
        return self._board.post(Command.stepper(self._channel, position, speed))

    def zero(self, timeout: float = 1.0) -> None:
        self._board.send(Command.zero(self._channel), timeout)


class BldcChannel(_Channel):
    """A brushless motor: speed 0-4095."""

    def set(self, speed: int, direction: int = Direction.FORWARD, brake: bool = False, timeout: float = 1.0) -> None:
        self._board.send(Command.bldc(self._channel, speed, direction, brake), timeout)

    def post(self, speed: int, direction: int = Direction.FORWARD, brake: bool = False) -> PostResult:
        return self._board.post(Command.bldc(self._channel, speed, direction, brake))


class I2c:
    """The devices on the user's I2C bus (docs/devices.md). read(), write() and scan() return when the device has
    answered, and raise RefusedError where none does."""

    def __init__(self, board: Board) -> None:
        self._board = board

    def read(self, address: int, register: int | bytes, count: int, timeout: float = 1.0) -> bytes:
        """Of a register, of one byte or as bytes; b'' names none."""
        return self._board._core.i2c_read(address, _register(register), count, _ms(timeout))

    def write(self, address: int, data: bytes, count: int = 0, timeout: float = 1.0) -> bytes:
        """May move something, so that it takes arm(). Then reads `count` bytes."""
        return self._board._core.i2c_write(address, bytes(data), count, _ms(timeout))

    def scan(self, timeout: float = 2.0) -> list[int]:
        """The addresses that answer, at most 32."""
        return list(self._board._core.i2c_scan(_ms(timeout)))

    def poll(self, slot: int, address: int, register: int | bytes, count: int, period: float,
             timeout: float = 1.0) -> None:
        """The board reads it by itself from now on, into slot 1-8: state.i2c1, after fields('DEFAULT,I2C1')."""
        self._board._core.i2c_poll(slot, address, _register(register), count, _ms(period), _ms(timeout))

    def poll_off(self, slot: int, timeout: float = 1.0) -> None:
        self._board._core.i2c_poll_off(slot, _ms(timeout))


class Uart:
    """A UART of the user's, 1 or 2 (docs/devices.md): setting('uart1', '115200:8N1') turns it on,
    fields('DEFAULT,UART1') has the board tell what comes in.

        for data, lost in board.uart[1]:    # what read() would return, as it comes, until the board is closed
            parser.feed(data)
    """

    def __init__(self, board: Board, channel: int) -> None:
        self._board, self._channel = board, channel

    def write(self, data: bytes, timeout: float = 1.0) -> None:
        """1 to 48 bytes; returns when the board has taken them all. May move something, so that it takes arm()."""
        self._board._core.uart_write(self._channel, bytes(data), _ms(timeout))

    def read(self, timeout: float = 0.0) -> UartData:
        """What has come since the last read(), at most 64 KB: older bytes count as lost. Waits until there is
        something; nothing where it does not come in time."""
        return self._board._core.uart_read(self._channel, _ms(timeout))

    def __iter__(self) -> Iterator[UartData]:
        while True:
            try:
                received = self.read(1.0)
            except ClosedError:
                return
            if received.data or received.lost:
                yield received

    def on_bytes(self, callback: Callable[[UartData], object]) -> Subscription:
        """Called for each state that brings some, beside read(): each byte once, in order, and how many are missing.
        From now on, on the thread of the callbacks."""
        return self._board._core.uart_on_bytes(self._channel, callback)


class _Uarts:
    def __init__(self, board: Board) -> None:
        self._board = board

    def __getitem__(self, channel: int) -> Uart:
        return Uart(self._board, channel)


def _register(register: int | bytes) -> bytes:
    return register.to_bytes(1, 'big') if isinstance(register, int) else bytes(register)
