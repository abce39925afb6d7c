# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Bridge: a gateway between hosts and a board, in this process (docs/how-to/bridge.md).

    with r4link.Bridge('udp://0.0.0.0:2018', 'can://can0?node=3') as bridge:
        ...
        print(bridge.status()[0].hosts.counters)

The bridge runs on its own thread, which never takes the GIL.
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
    from typing_extensions import Self  # in typing since Python 3.11

_open: weakref.WeakSet[Bridge] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    for bridge in list(_open):
        bridge.close()


class BridgeCounters(NamedTuple):
    """The datagrams from one side, by what the bridge did with them."""
    passed: int
    stops: int  # the emergency stops among `passed`
    # Dropped:
    damaged: int  # a wrong checksum, too long, or not a datagram
    misdirected: int  # a datagram that only a board sends, from the hosts, or the reverse
    kept_out: int  # from hosts that are not served: docs/how-to/bridge.md
    refused: int  # a missing signature, or a setting that only a cable may change
    late: int  # may have waited for more than 100 ms, because the bridge was delayed
    undelivered: int  # the other side is down, full, or has no known peer
    # Datagrams among `passed` that a newer state replaced, or that were dropped after 100 ms.
    outdated: int


class BridgeEnd(NamedTuple):
    name: str  # of the transport
    up: bool
    counters: BridgeCounters  # of the datagrams from this side


class BridgeStatus(NamedTuple):
    """One board and its hosts."""
    hosts: BridgeEnd
    board: BridgeEnd


class Bridge:
    def __init__(self, hosts: str, board: str, *, timeout: float = 1.0,
                 key: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (), open: bool = False) -> None:
        """`hosts`: the transport of the hosts, 'udp://0.0.0.0:2018'. `board`: the board's URL, as for
        Board. Patterns for the same number of boards are joined in order. After `timeout` seconds
        without a heartbeat of the served host, another host may pass. Give at least the board's
        timeout. `key`: key files of the board (`~`: your home). Only datagrams signed with one of
        these keys pass. Between a network and a board at a serial port, `key` is required unless
        `open` lets everyone drive."""
        files = [key] if isinstance(key, (str, os.PathLike)) else key
        self._core = _core.Bridge(hosts, board, timeout=_ms(timeout), open=open,
                                  keys=[os.path.expanduser(os.fspath(each)) for each in files])
        _open.add(self)

    def close(self) -> None:
        """Ends the bridge at once; the boards go safe after their timeout. Idempotent."""
        _open.discard(self)
        self._core.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def status(self) -> list[BridgeStatus]:
        """The status of each board, in order; after close(), the last status."""
        return [BridgeStatus(*(BridgeEnd(name, up, BridgeCounters(*counters)) for name, up, counters in ends))
                for ends in self._core.status()]
