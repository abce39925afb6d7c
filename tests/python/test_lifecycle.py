# SPDX-License-Identifier: GPL-3.0-or-later
"""Ends of all kinds: of boards, calls, threads, processes and the interpreter."""
import gc
import os
import resource
import signal
import subprocess
import sys
import threading
import time
import weakref

import pytest

import r4link

SILENT = 'udp://127.0.0.1:9?listen=0'


def run(program, *arguments):
    return subprocess.Popen([sys.executable, '-c', program, *arguments], stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True)


def test_a_call_that_waits_obeys_ctrl_c():
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
board.wait_active(); board.arm(); board.osmc(1).set(300)
{end}
"""
            with run(program, url) as process:
                _, errors = process.communicate(timeout=20)
                assert process.returncode in (0, -signal.SIGINT), errors
                assert errors == '' or 'KeyboardInterrupt' in errors
            ended = time.monotonic()
            assert any('"state":"SAFE"' in line or '"reason":"link"' in line for line in sim.stdout)
            assert time.monotonic() - ended < 0.9, 'by its timeout, not by a farewell'
        finally:
            sim.kill()


def test_a_board_of_the_parent_is_none_of_a_fork(board):
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
    board.osmc(1).set(5)


def test_a_board_in_a_circle_is_collected(sim):
    board = r4link.Board(sim.url)
    circle = []
    board.on_state(lambda state, circle=circle: circle)  # the board knows the function, the function the board
    board.wait_active()
    circle.append(board)
    gone = weakref.ref(board)
    del board, circle
    for _ in range(3):
        gc.collect()
    assert gone() is None
    with r4link.Board(sim.url) as again:  # its transport is free
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


def test_calls_that_wait_end_when_another_thread_closes_the_board():
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
    time.sleep(0.05)  # most of them wait by then; those that do not end in the same way
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
                board.servo(channel).set(1000 + i)
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


def test_nothing_grows(sim):
    def use():
        board = r4link.Board(sim.url, arming=False)
        board.on_state(lambda state: board.name)
        board.on_event(print if board is None else lambda event: event.as_dict())
        board.wait_active()
        for state in board.states():
            state.as_dict()
            break
        try:
            board.osmc(9).set(1)
        except r4link.UsageError:
            pass
        board.close()

    for _ in range(20):
        use()
    gc.collect()
    objects, threads = len(gc.get_objects()), threading.active_count()
    kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # the most so far
    for _ in range(200):
        use()
    gc.collect()
    assert len(gc.get_objects()) - objects < 50 and threading.active_count() == threads
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - kib < 2000
