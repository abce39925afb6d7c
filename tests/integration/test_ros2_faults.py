# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills, pauses or delays r4 ros2 or another participant in its graph."""
import signal
import time

from machine import within
from r4_process import Board, again, lasts
from ros2_peer import (DIAGNOSTICS, FLOAT32, STRING, Peer, Ros2, armed, drive, float32, health_of, join,
                       own_domain, pwm, text)
from host_on_paths import Relay, has_joined, has_left


def test_outputs_go_off_when_the_node_is_killed_and_it_can_restart():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer:
        with Ros2(domain, board.host_url, '--arm') as ros2:
            ros2.armed()
            join(ros2, peer, 'osmc1/command', FLOAT32)
            drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
            killed = ros2.signal(signal.SIGKILL)
            off = board.outputs(lambda each: pwm(each, 1) == 0)
            assert off['came'] - killed < within(1.1)  # the board's timeout
        board.state('SAFE', 'link')
        with Ros2(domain, board.host_url, '--arm') as ros2:
            ros2.logged_both('armed', 'osmc1/command: 1 publishers')
            drive(board, peer, 'rt/osmc1/command', float32(0.25), lambda each: pwm(each, 1) == 1024)
            assert ros2.end() == 0, ros2.errors
        peer.end()


def test_outputs_of_a_killed_publisher_go_off_after_the_deadline():
    with armed('--deadline', '0.5') as (board, ros2, peer), Peer(ros2.domain) as other:
        join(ros2, other, 'osmc1/command', FLOAT32)
        drive(board, other, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
        killed = time.monotonic()
        other.process.kill()
        off = board.outputs(lambda each: pwm(each, 1) == 0)
        assert off['came'] - killed < within(0.6)
        join(ros2, peer, 'osmc2/command', FLOAT32)
        drive(board, peer, 'rt/osmc2/command', float32(0.5), lambda each: pwm(each, 2) == 2048)


def test_a_suspended_subscriber_does_not_delay_other_subscribers():
    with armed() as (board, ros2, peer), Peer(ros2.domain) as other:
        for each in (peer, other):
            each.read('rt/R4', STRING)
            each.sample('rt/R4')
        other.process.send_signal(signal.SIGSTOP)
        board.skip_past()
        for _ in range(200):
            peer.sample('rt/R4')
        came = [peer.sample('rt/R4').came for _ in range(200)]  # 100 states a second and the heartbeats
        assert came[-1] - came[0] < within(2.2)
        join(ros2, peer, 'osmc1/command', FLOAT32)
        drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
        assert not any(each.get('state') == 'SAFE' for each in board.log)


def test_a_delayed_command_is_not_executed():
    with armed() as (board, ros2, peer):
        peer.read('rt/diagnostics', DIAGNOSTICS)
        join(ros2, peer, 'osmc1/command', FLOAT32)
        drive(board, peer, 'rt/osmc1/command', float32(0.125), lambda each: pwm(each, 1) == 512)
        ros2.signal(signal.SIGSTOP)
        peer.write('rt/osmc1/command', float32(0.5))
        peer.next(lambda each: each['type'] == 'written')
        lasts(0.3)  # shorter than the board's timeout
        ros2.signal(signal.SIGCONT)
        peer.sample('rt/diagnostics', lambda payload: int(health_of(payload)[-1]['commands too old']) > 0)
        drive(board, peer, 'rt/osmc1/command', float32(0.25), lambda each: pwm(each, 1) == 1024)
        assert not any(pwm(each['outputs'], 1) == 2048 for each in board.log if 'outputs' in each)
        assert not any(each.get('state') == 'SAFE' for each in board.log)


def test_the_drive_continues_when_one_of_two_paths_is_unplugged():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer:
        port = board.url.rsplit(':', 1)[1]
        paths = [Relay('udp', port), Relay('udp', port)]
        with Ros2(domain, '+'.join(path.url for path in paths), '--arm') as ros2:
            ros2.armed()
            board.next(has_joined(2))
            join(ros2, peer, 'osmc1/command', FLOAT32)
            drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
            paths[0].pull()
            board.next(has_left(1))
            drive(board, peer, 'rt/osmc1/command', float32(0.25), lambda each: pwm(each, 1) == 1024)
            assert not any(each.get('state') == 'SAFE' and each['reason'] == 'link' for each in board.log)
            assert ros2.end() == 0, ros2.errors
        paths[1].pull()
        peer.end()


def test_diagnostics_report_the_cause_of_a_safe_state_at_once():
    with armed() as (board, ros2, peer):
        peer.read('rt/diagnostics', DIAGNOSTICS)
        peer.sample('rt/diagnostics', lambda payload: health_of(payload)[0] == 0)
        join(ros2, peer, 'R4_Command', STRING)
        drive(board, peer, 'rt/R4_Command', text('O:358,1,1'), lambda each: pwm(each, 1) == 358)
        peer.write('rt/R4_Command', text('E:STOP'))
        stopped = ros2.logged('E:STOP: confirmed')['came']

        def is_error(payload):
            level, _, _, _, values = health_of(payload)
            return level == 2 and values['safe reason'] == 'stop'
        told = peer.sample('rt/diagnostics', is_error)
        assert told.came - stopped < within(0.2)
        again(lambda: peer.write('rt/R4_Command', text('E:CLEAR')),
              lambda timeout: peer.sample('rt/diagnostics', lambda payload: health_of(payload)[0] == 1, timeout))


def test_a_url_pattern_gives_each_board_its_own_namespace():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as left, Board('udp://127.0.0.1:0') as right, Peer(domain) as peer:
        ports = [board.url.rpartition(':')[2] for board in (left, right)]
        with Ros2(domain, 'udp://127.0.0.1:{%s,%s}?listen=0' % tuple(ports), '--arm') as ros2:
            assert [node['name'] for node in ros2.ready['nodes']] == [f'/board{port}/r4' for port in ports]
            for _ in ports:
                ros2.armed()
            peer.writer(f'rt/board{ports[1]}/osmc1/command', FLOAT32)
            ros2.logged('osmc1/command: 1 publishers')
            drive(right, peer, f'rt/board{ports[1]}/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
            assert ros2.end() == 0, ros2.errors
        left.state('SAFE', 'link')
        assert not any(pwm(each['outputs'], 1) for each in left.log if 'outputs' in each)
        peer.end()
