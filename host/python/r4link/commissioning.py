# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks a board step by step with a person, and learns its wiring (docs/how-to/commissioning.md).

    class AtMyBench(r4link.commissioning.Person):
        def ask(self, question): ...

    with r4link.Board('serial:auto') as board:
        work = r4link.Commissioning(board, AtMyBench())
        work.run('osmc 1')
        pathlib.Path('robot.html').write_text(work.report.html)

Each movement is announced, and begins only when the person holds the key.
"""
from __future__ import annotations

import json
from typing import Any, NamedTuple, Sequence

from . import _core
from ._core import Wiring
from .board import Board
from .enums import Word
from .errors import UsageError


class Action(Word):
    """The person's choice in place of an answer."""
    SKIP = 'skip', 'leaves out this check'
    REPEAT = 'repeat', 'begins this check again'
    LEAVE = 'leave', 'ends the run, which can be resumed'


class Question(NamedTuple):
    check: str  # the check's id, 'osmc 1'
    topic: str  # the subject, for scripts: 'which', 'forward', 'meter' …
    text: str
    answer: str  # 'yes_no', 'number' or 'choice'
    choices: tuple[str, ...]  # of a 'choice'
    unit: str  # of a 'number'


class Movement(NamedTuple):
    check: str
    text: str
    command: str  # 'O:410,1,1'; relay 1 closes before it
    most: float  # seconds in which the movement ends


class Person:
    """A base class. `say` prints; define the other functions."""

    def say(self, check: str, text: str) -> None:
        """Shows `text` to the person."""
        print(f'{check}: {text}')

    def ask(self, question: Question) -> bool | float | str | Action:
        """Waits for the answer: a bool, a number, one of the choices, or an Action."""
        raise NotImplementedError

    def await_key(self, movement: Movement) -> Action | None:
        """Announces the movement, and waits until the person holds the key or chooses an Action."""
        raise NotImplementedError

    def holds_key(self) -> bool:
        """Called every 20 ms during a movement; False stops the movement. Must not wait."""
        raise NotImplementedError


class Check(NamedTuple):
    id: str
    section: str  # 'motor supply off' or 'wheels off the ground'
    moves: str  # the moving thing; '': nothing
    about: str


class Measured(NamedTuple):
    what: str
    value: float
    unit: str


class Found(NamedTuple):
    thing: str  # 'osmc 1'
    finding: str  # 'reversed'; the same in all versions
    detail: str
    wrong: str  # a sentence
    fix: str


class CheckResult(NamedTuple):
    id: str
    status: str  # 'not done', 'passed', 'found', 'skipped' or 'unsupported'
    note: str
    measured: tuple[Measured, ...]
    found: tuple[Found, ...]


class Report:
    """The checks, their measurements and findings, and the learnt wiring. Commissioning(resume=…) takes `json`; `html`
    is one page."""

    def __init__(self, text: str, page: str) -> None:
        self.json = text
        self.html = page
        self._data: dict[str, Any] = json.loads(text)

    @property
    def checks(self) -> tuple[CheckResult, ...]:
        """The checks that were done or tried, in their order."""
        return tuple(CheckResult(each['id'], each['status'], each['note'],
                                 tuple(Measured(**value) for value in each['measured']),
                                 tuple(Found(**found) for found in each['found']))
                     for each in self._data['checks'])

    @property
    def found(self) -> tuple[Found, ...]:
        """All findings."""
        return tuple(found for each in self.checks for found in each.found)

    @property
    def learnt_wiring(self) -> Wiring:
        """The board's wiring with the learnt changes. Raises DataError while the wiring is not complete: then
        more checks of one kind are needed."""
        return Wiring.read(self._data['learnt_wiring'], 'learnt wiring')


class _Asked:
    """Converts the results of a Person for the core."""
    _ACTIONS = {Action.SKIP: 1, Action.REPEAT: 2, Action.LEAVE: 3}

    def __init__(self, person: Person) -> None:
        self._person = person
        self.say = person.say
        self.holds_key = person.holds_key

    def ask(self, check: str, topic: str, text: str, kind: str, choices: list[str], unit: str) -> tuple[int, bool, float, int]:
        question = Question(check, topic, text, kind, tuple(choices), unit)
        answer = self._person.ask(question)
        if isinstance(answer, Action):
            return self._ACTIONS[answer], False, 0.0, 0
        if kind == 'yes_no' and isinstance(answer, bool):
            return 0, answer, 0.0, 0
        if kind == 'number' and isinstance(answer, (int, float)) and not isinstance(answer, bool):
            return 0, False, float(answer), 0
        if kind == 'choice' and answer in choices:
            return 0, False, 0.0, choices.index(str(answer))
        raise UsageError(f'{check}: {answer!r}', f'this is not a valid answer to {topic!r}',
                         f'return {"one of " + ", ".join(choices) if choices else kind}, or an Action')

    def await_key(self, check: str, text: str, command: str, most: float) -> tuple[int, bool, float, int]:
        action = self._person.await_key(Movement(check, text, command, most))
        return (0 if action is None else self._ACTIONS[action]), False, 0.0, 0


class Commissioning:
    """Checks `board`, which must be in control, with `person`. `others`: URLs that lead to the same board.
    `resume`: Report.json of an earlier run. No other program may use the board meanwhile."""

    checks: tuple[Check, ...] = tuple(Check(*each) for each in _core.commissioning_checks())

    def __init__(self, board: Board, person: Person, *, others: Sequence[str] = (), resume: str = '') -> None:
        self._board = board
        self._core = _core.Commissioning(board._core, _Asked(person), list(others), resume)

    def run(self, check: str) -> CheckResult | None:
        """Does the check with this id, even if it was done. Returns None if the person left. Raises UsageError if there
        is no such check, RefusedError if the link is lost."""
        if not self._core.run(check):
            return None
        return next(each for each in self.report.checks if each.id == check)

    def run_all(self, only: Sequence[str] = ()) -> bool:
        """Does all checks that were not done yet, or the checks in `only`. False: the person left."""
        return self._core.run_all(list(only))

    def offer(self) -> bool:
        """Asks whether the board may keep the learnt wiring and calibration, and sends them. False: the person left."""
        return self._core.offer()

    @property
    def report(self) -> Report:
        """The report so far."""
        return Report(self._core.json(), self._core.html())


__all__ = ['Action', 'Check', 'CheckResult', 'Commissioning', 'Found', 'Measured', 'Movement', 'Person', 'Question',
           'Report']
