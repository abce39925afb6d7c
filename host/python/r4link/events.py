# SPDX-License-Identifier: GPL-3.0-or-later
"""The logger 'r4link' for events of a board's link (docs/how-to/python.md)."""
from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from ._core import LinkStatus, RefusedPost
from .enums import DisarmCause, EventKind, LinkState, PathState, SafeReason

if TYPE_CHECKING:
    from .board import Board

_logger = logging.getLogger('r4link')
_logger.addHandler(logging.NullHandler())  # a program chooses where its logs go

_QUIET_PATHS = (PathState.ASKING, PathState.CARRYING)


def log_events(board: Board) -> None:
    """Logs later events of `board` on its callbacks' thread. Keeps only the board's name."""
    name = _printable(board.name)

    def log(level: int, text: str) -> None:
        _logger.log(level, '%s: %s', name, _printable(text))

    def log_refusal(refused: RefusedPost) -> None:
        log(logging.WARNING, f'a posted command was refused: {refused.refusal if refused.why else refused.why}')

    board.on_event(lambda event: log(logging.INFO if event.kind is EventKind.UP else logging.WARNING, ': '.join(
        filter(None, (f'transport {event.kind}', event.reason, event.fix)))))
    board.on_link(lambda link: log(_level_of(link), f'link {link.state}' + ''.join(
        f', {each}' for each in ((link.reason,) if link.state is LinkState.SAFE else ()) + link.causes)))
    board.on_path(lambda path: log(logging.INFO if path.state in _QUIET_PATHS else logging.WARNING,
                                   f'path {path.name} {path.state}'))
    board.on_restart(lambda: log(logging.WARNING, 'the board has restarted'))
    board.on_arming(lambda cause: log(logging.INFO, 'armed' if cause is DisarmCause.NONE else f'not armed: {cause}'))
    board.on_refused(log_refusal)


def _level_of(link: LinkStatus) -> int:
    if link.state is LinkState.LOST:
        return logging.ERROR
    # While a program connects, the board may be safe for want of a host.
    trouble = link.state is LinkState.SAFE and link.reason is not SafeReason.LINK
    return logging.WARNING if trouble else logging.INFO


def _printable(text: str) -> str:
    """Replaces control characters, which could forge lines of the log."""
    return ''.join(each if each.isprintable() else '?' for each in text)
