# SPDX-License-Identifier: GPL-3.0-or-later
"""Described devices: what the bytes of a sensor on the user's I2C bus mean (docs/described-devices.md).

    imu = r4link.Device('bno055@0x28')
    board.arm()                            # setting it up may write to it
    board.attach(imu)
    imu.reading(board.next_state(), 'gyro_z').number    # rad/s
"""
from __future__ import annotations

from typing import Any, NamedTuple

from . import _core
from ._core import State
from .enums import DeviceRole


class DeviceReading(NamedTuple):
    number: float | None  # in the value's unit; None before the first, and where it is no measurement
    t_ms: int  # the board's clock when it was read
    errors: int  # readings that failed since it was set up


class Device:
    """A described device at an address, its readings in consecutive slots of the board's eight, from `first_slot`, 1 to 8.

    `text`: 'NAME[@ADDRESS[:SLOT]]', where NAME is shipped (shipped()) or the path of a file: './mine.device@0x40'.
    Raises UsageError for one that there is not and for what does not fit, DataError, with its line, for a file that is
    wrong, OpenError and DeniedError for one that cannot be read.
    """

    def __init__(self, text: str, first_slot: int = 1) -> None:
        self._core = _core.load_device(text, first_slot)
        self._made: tuple[Any, ...] = (Device, (text, first_slot))

    @classmethod
    def parse(cls, description: str, address: int | None = None, first_slot: int = 1) -> Device:
        """From the text of a description. `address`: 0x08 to 0x77; None: the one of the description. Raises DataError."""
        device = cls.__new__(cls)
        device._core = _core.parse_device(description, address, first_slot)
        device._made = (Device.parse, (description, address, first_slot))
        return device

    def __reduce__(self) -> tuple[Any, ...]:
        return self._made

    def __str__(self) -> str:
        return str(self._core)

    @property
    def name(self) -> str:
        """What its description calls it: 'bno055'."""
        return self._core.name

    @property
    def title(self) -> str:
        """What it is, in words."""
        return self._core.title

    @property
    def role(self) -> DeviceRole:
        """What it is for a robot."""
        return self._core.role

    @property
    def address(self) -> int:
        """On the I2C bus, 0x08 to 0x77."""
        return self._core.address

    @property
    def fields(self) -> str:
        """Of the state: 'I2C1,I2C2'."""
        return self._core.fields

    @property
    def units(self) -> dict[str, str]:
        """Of its values, by their names; '' is none."""
        return self._core.units

    def is_set_up(self, state: State) -> bool | None:
        """Whether it is still as it was set up. False: it was reset, and its values are not measurements; attach it again.
        None: it was not read yet, or cannot tell."""
        return self._core.is_set_up(state)

    def reading(self, state: State, value: str) -> DeviceReading:
        """Raises UsageError if it has no such value."""
        return DeviceReading(*self._core.reading(state, value))

    def readings(self, state: State) -> dict[str, DeviceReading]:
        """All of them, by their names."""
        return {name: DeviceReading(*each) for name, each in self._core.readings(state).items()}


def shipped() -> list[str]:
    """The names of the devices that are described here."""
    return _core.shipped_devices()
