# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated board in this process, with the robot around it, for tests of what drives it."""
from __future__ import annotations

from typing import NamedTuple

from . import _core
from .values import Bldc, Drive


class Look(NamedTuple):
    """What the chips and the robot do, whatever the state says. Channel n is element n-1."""
    open: bool  # a link to the board is open; if not, this is what was last
    supply: bool  # the motors have a supply: relay 1 is closed, the handle held
    handle_held: bool
    is_safe: bool  # no output drives anything
    osmc: tuple[Drive, ...]
    dhb12: tuple[Drive, ...]
    servo_us: tuple[int, ...]
    relays: tuple[bool, ...]
    bldc: tuple[Bldc, ...]
    encoder: tuple[int, ...]  # counts since power came
    stepper: tuple[int, ...]  # steps that the motors took since then
    volts: tuple[float, ...]  # AIN24, AIN12, AIN5, AINDMH, AINSTEER, AIN6


class SimBoard:
    """The board is switched on afresh each time its URL is opened:

        sim = r4link.SimBoard()
        with r4link.Board(sim.url) as board:
            board.wait_active()
            sim.happen('handle released')       # a line of a scenario (docs/simulation.md), without its time
            sim.look().osmc[0].pwm
    """

    def __init__(self) -> None:
        self._core = _core.SimulatedRobot()

    @property
    def url(self) -> str:
        """For one link at a time, in this process."""
        return self._core.url

    def happen(self, words: str) -> None:
        """'us 1 15', 'handle released', 'chip dac off'. Raises DataError for words that say nothing of the kind."""
        self._core.happen(words)

    def look(self) -> Look:
        """No older than 10 ms."""
        return Look(**self._core.look())
