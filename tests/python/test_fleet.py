# SPDX-License-Identifier: GPL-3.0-or-later
import time

import pytest

import r4link
from r4link import Command, Setpoints


@pytest.fixture(name='fleet')
def eight_boards():
    with r4link.Fleet('sim:?node=0-7') as fleet:
        fleet.wait_active()
        yield fleet


def test_a_fleet_is_opened_by_a_url_pattern(fleet):
    assert len(fleet) == 8 and fleet.url(3) == 'sim:?node=3'
    assert fleet.index('sim:?node=3') == 3 and fleet.index(5) == 5
    assert [each.url for each in fleet.health()] == [f'sim:?node={node}' for node in range(8)]
    assert all(each.well and each.disarmed_by == 'not yet' for each in fleet.health())
    assert fleet.health()[2].identity.board_id in ('', 'sim-2')


def test_a_fleet_returns_one_result_for_each_board(fleet):
    fleet.arm().require()
    assert fleet.send('O:300,1,1')
    assert [state.osmc1.pwm for state in fleet.states()] == [300] * 8
    assert fleet.stop()
    results = fleet.send('O:301,1,1', boards=[2, 'sim:?node=5'])
    assert not results and results.failed == [2, 5] and results[0].outcome == 'not armed'
    assert isinstance(results.error(1), r4link.NotArmedError) and 'sim:?node=5' in str(results.error(1))
    with pytest.raises(r4link.NotArmedError, match='and 1 other boards'):
        results.require()
    fleet.send(Command.clear()).require()


def test_a_fleet_sends_different_setpoints_to_each_board(fleet, wait):
    fleet.arm().require()
    setpoints = {board: Setpoints(Command.osmc(1, pwm=100 + board)) for board in range(8)}
    wait(lambda: all(fleet.post(setpoints)))
    wait(lambda: [state.osmc1.pwm for state in fleet.states()] == [100 + board for board in range(8)])
    assert fleet.send({'sim:?node=1': Setpoints(Command.osmc(1, pwm=7))})
    assert fleet.states()[1].osmc1.pwm == 7
    with pytest.raises(TypeError, match='leave `boards` out'):
        fleet.send(setpoints, boards=[1])


def test_a_fleet_reports_the_events_of_its_boards(fleet):
    list(fleet.events())
    fleet.send('E:STOP', boards=[4]).require()
    kinds = {event.kind for event in fleet.events() if event.board == 4}
    deadline = time.monotonic() + 5
    while not {'link', 'arming'} <= kinds:
        event = fleet.next_event(timeout=deadline - time.monotonic())
        assert event is not None and event.board == 4
        kinds.add(event.kind)


def test_a_fleet_records_into_one_file(fleet, tmp_path):
    path = tmp_path / 'fleet.r4log'
    recording = r4link.Recording(path)
    fleet.record(recording)
    fleet.send('E:STOP').require()
    fleet.close()
    recording.close()
    assert len(r4link.read(path).boards) == 8


def test_a_fleet_refuses_wrong_options(monkeypatch, tmp_path):
    with pytest.raises(r4link.UsageError, match="'drive': this is not a valid BoardRole"):
        r4link.Fleet('sim:', role='drive')
    with pytest.raises(r4link.UsageError, match='only for a Board'):
        r4link.Fleet(r4link.with_link('sim:', 'loss=5%'))
    for wrong in (['sim:', 'sim:?node=2'],), (None,), (b'sim:',):
        with pytest.raises(r4link.UsageError, match=r'write r4link.Fleet\(\*urls\)'):
            r4link.Fleet(*wrong)
    with pytest.raises(r4link.UsageError, match='stop_retry'):
        r4link.Fleet('sim:', stop_retry=0)
    monkeypatch.setenv('HOME', str(tmp_path))
    with pytest.raises(r4link.Error, match=str(tmp_path / 'none')):
        r4link.Fleet('sim:', key='~/none')


def test_a_watching_closed_or_silent_fleet_refuses_calls():
    with r4link.Fleet('sim:?node=0-1', role='watch') as fleet:
        fleet.wait_active()
        with pytest.raises(r4link.UsageError):
            fleet.send('O:1,1,1')
    with pytest.raises(r4link.ClosedError):
        fleet.states()
    with pytest.raises(r4link.UsageError, match='twice'):
        r4link.Fleet('sim:', 'sim:')
    with pytest.raises(r4link.RefusedError, match='udp://127.0.0.1:9'), r4link.Fleet('udp://127.0.0.1:9?listen=0') as gone:
        gone.wait_active(timeout=0.05)
