# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors and values can be copied, and sent to another process."""
import concurrent.futures
import copy
import inspect
import multiprocessing
import pickle

import pytest

import r4link
from r4link import _core
from r4link.errors import error_of

ERRORS = [each for each in vars(r4link).values() if inspect.isclass(each) and issubclass(each, r4link.Error)]


def copies(value):
    return [pickle.loads(pickle.dumps(value, protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)] + [
        copy.copy(value), copy.deepcopy(value)]


@pytest.mark.parametrize('kind', ERRORS, ids=lambda kind: kind.__name__)
def test_a_copied_error_keeps_its_type_and_text(kind):
    error = kind('O:1,1,1', 'refused', 'arm it', outcome='refused', refusal='SAFE', at=2)
    error.add_note('on the left arm')
    for each in copies(error):
        assert type(each) is kind and str(each) == str(error) and vars(each) == vars(error)


class OwnError(r4link.RefusedError):
    """An error class that a program defines."""

    def __init__(self, arm):
        super().__init__(arm, 'it does not move')
        self.arm = arm


def test_a_copied_user_error_keeps_its_type_and_text():
    for each in copies(OwnError('left')):
        assert type(each) is OwnError and each.arm == 'left' and str(each) == 'left: it does not move'


def open_it(url):
    r4link.Board(url)


@pytest.fixture(name='pool', params=['Pool', 'ProcessPoolExecutor'])
def pool_of_either_kind(request):
    spawn = multiprocessing.get_context('spawn')
    if request.param == 'Pool':
        with spawn.Pool(1) as pool:
            yield pool.map
    else:
        with concurrent.futures.ProcessPoolExecutor(1, mp_context=spawn) as pool:
            yield lambda job, inputs: list(pool.map(job, inputs))


def test_another_process_can_return_an_error(pool):
    with pytest.raises(r4link.UsageError) as raised:
        pool(open_it, ['no URL'])
    assert raised.value.thing and raised.value.fix


def state_of_a_board(fields):
    with r4link.Board('sim:') as board:
        board.wait_active()
        board.fields(fields)
        while not hasattr(state := board.next_state(), 'enc1'):
            pass
        return state


def test_another_process_can_return_a_state(pool):
    state, = pool(state_of_a_board, ['DEFAULT,ENC1,I2C1,UART1'])
    assert state.ain24 > 20 and state.enc1 == 0 and state.received is not None


def told(value):
    """All public data of a value."""
    if hasattr(value, 'as_dict'):
        return value.as_dict()
    names = [name for name in dir(value) if not name.startswith('_')]
    return {name: told(each) if type(each).__module__ == 'r4link._core' else repr(each)
            for name in names if not callable(each := getattr(value, name))}


def test_copied_values_keep_their_contents(sim, board):
    board.arm()
    with r4link.Fleet('sim:') as fleet:
        fleet.wait_active()
        values = [board.state, board.next_state(), board.link, board.statistics, board.carrier_counters, board.identify(),
                  *board.paths, r4link.Command.osmc(1, pwm=5), *fleet.health(), *fleet.stop(), sim.look(),
                  r4link.Device('bno055@0x29'), r4link.Wiring.plan(),
                  r4link.ServoCalibration(us=(1000, 2000), degrees=(-45, 45))]
        events = []
        board.on_event(events.append)
        board.stop()
        values += events
    for value in values:
        for each in copies(value):
            assert type(each) is type(value) and told(each) == told(value), value
            assert not isinstance(value, r4link.ServoCalibration) or repr(each) == repr(value)


def test_copied_setpoints_have_the_same_effect(board, sim, wait):
    board.arm()
    setpoints = r4link.Setpoints(r4link.Command.osmc(1, pwm=5), r4link.Command.servo(3, us=1500))
    for number, each in enumerate(copies(setpoints), 1):
        assert len(each) == 2
        each.add(r4link.Command.osmc(2, pwm=number))
        board.send(each)
    wait(lambda: sim.look().osmc[1].pwm == number)
    for each in copies(r4link.Command.osmc(2, pwm=9)):
        board.send(each)
    wait(lambda: sim.look().osmc[1].pwm == 9)


def test_a_value_of_another_version_is_refused():
    state = r4link.testing.make_state(1) if hasattr(r4link, 'testing') else _core.make_state(1, 0.0, {})
    version, size, data = state.__getstate__()
    for other in (('0.0.0', size, data), (version, size + 1, data), (version, size, data[:-1]), (version, size, data + b'x')):
        with pytest.raises(r4link.DataError, match='another version'):
            _core.State.__new__(_core.State).__setstate__(other)


def test_an_error_of_the_library_keeps_its_outcome():
    error = error_of('RefusedError', 'O:1,1,1', 'timed out', '', r4link.Outcome.TIMED_OUT, r4link.Refusal.NONE, 0)
    assert all(type(each) is r4link.NotConfirmedError and each.outcome is r4link.Outcome.TIMED_OUT for each in copies(error))
