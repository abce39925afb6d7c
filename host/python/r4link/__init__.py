# SPDX-License-Identifier: GPL-3.0-or-later
"""R4 link: the R4 robot control board over UDP, USB serial and CAN (docs/python.md)."""
import importlib.util as _importlib

if _importlib.find_spec('r4link._core') is None:
    raise ImportError(f'r4link: {__path__[0]} has the sources alone, without the compiled module; build it (cmake --build '
                      'build --target r4_python) and put build/python first on PYTHONPATH, or: pip install .')

from . import aio, control, devices  # pylint: disable=wrong-import-position
from ._core import (FIELDS, BoardHealth, CarrierCounters, Command, Discovery, Event, FoundBoard, Identity, LinkStatus,
                    Recording, RefusedPost, SearchedBus, SearchedNetwork, SearchedPort, ServoCalibration, Setpoints,
                    State, Statistics, Subscription, PathStatus, discover, __version__)
from .board import Board, States
from .bridge import Bridge, BridgeCounters, BridgeEnd, BridgeStatus
from .channels import BldcChannel, DriveChannel, I2c, RelayChannel, ServoChannel, StepperChannel, Uart
from .devices import Device, DeviceReading
from .errors import (CancelledError, ClosedError, DataError, DeniedError, Error, NotArmedError, NotConfirmedError,
                     OpenError, Program, RefusedError, UnsupportedError, UsageError)
from .fleet import Fleet, FleetEvent, FleetResults
from .recording import Log, RecordedBoard, RecordedDatagram, RecordedEvent, read
from .simulation import LinkedUrl, Look, SimBoard, with_link
from .values import Bldc, Direction, Drive, I2cAnswer, I2cBusReport, I2cReading, PostResult, UartBytes, UartData

FORWARD = Direction.FORWARD
REVERSE = Direction.REVERSE

__all__ = [
    'Bldc', 'BldcChannel', 'Board', 'BoardHealth', 'Bridge', 'BridgeCounters', 'BridgeEnd', 'BridgeStatus',
    'CancelledError', 'CarrierCounters', 'ClosedError', 'Command', 'DataError', 'DeniedError', 'Device', 'DeviceReading', 'Direction',
    'Discovery', 'Drive',
    'DriveChannel', 'Error', 'Event', 'FIELDS', 'FORWARD', 'Fleet', 'FleetEvent', 'FleetResults', 'FoundBoard', 'I2c', 'I2cAnswer',
    'I2cBusReport', 'I2cReading', 'Identity', 'LinkStatus', 'LinkedUrl', 'Log', 'Look', 'NotArmedError',
    'NotConfirmedError', 'OpenError', 'PostResult', 'Program', 'REVERSE', 'RecordedBoard', 'RecordedDatagram',
    'RecordedEvent', 'Recording', 'RefusedError', 'RefusedPost', 'RelayChannel', 'SearchedBus', 'SearchedNetwork',
    'SearchedPort', 'ServoCalibration', 'ServoChannel', 'Setpoints', 'SimBoard', 'State',
    'States', 'Statistics', 'StepperChannel', 'Subscription', 'Uart', 'UartBytes', 'UartData', 'UnsupportedError',
    'UsageError', 'PathStatus', 'aio', 'control', 'devices',
    'discover', 'read', 'with_link', '__version__',
]
