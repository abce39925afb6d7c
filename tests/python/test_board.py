# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Board on a simulated board in the process."""
import math
import os
import pickle
import re
import sys
import threading
import time

import pytest

import r4link
from machine import within
from r4link import FORWARD, REVERSE, Command, ServoCalibration, Setpoints, testing

ARM = ServoCalibration(us=(1000, 2000), degrees=(-45, 45))


def test_setpoints_reach_the_chips_and_are_reported_in_the_state(sim, board, wait):
    board.arm()
    board.osmc(1).set_pwm(358)
    board.dhb12(2).set_pwm(700, direction=REVERSE)
    board.servo(3).set(us=1500)
    board.relay(2).set(True)
    board.bldc(4).set_pwm(2000, direction=FORWARD, brake=False)
    board.stepper(1).move_to(100, speed=5000)
    assert board.state.osmc1 == (358, FORWARD) and board.state.osmc1.duty == pytest.approx(358 / 4095)
    assert board.state.relay(1) and not board.state.relay(3)
    wait(lambda: sim.look().bldc[3].speed == 2000)  # sim.look() is up to 10 ms old
    look = sim.look()
    assert look.osmc[0] == (358, FORWARD) and look.dhb12[1] == (700, REVERSE) and look.bldc[3].speed == 2000
    assert look.servo_us[2] == pytest.approx(1500, abs=3) and look.relays[1] and look.supply and not look.is_safe
    board.stop()
    assert board.link.reason == 'stop' and board.disarmed_by == 'stop'
    wait(lambda: sim.look().is_safe)
    board.send(Command.clear())
    board.arm()
    board.send('O:5,1,1;O:6,0,2')
    assert board.state.osmc1 == (5, 1)
    wait(lambda: sim.look().osmc[:2] == ((5, 1), (6, 0)))


def test_a_group_is_executed_as_one_or_not_at_all(sim, board, wait):
    board.arm()
    board.send(Setpoints(Command.osmc(1, pwm=100), Command.osmc(2, pwm=200, direction=REVERSE),
                          Command.servo(1, us=900)))
    wait(lambda: [each.pwm for each in sim.look().osmc[:2]] == [100, 200])
    with pytest.raises(r4link.UsageError, match='channel'):
        Setpoints(Command.osmc(1, duty=0), Command.osmc(5, duty=0))
    assert board.post(Setpoints(Command.osmc(1, pwm=7)).add(Command.osmc(2, pwm=8)))
    board.osmc(3).set_pwm(1)  # executed after the group
    wait(lambda: [each.pwm for each in sim.look().osmc[:3]] == [7, 8, 1])


@pytest.mark.parametrize('call', [
    lambda _: Command.osmc(1, 0.1), lambda _: Command.osmc(1, pwm=0.1), lambda _: Command.osmc(1, duty='0.1'),
    lambda _: Command.osmc(1, duty=0.1, pwm=410), lambda _: Command.servo(3, 1500), lambda _: Setpoints('O:0,1,1'),
    lambda board: board.osmc(1).set_pwm(410, FORWARD), lambda board: board.stepper(1).move_to(100, 5000),
    lambda board: board.dac(1650, 1), lambda board: board.osmc(1).set(True), lambda board: board.servo(3).set(1500),
    lambda board: board.servo(3).set(), lambda board: board.servo(3).post(us=1500, degrees=0),
    lambda board: board.servo(3).set(us=1500.5), lambda board: board.servo(3).calibrate(30),
    lambda _: ServoCalibration((1000, 2000), (-45, 45)), lambda _: ServoCalibration(us=(1000, 2000)),
    lambda _: ServoCalibration(us=1000, degrees=-45), lambda _: ServoCalibration(us=(1000.5, 2000), degrees=(-45, 45)),
    lambda _: ServoCalibration(us=(1000, 2000), degrees=('-45', 45)), lambda _: ARM.pulse(30),
    lambda _: ARM.degrees(1500), lambda _: ARM.pulse(degrees=True)])
def test_an_unnamed_value_or_a_wrong_type_is_a_type_error(board, call):
    with pytest.raises(TypeError):
        call(board)


def test_a_calibrated_servo_is_driven_in_degrees(sim, board, wait):
    board.fields('DEFAULT,SERVO3POS')
    board.servo(3).calibrate(ARM)
    board.arm()
    board.servo(3).set(degrees=30)
    assert board.state.servo3pos == 1833 == ARM.pulse(degrees=30)
    assert board.servo(3).calibration.degrees(us=board.state.servo3pos) == pytest.approx(30, abs=0.05)
    assert board.servo(3).post(degrees=-45)
    wait(lambda: sim.look().servo_us[2] == pytest.approx(1000, abs=3))
    board.send(Setpoints(Command.servo(3, us=ARM.pulse(degrees=0)), Command.osmc(1, duty=0)))
    assert ARM.degrees(us=board.next_state().servo3pos) == 0
    board.servo(3).set(us=0)
    assert ARM.degrees(us=board.next_state().servo3pos) is None
    board.release_control()
    board.take_control()
    board.wait_active()
    board.arm()
    board.servo(3).set(degrees=45)
    assert board.next_state().servo3pos == 2000


def test_degrees_outside_the_calibration_are_not_sent(board):
    board.arm()
    board.servo(1).set(us=1200)
    for move in (board.servo(1).set, board.servo(1).post):
        with pytest.raises(r4link.UsageError, match='calibrate'):
            move(degrees=30)
    board.servo(1).calibrate(ARM)
    for wrong in (45.1, -46, math.nan, math.inf):
        for move in (board.servo(1).set, board.servo(1).post):
            with pytest.raises(r4link.UsageError):
                move(degrees=wrong)
    assert board.next_state().servo1pos == 1200
    for wrong in ({'us': (1000, 1000), 'degrees': (-45, 45)}, {'us': (1000, 2000), 'degrees': (45, 45)},
                  {'us': (0, 2000), 'degrees': (-45, 45)}, {'us': (1000, 2000), 'degrees': (-45, math.nan)}):
        with pytest.raises(r4link.UsageError):
            ServoCalibration(**wrong)
    with pytest.raises(r4link.UsageError, match='give 1 to 16'):
        board.servo(17).calibrate(ARM)
    assert repr(ARM) == 'ServoCalibration(us=(1000, 2000), degrees=(-45.0, 45.0))'


def test_a_negative_duty_drives_reverse(sim, board, wait):
    board.arm()
    board.osmc(1).set(-0.25)
    assert board.state.osmc1 == (1024, REVERSE)
    board.send(Setpoints(Command.osmc(1, duty=1), Command.bldc(2, duty=-0.5, brake=False)))
    wait(lambda: sim.look().osmc[0] == (4095, FORWARD) and sim.look().bldc[1][:2] == (2048, REVERSE))


def test_errors_name_the_thing_the_reason_and_the_fix(board):
    with pytest.raises(r4link.NotArmedError) as not_armed:
        board.osmc(1).set_pwm(1)
    assert not_armed.value.thing == 'O:1,1,1' and 'arm()' in not_armed.value.fix
    assert isinstance(not_armed.value, r4link.RefusedError) and not_armed.value.outcome == 'not armed'
    assert board.osmc(1).post(0) is r4link.PostResult.NOT_ARMED and not board.osmc(1).post(0)
    for wrong, error in [(lambda: board.servo(17).set(us=1), ValueError), (lambda: board.osmc(1).set(1.5), ValueError),
                         (lambda: board.osmc(1).set_pwm(4096), r4link.UsageError),
                         (lambda: board.osmc(1).set_pwm(1, direction=2), r4link.UsageError),
                         (lambda: board.osmc(1).set_pwm(1 << 40), TypeError),
                         (lambda: board.send('nonsense'), r4link.UsageError),
                         (lambda: board.send('F:NOSUCH'), r4link.UsageError),
                         (lambda: board.send('E:STOP\0'), r4link.Error),
                         (lambda: board.wait_active(math.nan), r4link.UsageError),
                         (lambda: board.states(0), r4link.UsageError),
                         (lambda: board.record('/no/where'), OSError),
                         (lambda: r4link.Board('tcp://x'), r4link.UsageError),
                         (lambda: r4link.Board('sim:', role='drive'), r4link.UsageError),
                         (lambda: r4link.Board('sim:', key='/no/where'), r4link.OpenError),
                         (lambda: r4link.Board('sim:', key='~/no/where'), r4link.OpenError),
                         (lambda: r4link.Board('serial:///dev/null/x'), r4link.OpenError)]:
        with pytest.raises(error):
            wrong()
    with pytest.raises(r4link.RefusedError):
        r4link.Board('udp://127.0.0.1:9?listen=0').wait_active(timeout=0.05)


def test_a_command_is_refused_after_the_handle_is_released(sim, board):
    board.arm()
    sim.happen('handle released')
    with pytest.raises(r4link.RefusedError) as refused:
        for _ in range(1000):
            board.osmc(1).set(0.1)
    assert refused.value.outcome in ('refused', 'cancelled', 'not armed')
    assert board.next_state().dmhsta is False
    with pytest.raises(r4link.DataError):
        sim.happen('no such thing')


def test_a_state_has_every_field_that_the_board_reports(board):
    board.fields('DEFAULT,ENC1,US1')
    state = board.next_state()
    assert 'enc1' in state.present and state.as_dict()['ain24'] == pytest.approx(24.28, abs=0.5)
    assert list(state.as_dict())[:3] == ['pnum', 't_ms', 'ain24']
    assert repr(state).startswith('State(pnum=') and 'osmc1=Drive(pwm=0, direction=0)' in repr(state)
    assert 0 <= time.monotonic() - state.received < 5
    assert state.safe == 'none' and state.fault is None and 'fault' not in state.present
    assert time.monotonic() - 5 < state.sampled <= state.received
    assert abs(state.sampled_utc.timestamp() - time.time()) < 5
    assert {name for name in r4link.FIELDS if hasattr(state, name)} == {*state.present, 'fault'}
    assert set(state.present) < set(dir(state)) and 'enc2' not in dir(state)


def test_a_field_that_the_board_has_not_reported_is_an_error(board):
    state = board.next_state()
    with pytest.raises(AttributeError, match=re.escape("enc2: the board has not reported this field; request the field: "
                                                       "fields('DEFAULT,ENC2')")):
        state.enc2
    with pytest.raises(AttributeError, match='relays: '):
        testing.make_state(1).relay(1)


def test_a_state_has_a_sample_time_with_an_error_bound(board):
    deadline = time.monotonic() + 10
    while (state := board.next_state()).sampled_error is None or state.sampled_error > 0.002:
        assert time.monotonic() < deadline, state.sampled_error
    following = board.next_state()
    apart = (following.t_ms - state.t_ms) / 1000
    assert abs(following.sampled - state.sampled - apart) <= state.sampled_error + following.sampled_error
    statistics = board.statistics
    assert abs(statistics.clock_drift_ppm) <= 100 and 0 < statistics.clock_drift_error_ppm <= 100


def test_iterates_over_states(board):
    numbers = []
    for state in board.states(most=100):
        numbers.append(state.pnum)
        if len(numbers) == 20:
            break
    assert numbers == sorted(set(numbers))
    newest = board.states()
    for _ in range(10):
        board.next_state()
    assert next(newest).pnum > numbers[-1] + 5 and newest.dropped > 3
    rest = board.states()
    board.close()
    assert len(list(rest)) <= 1


def test_loses_no_state_while_a_callback_and_the_loop_sleep(sim, tmp_path):
    path = tmp_path / 'all.r4log'
    with r4link.Board(sim.url, callback_limit=0) as board:
        board.record(path)
        board.wait_active()
        awake = threading.Event()
        board.on_state(lambda _: awake.wait(20))
        states = board.states(lossless=True)
        for _ in range(30):
            board.next_state()
        awake.set()
    numbers = [state.pnum for state in states]
    [robot] = r4link.read(path).boards
    all_of_them = robot.states['pnum'].tolist()
    assert len(numbers) >= 30 and states.ended and states.dropped == 0
    first = all_of_them.index(numbers[0])
    assert numbers == all_of_them[first:first + len(numbers)]


def test_lossless_iteration_raises_where_states_are_lost(board):
    states = board.states(5, lossless=True)
    for _ in range(8):
        board.next_state()
    numbers = [next(states).pnum for _ in range(5)]
    with pytest.raises(r4link.DataError, match='queue of 5 states.*most'):
        next(states)
    assert states.dropped >= 3 and next(states).pnum > numbers[-1] + 3


def test_callbacks_run_on_their_own_thread(sim, board, wait):
    told = {name: [] for name in ('state', 'link', 'event', 'arming', 'refused')}
    threads = set()

    def tell(name):
        def callback(value):
            threads.add(threading.current_thread())
            told[name].append(value)
        return callback

    subscriptions = [getattr(board, f'on_{name}')(tell(name)) for name in told]
    board.arm()
    sim.happen('handle released')
    wait(lambda: board.link.reason == 'handle')
    wait(lambda: told['arming'][-1:] == ['handle'] and told['state'] and told['link'][-1].reason == 'handle')
    assert told['event'][0].kind == 'up' and told['arming'][0] == 'not yet' and 'none' in told['arming']
    assert threading.main_thread() not in threads and len(threads) == 1
    for each in subscriptions:
        each.cancel()
    count = len(told['state'])
    board.next_state()
    board.next_state()
    assert len(told['state']) == count


def test_a_callback_that_raises_is_reported_and_called_again(board, monkeypatch, wait):
    raised = []
    monkeypatch.setattr(sys, 'unraisablehook', lambda each: raised.append(each.exc_value))

    @board.on_state
    def _broken(_):
        raise KeyError('mine')

    wait(lambda: len(raised) > 2)
    assert all(isinstance(each, KeyError) for each in raised)
    board.next_state()


def test_a_callback_may_send_a_command(sim, board, wait):
    board.arm()
    done = []

    def once(_):
        if not done:
            board.osmc(2).set_pwm(77)
            done.append(True)

    board.on_state(once)
    wait(lambda: done and sim.look().osmc[1].pwm == 77)


def test_a_callback_that_hangs_makes_the_board_safe(sim, wait):
    with r4link.Board(sim.url, callback_limit=0.05) as board:
        board.wait_active()
        board.arm()
        board.osmc(1).set(0.1)
        go_on = threading.Event()
        board.on_link(lambda _: go_on.wait(20))
        wait(lambda: sim.look().is_safe)
        assert board.link.gated
        go_on.set()
        wait(lambda: not board.link.gated)


def test_without_feed_the_board_goes_safe(sim, board, wait):
    board.arm()
    board.osmc(1).set(0.1)
    board.watchdog(0.05)
    wait(lambda: sim.look().is_safe)
    board.watchdog(0)
    board.feed()
    board.wait_active()


def test_a_watcher_can_stop_but_not_arm(sim):
    with r4link.Board(sim.url, role='watch') as board:
        board.wait_active()
        assert board.next_state().safe == 'link'
        with pytest.raises(r4link.UsageError):
            board.arm()
        board.stop()


def test_takes_control_and_releases_it(sim, wait):
    with r4link.Board(sim.url, role='watch') as board:
        states = []
        board.on_state(states.append)
        board.wait_active()
        board.take_control()
        board.take_control()  # no effect: the host already has control
        board.wait_active()
        board.arm()
        board.osmc(1).set_pwm(358)
        assert board.role == 'control'
        wait(lambda: sim.look().osmc[0].pwm == 358)
        board.release_control()
        assert (board.role, board.disarmed_by) == ('watch', 'not yet')
        wait(lambda: sim.look().osmc[0].pwm == 0 and sim.look().is_safe)
        before = len(states)
        wait(lambda: len(states) > before)
        assert board.next_state().safe == 'link'
        with pytest.raises(r4link.UsageError):
            board.arm()
        board.release_control()


def test_the_controlling_program_has_the_udp_port_of_hosts():
    with r4link.SimBoard('udp://127.0.0.1:0') as sim, r4link.Board(sim.url.split('?')[0], role='watch') as board:
        for _ in range(2):
            board.wait_active()
            assert '?listen=' in board.name, 'the watcher has the port of hosts'
            board.take_control()
            board.wait_active()
            assert '?listen=' not in board.name
            board.release_control()
            board.next_state()


def test_an_error_names_the_program_that_controls_the_board():
    with r4link.SimBoard('pty:') as sim, r4link.Board(sim.url) as driver:
        driver.wait_active()
        with r4link.Board(sim.url, role='watch') as watcher:
            watcher.wait_active()
            with pytest.raises(r4link.RefusedError) as refused:
                watcher.take_control()
            assert refused.value.holder.pid == os.getpid() and refused.value.holder.name
            assert pickle.loads(pickle.dumps(refused.value)).holder == refused.value.holder
            assert watcher.role == 'watch' and watcher.next_state()
            driver.release_control()
            watcher.take_control()
            watcher.wait_active()
        with pytest.raises(r4link.UsageError) as wrong:
            driver.arm()
        assert wrong.value.holder is None


def test_records_states_and_replays_them(sim, tmp_path):
    path = tmp_path / 'drive.r4log.zst'
    with r4link.Board(sim.url, arming=False) as board:
        board.record(path)
        board.wait_active()
        board.osmc(1).set_pwm(358)
        board.next_state()
        statistics, counters = board.statistics.as_dict(), board.carrier_counters
        assert statistics['states'] > 0 and statistics['lost'] == 0 and counters.rx_datagrams >= statistics['received']
        assert board.identify().board_id == 'sim-1'
    with r4link.Board(f'replay:{path}', role='watch') as again:
        assert any(state.osmc1.pwm == 358 for state in again.states(most=100))
    with r4link.Recording(tmp_path / 'two.r4log', rotate_bytes=1 << 20) as log:
        other = r4link.SimBoard()
        with r4link.Board(sim.url) as one, r4link.Board(other.url) as two:
            for each in (one, two):
                each.record(log)
                each.wait_active()
            assert log.records > 2 and log.dropped == 0 and log.problem is None
    assert len(r4link.read(tmp_path / 'two-00001.r4log').boards) == 2
    with pytest.raises(r4link.UsageError):
        r4link.Recording(tmp_path / 'x.r4log', keep_bytes=1)


KEY = '1:' + '5a' * 32


def test_a_board_with_a_key_obeys_only_a_host_with_the_key(tmp_path, wait):
    path = tmp_path / 'key'
    path.write_text(KEY + '\n')
    path.chmod(0o600)
    with r4link.SimBoard('udp://127.0.0.1:0', settings={'key': KEY}) as sim:
        with r4link.Board(sim.url) as stranger:
            wait(lambda: stranger.link.cause == 'key needed')
            with pytest.raises(r4link.RefusedError, match='key'):
                stranger.wait_active(0.01)
        with r4link.Board(sim.url, key=path) as board:
            board.wait_active()
            board.arm()
            board.osmc(1).set_pwm(358)
            assert board.link.causes == () and board.link.cause is None
            wait(lambda: sim.look().osmc[0].pwm == 358)
        path.write_text(KEY.replace('5a', '5b') + '\n')
        with r4link.Board(sim.url, key=path) as wrong:
            wait(lambda: wrong.link.causes == ('key not taken',))
        assert sim.look().is_safe


def test_a_simulated_bad_link_loses_datagrams(sim):
    url = r4link.with_link(sim.url, 'loss=20%,seed=7')
    assert url == sim.url
    with r4link.Board(url) as board:
        board.wait_active()
        for _ in range(50):
            board.next_state()
        assert 0.05 < board.statistics.loss < 0.5
    with pytest.raises(r4link.UsageError, match='lost'):
        r4link.with_link(sim.url, 'lost=5%')


def test_a_program_sets_rate_link_timing_and_proximity(sim, board, wait):
    board.setting('rate', '200')
    wait(lambda: (board.next_state().t_ms - board.state.t_ms) % 5 == 0 and
         {b.t_ms - a.t_ms for a, b in pairs(board, 4)} == {5})
    with pytest.raises(r4link.UsageError):
        board.setting('rate', 'fast')
    with pytest.raises(r4link.UsageError):
        board.link_timing(0.3, 0.4)
    board.link_timing(0.4, 0.1)
    board.arm()
    board.watchdog(0.02)
    silent = time.monotonic()
    wait(lambda: sim.look().is_safe)
    assert time.monotonic() - silent < within(0.95), 'later than the timeout that was set'
    board.watchdog(0)
    board.wait_active()
    board.proximity(1, cm=30)
    sim.obstacle(1, 15)
    wait(lambda: board.link.reason == 'proximity')


def pairs(board, count):
    states = board.states(100)
    numbers = [next(states) for _ in range(count + 1)]
    return zip(numbers, numbers[1:])


def test_stop_async_stops_the_board_and_a_restart_is_reported(sim, board, wait):
    restarts = []
    board.on_restart(lambda: restarts.append(True))
    board.arm()
    board.osmc(1).set(0.1)
    board.stop_async()
    wait(lambda: board.link.reason == 'stop' and sim.look().is_safe)
    sim.reboot()
    wait(lambda: restarts)


def test_statistics_count_packets(board):
    board.next_state()
    statistics = board.statistics
    assert statistics.packets_received >= statistics.states > 0 and statistics.old <= statistics.received
