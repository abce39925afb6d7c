# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Commissioning at a simulated board in this process."""
import json

import pytest

import r4link
from r4link.commissioning import Action, Person


class Watching(Person):
    """Answers from the outputs of the simulated board."""

    def __init__(self, sim, answers):
        self.sim = sim
        self.answers = answers
        self.said = []
        self.moved = []
        self.seen = set()
        self.forward = False

    def say(self, check, text):
        self.said.append(text)

    def ask(self, question):
        assert self.sim.look().is_safe, 'nothing moves while a question is open'
        if question.topic in self.answers:
            return self.answers[question.topic]
        if question.topic == 'which':
            return next((each for each in question.choices if each in self.seen), 'nothing')
        if question.topic == 'forward':
            return self.forward
        return question.topic in ('supply off', 'wheels off ground')

    def await_key(self, movement):
        self.moved.append(movement.command)
        self.seen.clear()

    def holds_key(self):
        look = self.sim.look()
        for n, drive in enumerate(look.osmc, 1):
            if drive.pwm and look.supply:
                self.seen.add(f'osmc {n}')
                self.forward = drive.direction == r4link.FORWARD
        return True


@pytest.fixture(name='sim')
def simulated_board():
    return r4link.SimBoard()


def test_the_checks_have_an_order_and_say_what_moves():
    checks = r4link.Commissioning.checks
    assert [each.id for each in checks][:4] == ['identity', 'settings', 'chips', 'supply AIN24']
    assert all(each.moves for each in checks if each.section == 'wheels off the ground')


def test_a_check_announces_moves_measures_and_reports(sim):
    with r4link.Board(sim.url) as board:
        person = Watching(sim, {})
        work = r4link.Commissioning(board, person)
        result = work.run('osmc 2')
        assert result.status == 'passed', result
        assert person.moved == ['O:410,0,2', 'O:410,1,2']
        assert [each.what for each in result.measured] == ['encoder 2, forward'] and result.measured[0].value > 50
        assert '<td>osmc 2</td>' in work.report.html
        assert sim.look().is_safe
        resumed = r4link.Commissioning(board, person, resume=work.report.json)
        assert resumed.report.checks == work.report.checks


def test_a_finding_is_learnt_into_a_wiring(sim):
    with r4link.Board(sim.url) as board:
        work = r4link.Commissioning(board, Watching(sim, {'forward': True}))
        assert [(each.thing, each.finding) for each in work.run('osmc 1').found] == [('osmc 1', 'reversed')]
        # The simulated board has no cable, so its wiring cannot be read: the learnt wiring starts from the plan.
        assert work.report.learnt_wiring.differences(r4link.Wiring.plan()) == [
            ('osmc 1 direction', 'osmc.1 inverted', 'osmc.1')]
        assert json.loads(work.report.json)['checks'][0]['learnt'] == [{'what': 'option', 'signal': 'osmc 1 direction'}]


def test_an_answer_may_be_an_action_and_must_fit(sim):
    with r4link.Board(sim.url) as board:
        assert r4link.Commissioning(board, Watching(sim, {'which': Action.SKIP})).run('osmc 1').status == 'skipped'
        assert r4link.Commissioning(board, Watching(sim, {'which': Action.LEAVE})).run('osmc 1') is None
        with pytest.raises(r4link.UsageError, match="osmc 1: 7: this is not a valid answer to 'which'"):
            r4link.Commissioning(board, Watching(sim, {'which': 7})).run('osmc 1')
        with pytest.raises(r4link.UsageError, match='this is not a check'):
            r4link.Commissioning(board, Watching(sim, {})).run('osmc 9')
        with pytest.raises(r4link.DataError, match='not JSON'):
            r4link.Commissioning(board, Watching(sim, {}), resume='{')


def test_an_exception_of_the_person_stops_what_moves(sim):
    class Failing(Watching):
        def holds_key(self):
            if any(drive.pwm for drive in self.sim.look().osmc):
                raise KeyError('the bench is on fire')
            return True

    with r4link.Board(sim.url) as board:
        with pytest.raises(KeyError, match='on fire'):
            r4link.Commissioning(board, Failing(sim, {})).run('osmc 1')
        assert board.next_state().safe == 'stop' and sim.look().is_safe
