# SPDX-License-Identifier: GPL-3.0-or-later
"""The enumerations: their values are those of C++, and a member is also its text."""
import copy
import inspect
import json
import pickle

import pytest

import r4link
from r4link import _core, control, enums
from r4link.testing import TestBoard, make_state

ENUMS = [each for each in vars(enums).values()
         if inspect.isclass(each) and issubclass(each, enums.Word) and each is not enums.Word]
MEMBERS = [pytest.param(each, id=repr(each)) for enum in ENUMS for each in enum]


@pytest.mark.parametrize('enum', ENUMS, ids=lambda enum: enum.__name__)
def test_an_enumeration_has_the_values_of_cpp_in_their_order(enum):
    newer = [enums.I2cOutcome.UNKNOWN] if enum is enums.I2cOutcome else []  # UNKNOWN has no enumerator in C++
    assert [*_core.ENUMS[enum.__name__], *newer] == list(enum)


def test_the_package_has_every_enumeration_of_cpp():
    assert set(_core.ENUMS) == {enum.__name__ for enum in ENUMS}
    assert all(getattr(control if enum is enums.LoopEnd else r4link, enum.__name__) is enum for enum in ENUMS)


@pytest.mark.parametrize('member', MEMBERS)
def test_an_enumeration_member_equals_its_text(member):
    enum, text = type(member), member.value
    assert type(text) is str and member.name == text.upper().replace(' ', '_')
    assert member == text and str(member) == f'{member}' == '%s' % member == text and f'{member:>20}' == f'{text:>20}'
    assert repr(member) == f'<{enum.__name__}.{member.name}: {text!r}>'
    assert {member: 1}[text] == {text: 1}[member] == 1 and json.loads(json.dumps({member: member})) == {text: text}
    assert enum(text) is enum(member) is enum[member.name] is member


@pytest.mark.parametrize('member', MEMBERS)
def test_an_enumeration_member_has_a_docstring(member):
    assert member.__doc__ not in ('', str.__doc__, type(member).__doc__)


@pytest.mark.parametrize('member', MEMBERS)
def test_a_copy_of_a_member_is_the_member(member):
    copies = [pickle.loads(pickle.dumps(member, protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)]
    assert all(each is member for each in [*copies, copy.copy(member), copy.deepcopy(member)])


def test_a_text_that_is_not_a_member_is_refused(sim):
    with pytest.raises(r4link.UsageError, match="'pilot': this is not a valid BoardRole; give 'control' or 'watch'"):
        r4link.Board('sim:', role='pilot')
    with pytest.raises(ValueError, match='this is not a valid SafeReason'):
        make_state(1, safe='reason')
    with TestBoard(sim.url) as board, pytest.raises(r4link.UsageError, match='this is not a valid SafeReason'):
        board.expect_safe('handel')


def test_a_match_statement_accepts_members_and_texts():
    def words(reason):
        match reason:
            case r4link.SafeReason.STOP:
                return 'member'
            case 'handle':
                return 'text'
        return 'neither'

    assert [words(make_state(1, safe=each).safe) for each in ('stop', r4link.SafeReason.HANDLE, 'link')] == [
        'member', 'text', 'neither']


def test_only_the_post_result_sent_is_true():
    assert [each for each in r4link.PostResult if each] == [r4link.PostResult.SENT]


def test_a_board_returns_enumeration_members(sim, wait):
    events, arming = [], []
    with r4link.Board(sim.url, role=r4link.BoardRole.CONTROL) as board:
        board.on_event(events.append)
        board.on_arming(arming.append)
        board.wait_active()
        assert board.role is r4link.BoardRole.CONTROL and board.disarmed_by is r4link.DisarmCause.NOT_YET
        assert board.link.state is r4link.LinkState.ACTIVE and board.link.reason is r4link.SafeReason.NONE
        assert board.paths[0].state is r4link.PathState.CARRYING and board.next_state().safe is r4link.SafeReason.NONE
        assert board.osmc(1).post(0.1) is r4link.PostResult.NOT_ARMED
        with pytest.raises(r4link.NotArmedError) as not_armed:
            board.osmc(1).set(0.1)
        assert not_armed.value.outcome is r4link.Outcome.NOT_ARMED and not_armed.value.refusal is r4link.Refusal.NONE
        board.fields('DEFAULT,I2CBUS')
        assert board.next_state().i2cbus.outcome is r4link.I2cOutcome.DONE
        wait(lambda: events and arming)
    assert events[0].kind is r4link.EventKind.UP and arming[0] is r4link.DisarmCause.NOT_YET
    assert r4link.Device('bno055@0x28').role is r4link.DeviceRole.IMU


def test_a_fleet_returns_enumeration_members():
    with r4link.Fleet('sim:') as fleet:
        fleet.wait_active()
        assert fleet.health()[0].disarmed_by is r4link.DisarmCause.NOT_YET
        result, = fleet.send('S:1500,3')
        assert result.outcome is r4link.Outcome.NOT_ARMED
        with pytest.raises(r4link.NotArmedError) as not_armed:
            fleet.send('S:1500,3').require()
        assert not_armed.value.outcome is r4link.Outcome.NOT_ARMED
        assert fleet.post({0: r4link.Setpoints(r4link.Command.servo(3, us=1500))}) == [r4link.PostResult.NOT_ARMED]
        assert {type(event.kind) for event in fleet.events()} == {r4link.FleetEventKind}
