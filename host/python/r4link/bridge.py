# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Bridge: a gateway between hosts and a board, in this process (docs/bridge.md).

    with r4link.Bridge('udp://0.0.0.0:2018', 'can://can0?node=3') as bridge:
        ...
        print(bridge.status()[0].hosts.counters)

It runs on a thread of its own, which never takes the GIL.
"""
from __future__ import annotations

import atexit
import os
import weakref
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Type

from . import _core
from .channels import _ms

if TYPE_CHECKING:
    from typing_extensions import Self  # since Python 3.11 in typing

_open: weakref.WeakSet[Bridge] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    for bridge in list(_open):
        bridge.close()


class BridgeCounters(NamedTuple):
    """What came from one side, in datagrams, and what became of it."""
    passed: int
    stops: int  # of those: emergency stops
    # Dropped:
    damaged: int  # a wrong checksum, too long, or no datagram at all
    misdirected: int  # what only a board says from the hosts' side, or the other way round
    kept_out: int  # of hosts that are not served: docs/bridge.md
    refused: int  # not signed though it must be, or a setting that only a cable may change
    late: int  # may have waited for more than 100 ms: the bridge was held up
    undelivered: int  # the other side is away, takes no more, or nobody is known there
    # Of what passed: a newer state took its place in front of the other side, or it waited there for 100 ms.
    outdated: int


class BridgeEnd(NamedTuple):
    name: str  # of the transport
    up: bool
    counters: BridgeCounters  # of what came from there


class BridgeStatus(NamedTuple):
    """One board and its hosts."""
    hosts: BridgeEnd
    board: BridgeEnd


class Bridge:
    def __init__(self, hosts: str, board: str, *, timeout: float = 1.0,
                 key: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (), open: bool = False) -> None:
        """`hosts`: where hosts are heard, 'udp://0.0.0.0:2018'; `board`: as Board takes it. Patterns of as many boards
        are joined in order. After `timeout` without a heartbeat of the host that is let through, another is: no shorter
        than the board's timeout. With `key`, the path of a key file of the board's or several (`~` is yours), only what
        is signed with one passes. To a board at a serial port a network needs that, unless `open` lets everyone drive."""
        files = [key] if isinstance(key, (str, os.PathLike)) else key
        self._core = _core.Bridge(hosts, board, timeout=_ms(timeout), open=open,
                                  keys=[os.path.expanduser(os.fspath(each)) for each in files])
        _open.add(self)

    def close(self) -> None:
        """Ends it at once; the boards go safe after their timeout. Idempotent."""
        _open.discard(self)
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def status(self) -> list[BridgeStatus]:
        """Of each board, in order; after close(), how it was then."""
        return [BridgeStatus(*(BridgeEnd(name, up, BridgeCounters(*counters)) for name, up, counters in ends))
                for ends in self._core.status()]
