# SPDX-License-Identifier: GPL-3.0-or-later
"""Described devices: the meaning of the bytes of a sensor on the user's I2C bus
(docs/how-to/described-devices.md).

    imu = r4link.Device('bno055@0x28')
    board.arm()                            # the set-up may write to the device
    board.attach(imu)
    imu.reading(board.next_state(), 'gyro_z').number    # rad/s
"""
from __future__ import annotations

from typing import Any, NamedTuple

from . import _core
from ._core import State
from .enums import DeviceRole


class DeviceReading(NamedTuple):
    number: float | None  # in the value's unit; None without a measurement
    t_ms: int  # the board's clock at the reading
    errors: int  # failed readings since the device was set up


class Device:
    """A described device at an address. Its readings are in consecutive slots of the board, from
    `first_slot`, 1 to 8.

    `text`: 'NAME[@ADDRESS[:SLOT]]'. NAME is one of shipped(), or the path of a file:
    './mine.device@0x40'. Raises UsageError for a device that is unknown or does not fit,
    and DataError with the line for a wrong file. Raises OpenError and DeniedError for a file that
    cannot be read.
    """

    def __init__(self, text: str, first_slot: int = 1) -> None:
        self._core = _core.load_device(text, first_slot)
        self._made: tuple[Any, ...] = (Device, (text, first_slot))

    @classmethod
    def parse(cls, description: str, address: int | None = None, first_slot: int = 1) -> Device:
        """From the text of a description. `address`: 0x08 to 0x77; None: the address in the
        description. Raises DataError."""
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
        """The name in the description: 'bno055'."""
        return self._core.name

    @property
    def title(self) -> str:
        """The title in words."""
        return self._core.title

    @property
    def role(self) -> DeviceRole:
        """The role for a robot."""
        return self._core.role

    @property
    def address(self) -> int:
        """The address on the I2C bus, 0x08 to 0x77."""
        return self._core.address

    @property
    def fields(self) -> str:
        """The state fields of the device: 'I2C1,I2C2'."""
        return self._core.fields

    @property
    def units(self) -> dict[str, str]:
        """The units of the values, by name; '': no unit."""
        return self._core.units

    def is_set_up(self, state: State) -> bool | None:
        """False if the device was reset: attach it again, because its values are not measurements.
        None if the device was not read yet, or does not show a reset."""
        return self._core.is_set_up(state)

    def reading(self, state: State, value: str) -> DeviceReading:
        """The newest reading of a value. Raises UsageError if the device has no such value."""
        return DeviceReading(*self._core.reading(state, value))

    def readings(self, state: State) -> dict[str, DeviceReading]:
        """All readings, by the names of their values."""
        return {name: DeviceReading(*each) for name, each in self._core.readings(state).items()}


def shipped() -> list[str]:
    """The names of the devices that R4 link describes."""
    return _core.shipped_devices()
