# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a board: its output channels, the user's I2C bus and UARTs.

The classes serve r4link.Board and r4link.aio.Board: a call that waits returns None or a coroutine,
as the board's send() does. Times are seconds. Each `timeout` is the time within which the board's
state must confirm the command.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Generic, Iterator, TypeVar, overload

from ._core import Command, ServoCalibration, Setpoints, Subscription
from .enums import Direction, PostResult
from .errors import ClosedError, UsageError
from .values import UartData

if TYPE_CHECKING:
    from .any_board import AnyBoard

# The result of a waiting call for a command, bytes or addresses: the value or its coroutine.
Sent = TypeVar('Sent')
Read = TypeVar('Read')
Scanned = TypeVar('Scanned')
AnyUart = TypeVar('AnyUart')  # the UART of a blocking or an asynchronous board
_MOST_S = 24 * 3600.0


def _ms(seconds: float) -> int:
    """Whole milliseconds, rounded up so that a short timeout is not 0."""
    if math.isnan(seconds):
        raise UsageError('a time of nan seconds', 'the time is not a number', 'give seconds')
    return math.ceil(max(-_MOST_S, min(seconds, _MOST_S)) * 1000)


class _Channel(Generic[Sent]):
    """A set method returns when the board's state confirms the setpoint, and raises RefusedError
    otherwise. A post method sends the setpoint once, and returns at once with the result."""

    def __init__(self, board: AnyBoard[Sent], channel: int) -> None:
        self._board = board
        self._channel = channel


class DriveChannel(_Channel[Sent]):
    """An H-bridge; `channel`: 1 to 4."""

    def __init__(self, board: AnyBoard[Sent], channel: int, make: Callable[..., Command]) -> None:
        super().__init__(board, channel)
        self._make = make

    def set(self, duty: float, *, timeout: float = 1.0) -> Sent:
        """`duty`: from -1, full reverse, to 1, full forward."""
        return self._board.send(self._make(self._channel, duty=duty), timeout)

    def set_pwm(self, pwm: int, *, direction: int = Direction.FORWARD, timeout: float = 1.0) -> Sent:
        """`pwm`: 0 to 4095 (always on). `direction`: FORWARD or REVERSE."""
        return self._board.send(self._make(self._channel, pwm=pwm, direction=direction), timeout)

    def post(self, duty: float) -> PostResult:
        """`duty`: from -1, full reverse, to 1, full forward."""
        return self._board.post(self._make(self._channel, duty=duty))

    def post_pwm(self, pwm: int, *, direction: int = Direction.FORWARD) -> PostResult:
        """`pwm`: 0 to 4095 (always on). `direction`: FORWARD or REVERSE."""
        return self._board.post(self._make(self._channel, pwm=pwm, direction=direction))


class ServoChannel(_Channel[Sent]):
    """A servo, driven by its pulse or, once it is calibrated, by its angle."""

    def calibrate(self, calibration: ServoCalibration) -> None:
        """Call calibrate() once before driving this servo in degrees. The Board keeps the
        calibration, also while the link is lost. The calibration is not sent to the board."""
        self._board._core.calibrate_servo(self._channel, calibration)

    @property
    def calibration(self) -> ServoCalibration:
        """Raises UsageError if the servo is not calibrated."""
        return self._board._core.servo_calibration(self._channel)

    @overload
    def set(self, *, us: int, timeout: float = ...) -> Sent: ...

    @overload
    def set(self, *, degrees: float, timeout: float = ...) -> Sent: ...

    def set(self, *, us: int | None = None, degrees: float | None = None, timeout: float = 1.0) -> Sent:
        """Takes either `us`, the pulse width up to 2500 microseconds (0: no pulses), or `degrees`,
        an angle between the two ends of the calibration. Raises UsageError for an angle beyond
        these ends, or before calibrate()."""
        return self._board.send(self._command(us, degrees), timeout)

    @overload
    def post(self, *, us: int) -> PostResult: ...

    @overload
    def post(self, *, degrees: float) -> PostResult: ...

    def post(self, *, us: int | None = None, degrees: float | None = None) -> PostResult:
        """Takes either `us` or `degrees`, as set() does."""
        return self._board.post(self._command(us, degrees))

    def _command(self, us: int | None, degrees: float | None) -> Command:
        if us is not None and degrees is None:
            return Command.servo(self._channel, us=us)
        if degrees is not None and us is None:
            return Command.servo(self._channel, us=self.calibration.pulse(degrees=degrees))
        raise TypeError('a servo takes either us or degrees')


class RelayChannel(_Channel[Sent]):
    """A relay; relay 1 is in the motor supply."""

    def set(self, on: bool, *, timeout: float = 1.0) -> Sent:
        """`on`: True closes the relay, False opens it."""
        return self._board.send(Command.relay(self._channel, on=on), timeout)

    def post(self, on: bool) -> PostResult:
        """`on`: True closes the relay, False opens it."""
        return self._board.post(Command.relay(self._channel, on=on))


class StepperChannel(_Channel[Sent]):
    """A stepper motor."""

    def move_to(self, position: int, *, speed: int = 1000, timeout: float = 1.0) -> Sent:
        """`position`: the target in steps, a signed 32-bit number. `speed`: 1 to 20000 steps a
        second. Returns when the board has accepted the target, before the stepper has reached it."""
        return self._board.send(Command.stepper(self._channel, position=position, speed=speed), timeout)

    def post(self, position: int, *, speed: int = 1000) -> PostResult:
        """`position`: the target in steps, signed 32 bits. `speed`: 1 to 20000 steps a second."""
        return self._board.post(Command.stepper(self._channel, position=position, speed=speed))

    def zero(self, *, timeout: float = 1.0) -> Sent:
        """Sets the counts of this channel's stepper and encoder to 0; the stepper does not move."""
        return self._board.send(Command.zero(self._channel), timeout)


class BldcChannel(_Channel[Sent]):
    """A brushless motor."""

    def set(self, duty: float, *, brake: bool = False, timeout: float = 1.0) -> Sent:
        """`duty`: -1 (reverse) to 1 (forward). `brake`: True applies the driver's brake."""
        return self._board.send(Command.bldc(self._channel, duty=duty, brake=brake), timeout)

    def set_pwm(self, pwm: int, *, direction: int = Direction.FORWARD, brake: bool = False,
                timeout: float = 1.0) -> Sent:
        """`pwm`: 0 to 4095 (full). `direction`: FORWARD, REVERSE. `brake`: the driver's brake."""
        return self._board.send(Command.bldc(self._channel, pwm=pwm, direction=direction, brake=brake), timeout)

    def post(self, duty: float, *, brake: bool = False) -> PostResult:
        """`duty`: -1 (reverse) to 1 (forward). `brake`: True applies the driver's brake."""
        return self._board.post(Command.bldc(self._channel, duty=duty, brake=brake))

    def post_pwm(self, pwm: int, *, direction: int = Direction.FORWARD, brake: bool = False) -> PostResult:
        """`pwm`: 0 to 4095 (full). `direction`: FORWARD, REVERSE. `brake`: the driver's brake."""
        return self._board.post(Command.bldc(self._channel, pwm=pwm, direction=direction, brake=brake))


class I2c(Generic[Sent, Read, Scanned]):
    """The devices on the user's I2C bus (docs/how-to/devices.md). read(), write() and scan() return when
    the device has answered, and raise RefusedError without an answer. `address`: 0x08 to 0x77,
    without the read bit. `register`: 0 to 255, or up to 2 bytes; b'' names no register. `count`: up
    to 32 bytes. `slot`: 1 to 8."""

    def __init__(self, board: AnyBoard[Sent]) -> None:
        self._board = board

    def read(self, address: int, register: int | bytes, count: int, timeout: float = 1.0) -> Read:
        """Reads `count` bytes of a register."""
        read: Read = self._transfer(f'X:READ,{address},{_register(register)},{count}', timeout)
        return read

    def write(self, address: int, data: bytes, count: int = 0, timeout: float = 1.0) -> Read:
        """Writes, then reads `count` bytes. A write may move something, so it needs arm()."""
        text = f'X:WRITE,{address},x{bytes(data).hex()}' + (f',{count}' if count else '')
        read: Read = self._transfer(text, timeout)
        return read

    def scan(self, timeout: float = 2.0) -> Scanned:
        """Returns the addresses that answer, at most 32."""
        addresses: Scanned = self._transfer('X:SCAN', timeout, list)
        return addresses

    def poll(self, slot: int, address: int, register: int | bytes, count: int, period: float,
             timeout: float = 1.0) -> Sent:
        """Makes the board read by itself every `period` seconds (0.005 to 60), into the slot:
        state.i2c1, after fields('DEFAULT,I2C1')."""
        return self._board.send(f'X:POLL,{address},{_register(register)},{count},{_ms(period)},{slot}', timeout)

    def poll_off(self, slot: int, timeout: float = 1.0) -> Sent:
        """Ends the board's readings of the slot."""
        return self._board.send(f'X:OFF,{slot}', timeout)

    def _transfer(self, text: str, timeout: float, then: Callable[[bytes], object] = bytes) -> Any:
        return self._board._call(lambda core: core.transfer(text, _ms(timeout)), then=then)


class UartChannel(Generic[Sent]):
    """A UART of the user; `channel`: 1 or 2 (docs/how-to/devices.md). setting('uart1', '115200:8N1') turns the UART on,
    and fields('DEFAULT,UART1') makes the board report its bytes."""

    def __init__(self, board: AnyBoard[Sent], channel: int) -> None:
        self._board, self._channel = board, channel

    def write(self, data: bytes, timeout: float = 1.0) -> Sent:
        """Writes 1 to 48 bytes; returns when the board has all bytes. A write may move something, so it needs arm()."""
        return self._board.send(f'X:UART,{self._channel},x{bytes(data).hex()}', timeout)

    def on_bytes(self, callback: Callable[[UartData], object]) -> Subscription:
        """Adds a callback for later bytes, independent of read(). The callback gets each byte once,
        in order, and the number of missing bytes. The callback runs on the thread of the board's callbacks."""
        return self._board._core.uart_on_bytes(self._channel, self._board._callback(callback))


class Uart(UartChannel[None]):
    """A UART of r4link.Board.

        for data, lost in board.uart[1]:    # as read() returns it, until the board is closed
            parser.feed(data)
    """

    def read(self, timeout: float = 0.0) -> UartData:
        """The bytes since the last read(), at most 64 KB: older bytes count as lost. Waits up to
        `timeout` seconds for bytes, then returns no bytes."""
        return self._board._core.uart_read(self._channel, _ms(timeout))

    def __iter__(self) -> Iterator[UartData]:
        while True:
            try:
                received = self.read(1.0)
            except ClosedError:
                return
            if received.data or received.lost:
                yield received


class Uarts(Generic[AnyUart]):
    """The UARTs of a board: board.uart[1] and board.uart[2]."""

    def __init__(self, make: Callable[[int], AnyUart]) -> None:
        self._make = make

    def __getitem__(self, channel: int) -> AnyUart:
        """`channel`: 1 or 2."""
        return self._make(channel)


def _register(register: int | bytes) -> str:
    """The register as in a command: 'x3b00'."""
    return 'x' + (register.to_bytes(1, 'big') if isinstance(register, int) else bytes(register)).hex()
