# SPDX-License-Identifier: GPL-3.0-or-later
"""Small values: what a channel is told, and what it says."""
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
    """What the board read by itself from a device on the user's bus; t_ms is its clock then."""
    t_ms: int
    errors: int
    data: bytes


class I2cAnswer(NamedTuple):
    """How the newest single transfer ended."""
    pnum: int
    outcome: I2cOutcome
    data: bytes


class I2cBusReport(NamedTuple):
    """How the user's bus does: the newest outcome, transfers that failed, how often it was clocked free."""
    outcome: I2cOutcome
    errors: int
    recoveries: int


class UartBytes(NamedTuple):
    """What a state says of a UART: where its bytes begin in all that was kept, how many the board has lost, and the
    bytes, of which some were in the state before."""
    position: int
    lost: int
    data: bytes


class UartData(NamedTuple):
    """What has come in on a UART: each byte once, in order; `lost`: how many are missing before or among them."""
    data: bytes
    lost: int
