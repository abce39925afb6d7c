# SPDX-License-Identifier: GPL-3.0-or-later
"""R4 link: the R4 robot control board over UDP, USB serial and CAN (docs/how-to/python.md)."""
import importlib.util as _importlib

if _importlib.find_spec('r4link._core') is None:
    raise ImportError(f'r4link: {__path__[0]} has the sources alone, without the compiled module; build it (cmake --build '
                      'build --target r4_python) and put build/python first on PYTHONPATH, or: pip install .')

from . import aio, commissioning, control, devices  # pylint: disable=wrong-import-position
from ._core import (FIELDS, BoardHealth, BoardWiring, CarrierCounters, Command, Discovery, Event, FoundBoard, Identity,
                    LinkStatus, Recording, RefusedPost, SearchedBus, SearchedNetwork, SearchedPort, ServoCalibration, Setpoints,
                    State, Statistics, Subscription, PathStatus, Wiring, discover, __version__)
from .board import Board, States
from .bridge import Bridge, BridgeCounters, BridgeEnd, BridgeStatus
from .channels import BldcChannel, DriveChannel, I2c, RelayChannel, ServoChannel, StepperChannel, Uart
from .commissioning import Commissioning
from .devices import Device, DeviceReading
from .enums import (BoardRole, DeviceRole, Direction, DisarmCause, EventKind, FleetEventKind, I2cOutcome, LinkCause,
                    LinkState, Outcome, PathState, PostResult, Refusal, SafeReason)
from .errors import (CancelledError, ClosedError, DataError, DeniedError, Error, NotArmedError, NotConfirmedError,
                     OpenError, Program, RefusedError, UnsupportedError, UsageError)
from .fleet import Fleet, FleetEvent, FleetResults
from .recording import Log, RecordedBoard, RecordedDatagram, RecordedEvent, read
from .simulation import LinkedUrl, Look, SimBoard, with_link
from .transport import CanTransport, Transport
from .values import Bldc, Drive, I2cAnswer, I2cBusReport, I2cReading, UartBytes, UartData

FORWARD = Direction.FORWARD
REVERSE = Direction.REVERSE

__all__ = [
    'Bldc', 'BldcChannel', 'Board', 'BoardHealth', 'BoardRole', 'BoardWiring', 'Bridge', 'BridgeCounters', 'BridgeEnd',
    'BridgeStatus', 'CanTransport', 'CancelledError', 'CarrierCounters', 'ClosedError', 'Command', 'Commissioning', 'DataError', 'DeniedError',
    'Device', 'DeviceReading', 'DeviceRole', 'Direction', 'DisarmCause', 'Discovery', 'Drive', 'DriveChannel',
    'Error', 'Event', 'EventKind', 'FIELDS', 'FORWARD', 'Fleet', 'FleetEvent', 'FleetEventKind', 'FleetResults',
    'FoundBoard', 'I2c', 'I2cAnswer', 'I2cBusReport', 'I2cOutcome', 'I2cReading', 'Identity', 'LinkCause',
    'LinkState', 'LinkStatus', 'LinkedUrl', 'Log', 'Look', 'NotArmedError', 'NotConfirmedError', 'OpenError',
    'Outcome', 'PathState', 'PathStatus', 'PostResult', 'Program', 'REVERSE', 'RecordedBoard', 'RecordedDatagram',
    'RecordedEvent', 'Recording', 'Refusal', 'RefusedError', 'RefusedPost', 'RelayChannel', 'SafeReason',
    'SearchedBus', 'SearchedNetwork', 'SearchedPort', 'ServoCalibration', 'ServoChannel', 'Setpoints', 'SimBoard',
    'State', 'States', 'Statistics', 'StepperChannel', 'Subscription', 'Transport', 'Uart', 'UartBytes', 'UartData',
    'UnsupportedError', 'UsageError', 'Wiring', 'aio', 'commissioning', 'control', 'devices', 'discover', 'read', 'with_link', '__version__',
]
