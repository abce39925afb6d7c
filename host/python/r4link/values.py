# SPDX-License-Identifier: GPL-3.0-or-later
"""Small values: setpoints and readings of channels."""
from typing import NamedTuple

from .enums import I2cOutcome


class Drive(NamedTuple):
    """An H-bridge: pwm 0-4095."""
    pwm: int
    direction: int

    @property
    def duty(self) -> float:
        """-1 to 1, negative in reverse."""
        return self.pwm / 4095 * (1 if self.direction else -1)


class Bldc(NamedTuple):
    """A brushless motor: speed 0-4095."""
    speed: int
    direction: int
    brake: bool


class I2cReading(NamedTuple):
    """A reading that the board took by itself on the user's bus; t_ms: the board's clock at the reading."""
    t_ms: int
    errors: int
    data: bytes


class I2cAnswer(NamedTuple):
    """How the newest single transfer ended."""
    pnum: int
    outcome: I2cOutcome
    data: bytes


class I2cBusReport(NamedTuple):
    """The status of the user's bus: newest outcome, failed transfers, recoveries by clocking."""
    outcome: I2cOutcome
    errors: int
    recoveries: int


class UartBytes(NamedTuple):
    """A UART in one state: the position of the first byte in all kept bytes, the number of bytes that
    the board has lost, and the bytes. Some bytes may also be in the previous state."""
    position: int
    lost: int
    data: bytes


class UartData(NamedTuple):
    """Bytes of a UART, each once, in order; `lost`: the number of missing bytes before or among these."""
    data: bytes
    lost: int
