# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings as numpy arrays."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _core

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


class RecordedEvent(NamedTuple):
    time: np.datetime64  # UTC
    words: str  # 'up URL', 'link safe stop': docs/how-to/recordings.md


class RecordedDatagram(NamedTuple):
    time: np.datetime64
    direction: str  # '<' from the board, '>' to the board
    data: bytes


class RecordedBoard(NamedTuple):
    """The part of a recording about one board.

    `states` is a structured array with a row for each state: `time` (UTC, the host's), `t_ms` (the
    board's), `pnum`, and a column for each number of each field: volts, `osmc1_pwm` (0-4095),
    `osmc1_dir` (1: forward), `safe` (0: none, as SAFE). A field that a state does not carry keeps
    its last value; before the first value it is 0. Each value of a recorded described device has a
    column in its unit, `bno055_gyro_z`, with nan where there is no measurement. A second device of
    the same kind has its address in the name: `bno055_29_gyro_z`.
    """
    url: str
    name: str  # the board's name or id; '' if unknown
    states: npt.NDArray[Any]
    events: list[RecordedEvent]
    damaged: int  # invalid datagrams
    datagrams: list[RecordedDatagram]  # of both directions, if requested

    def to_pandas(self) -> Any:
        """The states as a pandas.DataFrame, by time."""
        import pandas  # type: ignore
        frame = pandas.DataFrame(self.states)
        frame['time'] = frame['time'].dt.tz_localize('UTC')
        return frame.set_index('time')


class Log(NamedTuple):
    boards: list[RecordedBoard]
    events: list[RecordedEvent]  # of the recording itself: 'end', 'dropped 7'
    damage: list[str]  # the places that cannot be read, and why

    def __getitem__(self, which: Any) -> Any:
        """log['left-arm']: the board of that name or URL."""
        if not isinstance(which, str):
            return tuple(self)[which]
        for board in self.boards:
            if which in (board.name, board.url):
                return board
        raise KeyError(f'{which!r}: not found; the boards are {[board.name or board.url for board in self.boards]}')


def read(path: str | os.PathLike[str], datagrams: bool = False) -> Log:
    """Reads a recording, compressed or not. Raises OpenError, DeniedError, and DataError if the
    file is not a recording. Damage is listed in `damage`, and the rest is read."""
    import numpy as np

    def times(us: Any) -> Any:
        return np.asarray(us, np.int64).view('datetime64[us]')

    def events_of(found: Any) -> list[RecordedEvent]:
        return [RecordedEvent(np.datetime64(at, 'us'), words) for at, words in found]

    boards = []
    found, events, damage = _core.read(os.fspath(path), datagrams)
    while found:
        url, name, damaged, at, t_ms, pnum, columns, told, sent = found.pop(0)
        kinds: list[Any] = [('time', 'datetime64[us]'), ('t_ms', 'u4'), ('pnum', 'u4')]
        taken = {name for name, _ in kinds}
        for i, (column, kind, numbers) in enumerate(columns):
            while column in taken:  # a description may use any names
                column += '_'
            taken.add(column)
            columns[i] = (column, kind, numbers)
        states = np.zeros(len(pnum), np.dtype(kinds + [(column, kind) for column, kind, _ in columns]))
        states['time'], states['t_ms'], states['pnum'] = times(at), t_ms, pnum
        while columns:
            column, kind, numbers = columns.pop()
            if numbers.dtype.kind == 'f':
                states[column] = numbers
            else:
                states[column] = numbers / 100 if kind == 'f8' else numbers.view('u4') if kind == 'u4' else numbers
        boards.append(RecordedBoard(
            url, name, states, events_of(told), damaged,
            [RecordedDatagram(np.datetime64(each, 'us'), direction, data) for each, direction, data in sent]))
    return Log(boards, events_of(events), damage)
