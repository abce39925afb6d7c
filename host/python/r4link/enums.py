# SPDX-License-Identifier: GPL-3.0-or-later
"""The enumerations of the package. A member equals the text of its value, so both of these work:

    if board.link.state is r4link.LinkState.ACTIVE: ...
    if board.link.state == 'active': ...

The values and their order are those of C++: importing r4link fails if a C++ value has no member.
"""
from __future__ import annotations

import enum
from typing import NoReturn


class Word(str, enum.Enum):
    """An enumeration of texts. str() and format() of a member give its text, as with enum.StrEnum
    of Python 3.11. Each member has its own docstring: print(r4link.LinkState.ACTIVE.__doc__)."""

    def __new__(cls, word: str, meaning: str = '') -> Word:
        member = str.__new__(cls, word)
        member._value_ = word
        member.__doc__ = meaning
        return member

    def __str__(self) -> str:
        return str.__str__(self)

    def __format__(self, form: str) -> str:
        return str.__format__(self, form)

    @classmethod
    def _missing_(cls, value: object) -> NoReturn:
        from .errors import UsageError  # imported here, because errors.py imports this module
        *first, last = (f"'{each}'" for each in cls)
        raise UsageError(repr(value), f'this is not a valid {cls.__name__}', f'give {", ".join(first)} or {last}')


class Direction(enum.IntEnum):
    """The direction of a motor."""
    REVERSE = 0
    FORWARD = 1


class BoardRole(Word):
    """The role of a program at its board."""
    CONTROL = 'control', 'it sends heartbeats, and commands the board as soon as no other host does'
    WATCH = 'watch', 'it only receives what the board reports; it may stop the board'


class LinkState(Word):
    """Whether board and host hear each other."""
    CONNECTING = 'connecting', 'the board has not sent a datagram yet, or is starting'
    ACTIVE = 'active', 'the board sends its state and reports no reason to be safe'
    SAFE = 'safe', 'the board reports a reason to be safe: all its outputs are off'
    LOST = 'lost', 'valid datagrams have not arrived from the board for the timeout'


class SafeReason(Word):
    """Why a board's outputs are safe. A member's position is its number in the SAFE field."""
    NONE = 'none', 'the outputs are not safe: they obey commands'
    LINK = 'link', 'no valid host heartbeat came within the timeout, or the transport is down'
    STOP = 'stop', 'an emergency stop came; it lasts until Command.clear() or arm()'
    HANDLE = 'handle', "the dead-man's handle is released"
    PROXIMITY = 'proximity', 'an ultrasonic sensor measures less than its threshold'
    WATCHDOG = 'watchdog', "a task of the board's firmware missed its deadline"
    FAULT = 'fault', 'a chip stopped answering, or the firmware found a fault in itself'


class LinkCause(Word):
    """Faults of a link, the gravest first."""
    TRANSPORT_DOWN = 'transport down', 'the transport is down: unplugged, or switched off (of several paths: all are)'
    TWO_BOARDS = 'two boards', 'the paths lead to two boards, so states are not accepted'
    WATCHDOG = 'watchdog', 'feed() was not called in time, so no heartbeat or command is sent'
    CALLBACK = 'callback', 'a callback of the program does not return, so no heartbeat or command is sent'
    FOREIGN_FRAMES = 'foreign frames', "another protocol uses the board's command id (CAN)"
    BUSY = 'busy', 'another host controls the board'
    BOARD_HAS_NO_KEY = 'board has no key', 'this program has a key, and the board asks for no signature'
    KEY_NEEDED = 'key needed', 'the board asks for a signature, and this program has no key'
    KEY_NOT_TAKEN = 'key not taken', "the board does not accept or does not receive this program's signature"
    WATCHERS_FULL = 'watchers full', 'the board already sends its state to as many watchers as it can'
    NOT_WATCHABLE = 'not watchable', "the board's firmware sends its state only to the controlling host"
    LATE_FRAMES = 'late frames', "the board's flow control comes too late (CAN)"
    OTHER_BOARD = 'other board', 'a path leads to another board and is not used, but the link is up'


class PathState(Word):
    """The status of one path to a board (docs/how-to/redundancy.md)."""
    DOWN = 'down', 'its transport is down, or could not be opened yet'
    ASKING = 'asking', 'its transport is up, and the board has not reported its identity yet'
    OTHER_BOARD = 'other board', 'it leads to another board: only stops are sent on it'
    SILENT = 'silent', 'it leads to the board, and datagrams have not arrived for the timeout'
    CARRYING = 'carrying', 'it carries datagrams from the board'


class DisarmCause(Word):
    """Why a program is not armed."""
    NONE = 'none', 'the program is armed'
    NOT_YET = 'not yet', 'arm() was not called yet'
    STOP = 'stop', 'an emergency stop came'
    HANDLE = 'handle', "the dead-man's handle was released"
    PROXIMITY = 'proximity', 'an ultrasonic sensor measured less than its threshold'
    WATCHDOG = 'watchdog', "a task of the board's firmware missed its deadline"
    FAULT = 'fault', 'the board found a fault in itself'
    LINK = 'link', 'the link was lost, and the board did not restore its outputs'
    RESTART = 'restart', 'the board restarted'
    SUPPLY = 'supply', 'relay 1, the motor supply, was opened'
    SLEEP = 'sleep', 'this computer slept for longer than the board waits for its host'
    EARLIER_STOP = 'earlier stop', 'a stop that may have come before the program began: only Command.clear() clears it'
    EARLIER_WATCHDOG = 'earlier watchdog', 'a watchdog that may have come before the program began: only Command.clear() clears it'
    EARLIER_FAULT = 'earlier fault', 'a fault that may have come before the program began: only Command.clear() clears it'


class Outcome(Word):
    """How a command ended."""
    NONE = 'none', 'the error is not about a command'
    CONFIRMED = 'confirmed', "the board's own state confirms the command"
    REFUSED = 'refused', 'the board refused the command and did not execute it: the Refusal says why'
    TIMED_OUT = 'timed out', 'no confirmation came in time: the command may or may not have been executed'
    CANCELLED = 'cancelled', 'given up by the program, or because a stop, a newer cause to be safe or a restart came'
    CLOSED = 'closed', 'given up: the board was closed'
    BLOCKED = 'blocked', "the link's thread does not answer: the command was not sent, or not confirmed"
    FULL = 'full', 'not accepted: 64 commands are under way already'
    NOT_ARMED = 'not armed', 'not sent: the command drives an output, and the program is not armed'


class Refusal(Word):
    """Why a board refuses a command: the code of its answer (docs/reference/protocol.md)."""
    NONE = 'NONE', 'the board did not refuse the command'
    UNKNOWN = 'UNKNOWN', 'the board does not know this command, field or setting'
    FORMAT = 'FORMAT', 'the text does not have the form of the command'
    RANGE = 'RANGE', 'a value is outside its range'
    CHANNEL = 'CHANNEL', 'the channel does not exist'
    STALE = 'STALE', 'the command is older than one that was executed, or was delayed for too long'
    DUPLICATE = 'DUPLICATE', 'a command with this packet number was executed already'
    SAFE = 'SAFE', 'the outputs are in the safe state'
    BUSY = 'BUSY', 'another host controls the board'
    AUTH = 'AUTH', 'the command is not signed with a key that the board accepts'
    FULL = 'FULL', 'the resource of the command is in use: try again later'


class PostResult(Word):
    """The result of posting a command or group. True if it was sent."""
    SENT = 'sent', 'it was sent'
    NOT_ARMED = 'not armed', 'not sent: it drives an output, and the program is not armed: arm()'
    NO_LINK = 'no link', 'not sent: the link is not up, or the board does not accept our commands yet'
    QUEUE_FULL = 'queue full', 'not sent: too many commands wait already: try again later'
    LATE = 'late', 'not sent: waited for more than 100 ms, because the thread of the link stood still'

    def __bool__(self) -> bool:
        return self is PostResult.SENT


class I2cOutcome(Word):
    """How a transfer on the user's I2C bus ended."""
    DONE = 'done', 'the device acknowledged everything'
    NO_ACKNOWLEDGE = 'no acknowledge', 'no device answers at the address, or the device refused a byte'
    BUS_STUCK = 'bus stuck', 'a device holds a line of the bus'
    CANCELLED = 'cancelled', 'the board went safe before the transfer began, or another session began'
    UNKNOWN = 'unknown', 'an outcome of newer firmware, which this version of R4 link does not know'


class DeviceRole(Word):
    """The role of a described device for a robot (docs/how-to/described-devices.md)."""
    NONE = 'none', 'it has no role, so its values and units are its own'
    IMU = 'imu', 'an inertial sensor: acceleration in m/s2 and turn rate in rad/s, perhaps an orientation'
    POWER = 'power', 'it measures voltage in V and current in A'
    RANGE = 'range', 'it measures a distance in m'
    ANGLE = 'angle', 'it measures an angle in rad'


class EventKind(Word):
    """A change of a transport."""
    UP = 'up', 'the transport went up'
    DOWN = 'down', 'the transport went down: `reason` says why'
    WARNING = 'warning', 'something is wrong, and the transport stays up: `reason` says what'


class FleetEventKind(Word):
    """The kind of a fleet's event, which also gives the type of `FleetEvent.what`."""
    LINK = 'link', 'the link changed: a LinkStatus'
    TRANSPORT = 'transport', 'the transport went up or down, or warns: an Event'
    ARMING = 'arming', 'the board was armed or disarmed: a DisarmCause'
    RESTART = 'restart', 'the board restarted, or this computer slept: None'
    REFUSED = 'refused', 'a posted command was refused: a RefusedPost'
    MISSED = 'missed', 'the number of events that were dropped, because the program did not take them'


class LoopEnd(Word):
    """Why a control loop has ended (docs/how-to/control.md)."""
    NONE = 'none', 'it has not ended'
    ASKED = 'asked', 'the step returned None'
    LATE = 'late', 'the newest state with all fields was sampled longer ago than `late`'
    NOT_ACTIVE = 'not active', 'the board is safe, its link is down, or it restarted'
    DISARMED = 'disarmed', 'the program is not armed any more'
    STANDSTILL = 'standstill', 'a motor is driven, and its encoder stands still'
