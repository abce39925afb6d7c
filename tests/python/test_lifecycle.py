# SPDX-License-Identifier: GPL-3.0-or-later
"""Ends of all kinds: of boards, calls, threads, processes and the interpreter."""
import contextlib
import gc
import multiprocessing
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import time
import traceback
import weakref

import pytest

import r4link
from machine import within
from reference_counts import use_all_of_it

SILENT = 'udp://127.0.0.1:9?listen=0'


def run(program, *arguments):
    return subprocess.Popen([sys.executable, '-c', program, *arguments], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True)


def test_ctrl_c_interrupts_a_waiting_call():
    program = f"""
import r4link
board = r4link.Board({SILENT!r})
for call in (lambda: board.wait_active(60), lambda: next(board.states(timeout=60)), lambda: board.identify(60)):
    try:
        print('waits', flush=True)
        call()
    except KeyboardInterrupt:
        print('interrupted', flush=True)
"""
    with run(program) as process:
        for _ in range(3):
            assert process.stdout.readline() == 'waits\n'
            process.send_signal(signal.SIGINT)
            assert process.stdout.readline() == 'interrupted\n'
        assert process.communicate(timeout=10) == ('', '')
        assert process.returncode == 0


@pytest.mark.parametrize('end', ['', 'raise SystemExit(0)', 'import os, signal; os.kill(os.getpid(), signal.SIGINT)'])
def test_the_interpreter_may_end_with_an_open_board(end):
    with subprocess.Popen([os.environ['R4'], 'sim', 'udp://127.0.0.1:0', '--json'], stdout=subprocess.PIPE,
                          text=True) as sim:
        try:
            url = sim.stdout.readline().split('"host_url":"')[1].split('"')[0]
            program = f"""
import r4link, sys
board = r4link.Board(sys.argv[1])
board.on_state(lambda state: state.as_dict())
board.wait_active(); board.arm(); board.osmc(1).set(0.1)
{end}
"""
            with run(program, url) as process:
                _, errors = process.communicate(timeout=20)
                assert process.returncode in (0, -signal.SIGINT), errors
                assert errors == '' or 'KeyboardInterrupt' in errors
            ended = time.monotonic()
            assert any('"state":"SAFE"' in line for line in sim.stdout)
            assert time.monotonic() - ended < within(0.9), 'the board was safe by its timeout, not by a farewell'
        finally:
            sim.kill()


def test_a_board_is_closed_in_a_forked_process(board):
    board.arm()
    child = os.fork()
    if child == 0:
        try:
            board.state  # pylint: disable=pointless-statement
            code = 1
        except r4link.ClosedError as error:
            code = 0 if 'fork' in error.reason else 2
        del board
        gc.collect()
        os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    board.osmc(1).set(0.1)


def in_a_fork(action):
    """Returns the exit code of a forked child that runs `action`, and ends a child that hangs."""
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        code = 1
        try:
            action()
            code = 0
        except BaseException:  # pylint: disable=broad-except
            traceback.print_exc()
        os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_each_call_in_a_fork_is_refused_or_does_nothing(tmp_path):
    in_callback, go_on = threading.Event(), threading.Event()

    def hold(_):
        in_callback.set()
        go_on.wait(20)

    sim = r4link.SimBoard()
    with r4link.SimBoard('udp://127.0.0.1:0') as other, r4link.Recording(tmp_path / 'x.r4log') as recording, \
            r4link.Board(sim.url, callback_limit=0) as board, r4link.Fleet(other.url) as fleet, \
            r4link.Bridge('udp://127.0.0.1:0', 'udp://127.0.0.1:9?listen=0') as bridge:
        board.record(recording)
        board.wait_active()
        states = board.states()
        subscription = board.on_state(hold)
        assert in_callback.wait(10)
        setpoints = r4link.Setpoints(r4link.Command.osmc(1, duty=0.1))
        refused = [lambda: board.state, lambda: board.identify(), board.stop, board.stop_async, lambda: board.paths,
                   lambda: board.post(setpoints), lambda: board.on_link(print), lambda: next(states),
                   states.take, lambda: states.ended, lambda: board.watchdog(1), lambda: fleet.stop(),
                   fleet.health, lambda: fleet.post({0: setpoints}), fleet.next_event,
                   bridge.status, lambda: recording.records, lambda: recording.problem,
                   sim.look, lambda: sim.happen('handle released'), other.look,
                   lambda: other.happen('handle released')]

        def use_all_of_it():
            for number, call in enumerate(refused):
                try:
                    call()
                    assert False, number
                except r4link.ClosedError as error:
                    assert 'fork' in error.reason
            subscription.cancel()
            for each in (board, fleet, bridge, recording, sim, other):
                each.close()

        assert in_a_fork(use_all_of_it) == 0
        go_on.set()
        subscription.cancel()
        board.identify()
        fleet.wait_active()
        assert other.look().open, 'the child has closed the board of its parent'


def test_a_fork_may_end_while_a_callback_runs_in_its_parent():
    program = """
import os, signal, sys, threading, warnings, weakref, r4link
warnings.simplefilter('ignore', DeprecationWarning)  # of os.fork() beside threads, from Python 3.12 on
board = r4link.Board('sim:', callback_limit=0)
runs, may_end = threading.Event(), threading.Event()
subscription = board.on_state(lambda state: (runs.set(), may_end.wait(20)))
weakref.finalize(board, subscription.cancel)
runs.wait(10)
child = os.fork()
if child:
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    may_end.set()
    sys.exit(code)
signal.alarm(15)
"""
    with run(program) as process:
        try:
            assert process.communicate(timeout=20) == ('', '') and process.returncode == 0
        finally:
            process.kill()


def test_a_board_in_a_reference_cycle_is_collected(sim):
    board = r4link.Board(sim.url)
    circle = []
    board.on_state(lambda state, circle=circle: circle)  # a cycle: board -> function -> board
    board.wait_active()
    circle += [board, board.states()]
    gone = weakref.ref(board)
    del board, circle
    for _ in range(3):
        gc.collect()
    assert gone() is None
    with r4link.Board(sim.url) as again:  # the transport is free
        again.wait_active()


def test_a_callback_may_close_its_board(sim, wait):
    board = r4link.Board(sim.url)
    board.on_state(lambda state: board.close())
    wait(lambda: r4link_is_closed(board))
    board.close()


def r4link_is_closed(board):
    try:
        board.identify(0.01)
    except r4link.ClosedError:
        return True
    except r4link.RefusedError:
        pass
    return False


def test_waiting_calls_end_when_another_thread_closes_the_board():
    board = r4link.Board(SILENT)
    ended = []

    def call(function):
        try:
            function()
            ended.append('it ended')
        except r4link.Error as error:
            ended.append(type(error))

    calls = [lambda: board.wait_active(60), lambda: board.identify(60), lambda: board.next_state(60)]
    threads = [threading.Thread(target=call, args=(each,)) for each in calls]
    for each in threads:
        each.start()
    time.sleep(0.05)  # most threads wait after this time, and the other threads end in the same way
    board.close()
    for each in threads:
        each.join(10)
    assert ended == [r4link.ClosedError] * 3


def test_many_threads_use_one_board(sim, board, wait):
    board.arm()
    errors = []

    def work(channel):
        try:
            for i in range(30):
                board.servo(channel).set(us=1000 + i)
                board.state.as_dict()
        except Exception as error:  # pylint: disable=broad-except
            errors.append(error)

    threads = [threading.Thread(target=work, args=(channel,)) for channel in range(1, 9)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert not errors
    wait(lambda: all(abs(pulse - 1029) < 5 for pulse in sim.look().servo_us[:8]))


def test_handles_outlive_a_board_that_is_collected(sim, tmp_path):
    board = r4link.Board(sim.url)
    recording = r4link.Recording(tmp_path / 'x.r4log')
    board.record(recording)
    subscription = board.on_state(lambda state: state)
    board.wait_active()
    gone = weakref.ref(board)
    del board
    gc.collect()
    assert gone() is None
    subscription.cancel()
    assert recording.records > 2
    with r4link.Board(sim.url) as again:  # the transport is free
        again.wait_active()
    recording.close()
    assert len(r4link.read(tmp_path / 'x.r4log').boards) == 1


def test_a_loop_over_states_keeps_its_board_open(sim):
    numbers = []
    for state in r4link.Board(sim.url).states():
        numbers.append(state.pnum)
        gc.collect()
        if len(numbers) == 5:
            break
    board = r4link.Board('sim:')
    states = board.states(lossless=True)
    board.next_state()
    core = board._core
    del board
    gc.collect()
    core.next_state(1000)
    core.close()
    assert len(list(states)) >= 2 and states.ended


def test_a_callback_may_drop_the_last_reference_to_its_board(sim, wait):
    last = [r4link.Board(sim.url)]
    gone = weakref.ref(last[0])
    last[0].on_state(lambda state: last.clear())
    wait(lambda: gone() is None)
    again = []

    def is_open():
        with contextlib.suppress(r4link.OpenError):  # the link ends when its callback returns
            again.append(r4link.Board(sim.url))
        return again

    wait(is_open)
    with again[0] as board:
        board.wait_active()


@pytest.mark.parametrize('left', ['states = r4link.Board("sim:").states(); next(states)',
                                  'core = r4link.Board("sim:")._core; core.wait_active(3000)',
                                  'subscription = r4link.Board("sim:").on_state(print)',
                                  'import tempfile; log = r4link.Recording(tempfile.mkdtemp() + "/x.r4log"); board.record(log)',
                                  'import threading; threading.Thread(target=board.identify).start()',
                                  'board.on_state(lambda state: board.close())',
                                  'board.circle = board; board.on_state(lambda state, board=board: None)'])
def test_the_interpreter_may_end_with_anything_open(left):
    program = f"""
import r4link
board = r4link.Board('sim:')
board.wait_active()
{left}
"""
    with run(program) as process:
        out, errors = process.communicate(timeout=20)
    assert process.returncode == 0 and errors == '', (process.returncode, out, errors)


def test_a_spawned_process_has_boards_of_its_own(board):
    with pytest.raises(TypeError, match='pickle'):
        pickle.dumps(board)
    spawn = multiprocessing.get_context('spawn')
    told = spawn.Queue()
    child = spawn.Process(target=drive_in_a_child, args=(told,))
    child.start()
    assert told.get(timeout=30) == 358
    child.join(10)
    assert child.exitcode == 0
    board.identify()


def drive_in_a_child(told):
    board = r4link.Board('sim:', arming=False)
    board.wait_active()
    board.osmc(1).set_pwm(358)
    told.put(board.state.osmc1.pwm)


def test_repeated_use_leaks_no_objects_threads_or_memory(sim):
    def use():
        use_all_of_it(sim)

    for _ in range(20):
        use()
    gc.collect()
    objects, threads = len(gc.get_objects()), threading.active_count()
    kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # peak memory so far
    for _ in range(60):
        use()
    gc.collect()
    assert len(gc.get_objects()) - objects < 50 and threading.active_count() == threads
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - kib < 2000
