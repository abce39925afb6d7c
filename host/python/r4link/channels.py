# SPDX-License-Identifier: GPL-3.0-or-later
"""What a board has: its output channels, the user's I2C bus and UARTs.

The channel classes serve r4link.Board and r4link.aio.Board: a call that waits returns what the board's send() returns,
None or a coroutine. Times are seconds. Every `timeout` is the time in which the board's state must confirm the command.
"""
from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Callable, Generic, Iterator, TypeVar, overload

from ._core import Command, ServoCalibration, Setpoints, Subscription
from .errors import ClosedError, UsageError
from .values import Direction, PostResult, UartData

if TYPE_CHECKING:
    from ._core import Board as CoreBoard
    from .board import Board

Sent = TypeVar('Sent')  # what send() returns: None, or a coroutine
_MOST_S = 24 * 3600.0


def _ms(seconds: float) -> int:
    """Whole milliseconds, rounded up: a timeout of a little is not one of nothing."""
    if math.isnan(seconds):
        raise UsageError('a time of nan seconds', 'it is no number', 'give seconds')
    return math.ceil(max(-_MOST_S, min(seconds, _MOST_S)) * 1000)


class BoardCommands(ABC, Generic[Sent]):
    """The commands that r4link.Board and r4link.aio.Board have in common."""

    _core: CoreBoard

    @abstractmethod
    def send(self, command: str | Command, timeout: float = 1.0) -> Sent: ...

    @abstractmethod
    def post(self, command: Command | Setpoints) -> PostResult: ...

    def osmc(self, channel: int) -> DriveChannel[Sent]:
        """`channel`: 1 to 4."""
        return DriveChannel(self, channel, Command.osmc)

    def dhb12(self, channel: int) -> DriveChannel[Sent]:
        """`channel`: 1 to 4, for DHB1A, DHB1B, DHB2A and DHB2B."""
        return DriveChannel(self, channel, Command.dhb12)

    def servo(self, channel: int) -> ServoChannel[Sent]:
        """`channel`: 1 to 16."""
        return ServoChannel(self, channel)

    def relay(self, channel: int) -> RelayChannel[Sent]:
        """`channel`: 1 to 8; relay 1 is in the motor supply."""
        return RelayChannel(self, channel)

    def stepper(self, channel: int) -> StepperChannel[Sent]:
        """`channel`: 1 to 4."""
        return StepperChannel(self, channel)

    def bldc(self, channel: int) -> BldcChannel[Sent]:
        """`channel`: 1 to 4."""
        return BldcChannel(self, channel)

    def dac(self, channel: int, *, millivolts: int, timeout: float = 1.0) -> Sent:
        """Sets a voltage of the board: `channel` 1 or 2, `millivolts` 0 to 3300; 0 in the safe state. It is an output,
        so it takes arm(). Command.dac() can be posted, and can be one of Setpoints."""
        return self.send(Command.dac(channel, millivolts=millivolts), timeout)

    def proximity(self, channel: int, *, cm: int, timeout: float = 1.0) -> Sent:
        """The board goes safe when ultrasonic sensor `channel`, 1 to 4, measures less than `cm`, 1 to 400 centimetres;
        0: off."""
        return self.send(Command.proximity(channel, cm=cm), timeout)

    def fields(self, names: str, timeout: float = 1.0) -> Sent:
        """The state fields to ask for: 'DEFAULT,ENC1'."""
        return self.send(f'F:{names}', timeout)

    def setting(self, key: str, value: str, timeout: float = 1.0) -> Sent:
        return self.send(f'C:{key},{value}', timeout)

    def clear(self, timeout: float = 1.0) -> Sent:
        """Takes away the stop, the watchdog or the fault that the board reports; moves nothing."""
        return self.send(Command.clear(), timeout)


class _Channel(Generic[Sent]):
    """A set method returns when the board's state confirms the setpoint, and raises RefusedError otherwise. A post
    method sends the setpoint once, returns at once, and says whether it was sent."""

    def __init__(self, board: BoardCommands[Sent], channel: int) -> None:
        self._board = board
        self._channel = channel


class DriveChannel(_Channel[Sent]):
    """An H-bridge."""

    def __init__(self, board: BoardCommands[Sent], channel: int, make: Callable[..., Command]) -> None:
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
        """Once, before this servo is driven in degrees. The Board keeps it, also while the link is lost; it is not sent
        to the board."""
        self._board._core.calibrate_servo(self._channel, calibration)

    @property
    def calibration(self) -> ServoCalibration:
        """Raises UsageError if the servo was not calibrated."""
        return self._board._core.servo_calibration(self._channel)

    @overload
    def set(self, *, us: int, timeout: float = ...) -> Sent: ...

    @overload
    def set(self, *, degrees: float, timeout: float = ...) -> Sent: ...

    def set(self, *, us: int | None = None, degrees: float | None = None, timeout: float = 1.0) -> Sent:
        """`us`: the pulse width, up to 2500 microseconds; 0: no pulses. `degrees`: the angle; raises UsageError for one
        outside of the calibration's range, or without calibrate()."""
        return self._board.send(self._command(us, degrees), timeout)

    @overload
    def post(self, *, us: int) -> PostResult: ...

    @overload
    def post(self, *, degrees: float) -> PostResult: ...

    def post(self, *, us: int | None = None, degrees: float | None = None) -> PostResult:
        """`us` or `degrees`: as for set()."""
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
    """A stepper."""

    def move_to(self, position: int, *, speed: int = 1000, timeout: float = 1.0) -> Sent:
        """`position`: the target in steps, a signed 32-bit number. `speed`: 1 to 20000 steps a second. Returns when the
        board has taken the target, not when the stepper is there."""
        return self._board.send(Command.stepper(self._channel, position=position, speed=speed), timeout)

    def post(self, position: int, *, speed: int = 1000) -> PostResult:
        """`position`: the target in steps, a signed 32-bit number. `speed`: 1 to 20000 steps a second."""
        return self._board.post(Command.stepper(self._channel, position=position, speed=speed))

    def zero(self, *, timeout: float = 1.0) -> Sent:
        """The stepper and the encoder of this channel count from 0 here; the stepper does not move."""
        return self._board.send(Command.zero(self._channel), timeout)


class BldcChannel(_Channel[Sent]):
    """A brushless motor."""

    def set(self, duty: float, *, brake: bool = False, timeout: float = 1.0) -> Sent:
        """`duty`: from -1, full reverse, to 1, full forward. `brake`: True applies the driver's brake."""
        return self._board.send(Command.bldc(self._channel, duty=duty, brake=brake), timeout)

    def set_pwm(self, pwm: int, *, direction: int = Direction.FORWARD, brake: bool = False,
                timeout: float = 1.0) -> Sent:
        """`pwm`: 0 to 4095 (full speed). `direction`: FORWARD or REVERSE. `brake`: True applies the driver's brake."""
        return self._board.send(Command.bldc(self._channel, pwm=pwm, direction=direction, brake=brake), timeout)

    def post(self, duty: float, *, brake: bool = False) -> PostResult:
        """`duty`: from -1, full reverse, to 1, full forward. `brake`: True applies the driver's brake."""
        return self._board.post(Command.bldc(self._channel, duty=duty, brake=brake))

    def post_pwm(self, pwm: int, *, direction: int = Direction.FORWARD, brake: bool = False) -> PostResult:
        """`pwm`: 0 to 4095 (full speed). `direction`: FORWARD or REVERSE. `brake`: True applies the driver's brake."""
        return self._board.post(Command.bldc(self._channel, pwm=pwm, direction=direction, brake=brake))


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
