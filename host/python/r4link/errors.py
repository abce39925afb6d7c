# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors of the package. Each error names the thing, the reason and the fix.

    Error
      DataError            a datagram, a recording or a file is bad
      UsageError           a URL, an option or a command is wrong (also a ValueError)
      RefusedError         the board refused or did not confirm; `refusal`: Refusal.SAFE, …
        NotConfirmedError  no confirmation in time: the command may have been executed (also a TimeoutError)
        CancelledError     given up by the program, or because a stop or a newer cause arrived first
        ClosedError        the board was closed, or belongs to another process
        NotArmedError      not sent: the command drives an output, and the program is not armed: arm()
      OpenError            the transport cannot be opened or has disconnected (also an OSError)
      DeniedError          the system denies access (also an OSError)
      UnsupportedError     kernel support or an interface is missing
"""
from __future__ import annotations

from typing import Any, NamedTuple

from .enums import Outcome, Refusal


class Program(NamedTuple):
    """A program of this computer."""
    pid: int
    name: str


class Error(Exception):
    """An error (`thing`, `reason`) and its fix (`fix`, '' if unknown).

    `outcome`: how a command ended. `refusal`: why the board refused the command. `at`: the number of
    the command in a group, from 1 (0: no command in particular). `holder`: the program that already
    controls the board, if this control is the reason.
    """

    def __init__(self, thing: str, reason: str, fix: str = '', *, outcome: Outcome | str = Outcome.NONE,
                 refusal: Refusal | str = Refusal.NONE, at: int = 0, holder: Program | None = None) -> None:
        super().__init__(f'{thing}: {reason}' + (f'; {fix}' if fix else ''))
        self.thing = thing
        self.reason = reason
        self.fix = fix
        self.outcome = Outcome(outcome)
        self.refusal = Refusal(refusal)
        self.at = at
        self.holder = holder

    def __str__(self) -> str:
        return str(self.args[0])

    def __reduce__(self) -> tuple[Any, ...]:
        """For copy and pickle, as in multiprocessing."""
        return _again, (type(self), self.args[0]), self.__dict__


def _again(kind: type[Error], text: str) -> Error:
    error = kind.__new__(kind)
    Exception.__init__(error, text)
    return error


class DataError(Error):
    """A datagram, a recording or a file is bad."""


class UsageError(Error, ValueError):
    """A URL, an option or a command is wrong."""


class RefusedError(Error):
    """The board refused, or did not confirm."""


class NotConfirmedError(RefusedError, TimeoutError):
    """No confirmation in time: the command may have been executed."""


class CancelledError(RefusedError):
    """Given up by the program, or because a stop or a newer cause arrived first."""


class ClosedError(RefusedError):
    """The board was closed, or belongs to another process."""


class NotArmedError(RefusedError):
    """Not sent: the command drives an output, and the program is not armed."""


class OpenError(Error, OSError):
    """The transport cannot be opened or has disconnected."""


class DeniedError(Error, OSError):
    """The system denies access."""


class UnsupportedError(Error):
    """Kernel support or an interface is missing."""


_OF_KIND = {each.__name__: each for each in (DataError, UsageError, RefusedError, OpenError, DeniedError, UnsupportedError)}
_OF_OUTCOME = {Outcome.TIMED_OUT: NotConfirmedError, Outcome.CANCELLED: CancelledError, Outcome.CLOSED: ClosedError,
               Outcome.NOT_ARMED: NotArmedError}


def error_of(kind: str, thing: str, reason: str, fix: str, outcome: Outcome, refusal: Refusal, at: int,
             holder: tuple[int, str] | None = None) -> Error:
    """The error for a problem of C++ (include/r4link/error.hpp). `kind`: the name of the class, if
    the outcome has no class. `at`: from 1; 0: no command in particular."""
    made = _OF_OUTCOME.get(outcome, _OF_KIND.get(kind, Error))
    return made(thing, reason, fix, outcome=outcome, refusal=refusal, at=at,
                holder=None if holder is None else Program(*holder))
