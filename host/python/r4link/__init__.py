# SPDX-License-Identifier: GPL-3.0-or-later
"""R4 link: the R4 robot control board over UDP, USB serial and CAN (docs/python.md)."""
from . import aio
from ._core import (FIELDS, BoardHealth, CarrierCounters, Command, Event, Identity, LinkStatus, Recording, RefusedPost, State,
                    Statistics, Subscription, Wire, __version__)
from .board import (BldcChannel, Board, DriveChannel, RelayChannel, ServoChannel, Setpoints, States, StepperChannel)
from .errors import (CancelledError, ClosedError, DataError, DeniedError, Error, NotArmedError, NotConfirmedError,
                     OpenError, RefusedError, UnsupportedError, UsageError)
from .fleet import Fleet, FleetEvent, FleetResults
from .recording import Log, RecordedBoard, RecordedDatagram, RecordedEvent, read
from .simulation import LinkedUrl, Look, SimBoard, with_link
from .values import Bldc, Direction, Drive, PostResult

FORWARD = Direction.FORWARD
REVERSE = Direction.REVERSE

__all__ = [
    'FIELDS', 'FORWARD', 'REVERSE', 'Bldc', 'BldcChannel', 'Board', 'BoardHealth', 'CancelledError', 'CarrierCounters',
    'ClosedError', 'Command', 'DataError', 'DeniedError', 'Direction', 'Drive', 'DriveChannel', 'Error', 'Event',
    'Fleet', 'FleetEvent', 'FleetResults', 'Identity', 'LinkStatus', 'LinkedUrl', 'Log', 'Look', 'NotArmedError',
    'NotConfirmedError', 'OpenError', 'PostResult', 'RecordedBoard', 'RecordedDatagram', 'RecordedEvent', 'Recording',
    'RefusedError', 'RefusedPost', 'RelayChannel', 'ServoChannel', 'Setpoints', 'SimBoard', 'State', 'States',
    'Statistics', 'StepperChannel', 'Subscription', 'UnsupportedError', 'UsageError', 'Wire', 'aio', 'read', 'with_link',
    '__version__',
]
