# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: r4 against the host and the board of can_python.py."""
import contextlib
import socket
import struct
import subprocess
import sys
import time

import pytest

import can_python
import packed_form
from paper_client import PaperClient
from r4_process import PATIENCE_S, Board, is_state, monitor, objects, run, send

BOARD_URL, HOST_URL = 'can://vcan0?node=3', 'can://vcan0?node=4'
# In the emulated machine Python needs half a millisecond for a frame. The machine sometimes pauses for a second.
PATIENTLY = ('--set', 'rate,20', '--set', 'timeout,5000')


@pytest.fixture(scope='module', autouse=True)
def threads_that_take_turns_often():
    usual = sys.getswitchinterval()
    sys.setswitchinterval(0.0005)
    yield
    sys.setswitchinterval(usual)


@contextlib.contextmanager
def recording(path):
    """Records vcan0 with candump -L, from before the block until after the block."""
    with open(path, 'w', encoding='ascii') as file, \
            subprocess.Popen(['candump', '-L', 'vcan0'], stdout=file) as process:
        try:
            yield
        finally:
            process.terminate()


@contextlib.contextmanager
def python_host(**options):
    host = can_python.Host('vcan0', 3, **options)
    try:
        yield host
    finally:
        host.close()


@pytest.fixture(name='board')
def running_board():
    with Board(BOARD_URL, options=PATIENTLY) as board:
        yield board


# --- python is the host, r4 sim is the board

@pytest.mark.parametrize('packs', [True, False])
def test_a_python_host_drives_the_board_and_reads_its_state(board, tmp_path, packs):
    with recording(tmp_path / 'bus.log'), python_host(packs=packs) as host:
        host.beats = False
        host.next(lambda fields: 'H' in fields)
        assert host.heard[-1][0] == 'H:R4-ROS2;PNum:0;T:0;^0xb10b3a06^'
        assert not host.heard[-1][2], 'a board without a host sends text, which every host can read'
        host.beats = True
        host.take_control()
        in_control = len(host.heard)
        assert host.command('O:358,1,1') == 'done'
        state = host.next(lambda fields: 'OSMC1' in fields)
        assert (state['OSMC1'], state['SAFE'], state['DMHSTA']) == ('358,1', '0', '1')
        heard = [text for text, _, _ in host.heard]
        assert {packed for _, _, packed in host.heard[in_control:]} == {packs}
    board.outputs(lambda outputs: outputs['osmc'][0] == [358, 1])
    executed = [each['executed']['command'] for each in board.log if 'executed' in each]
    assert executed == ['F:DEFAULT,SAFE,CMD', 'O:358,1,1']
    # r4 decodes the recording of candump to the same datagrams. (candump may have begun within a datagram.)
    *decoded, summary = objects(run('decode', '--candump', str(tmp_path / 'bus.log'), timeout=60).stdout)
    assert summary['damaged_lines'] == 0 and summary['bad'] == 0 and summary['other'] == 0
    of_board = {each['text'] for each in decoded if each.get('from') == 'board' and 'text' in each}
    missing = [text for text in heard if text not in of_board]
    assert len(heard) > 5 and len(missing) <= 1, missing
    assert [each['fields']['O'] for each in decoded if 'O' in each.get('fields', {})][:1] == [[358, 1, 1]]


def test_refusals_use_the_reply_lane_and_a_duplicate_is_not_executed(board):
    with python_host() as host:
        host.take_control()
        assert host.command('O:358,1,9') == 'CHANNEL'
        assert host.command('O:5000,1,1') == 'RANGE'
        assert host.command('X:1') == 'UNKNOWN'
        assert host.command('O:100,1,1') == 'done'
        answer = host.next(lambda fields: 'N' in fields, retry=host.newest_command)
        assert answer['N'].endswith(',DUPLICATE') and answer['N'].partition(',')[0] in host.newest_command
    board.outputs(lambda outputs: outputs['osmc'][0] == [100, 1])
    assert sum('executed' in each and each['executed']['command'] == 'O:100,1,1' for each in board.log) == 1


def test_the_board_obeys_the_flow_control_of_the_host(board):
    with python_host(block_size=2, stmin=3) as host:
        host.take_control()
        asked, replies = time.monotonic(), host.receivers[0x203]
        _, question = host.send('Q:ID')
        assert host.next(lambda fields: 'I' in fields, retry=question)['I'].startswith('R4,')
        text, _, packed = host.heard[-1]
        assert packed
        frames = -(-(len(packed_form.pack(text)) - 6) // 7)  # the gap is between the frames of each pair
        assert frames >= 3
        assert time.monotonic() - asked >= frames // 2 * 0.003
        assert replies.answered >= -(-frames // 2)
        assert host.command('O:358,1,9') == 'CHANNEL'


def test_an_emergency_frame_stops_the_board_until_it_is_cleared(board):
    with python_host() as host:
        host.take_control()
        assert host.command('O:358,1,1') == 'done'
        host.stop()
        assert host.next(lambda fields: fields.get('H') and fields.get('SAFE'))['SAFE'] == '2'
        assert [reason for _, reason in host.went_safe] == [2]
        state = host.next(lambda fields: 'OSMC1' in fields)
        assert (state['SAFE'], state['OSMC1']) == ('2', '0,0')
        assert host.command('O:358,1,1') == 'SAFE'
        host.next(lambda fields: 'H' in fields)
        assert host.command(f'E:CLEAR,{host.cause}') == 'done'
        assert host.command('O:200,0,1') == 'done'
    board.state('SAFE', 'stop')
    board.outputs(lambda outputs: outputs['osmc'][0] == [200, 0])


def test_the_board_is_safe_while_the_host_is_silent(board):
    with python_host() as host:
        host.take_control()
        assert host.command('C:timeout,1000') == 'done'
        silent, host.beats = time.monotonic(), False
        host.run_until(lambda: host.went_safe, timeout=PATIENCE_S)
        at, reason = host.went_safe[0]
        print(f'silence to the went-safe frame {(at - silent) * 1000:.0f} ms')
        assert reason == 1 and 0.85 <= at - silent
        assert host.next(lambda fields: 'H' in fields)['SAFE'] == '1'
        assert not host.heard[-1][2], 'the board sends text, because a new host may not know the packed form'
        host.beats = True
        assert host.next(lambda fields: 'OSMC1' in fields)['SAFE'] == '0'
        assert host.heard[-1][2]
    assert board.state('SAFE', 'link')['silence'] >= 1000


def kernel_isotp(hears, own, flags=0):
    """A socket of the kernel's ISO-TP."""
    isotp, options, classic = 106, 1, struct.pack('=IIBBBB', flags, 0, 0, 0, 0, 0)
    peer = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_ISOTP)
    peer.setsockopt(isotp, options, classic)
    peer.bind(('vcan0', hears, own))
    peer.settimeout(PATIENCE_S)
    return peer


def test_the_papers_client_drives_a_board_over_the_kernels_iso_tp():
    # The rate is low, because for each datagram the client sends seven commands, which take the emulated machine long.
    options, listen_mode, states = ('--set', 'rate,2', '--set', 'timeout,5000'), 1, 6
    with Board(BOARD_URL, options=options) as board, \
            contextlib.closing(kernel_isotp(0x403, 0x7FF, listen_mode)) as telemetry, \
            contextlib.closing(kernel_isotp(0x203, 0x183)) as dialogue:
        client = PaperClient(dialogue.send)
        while len(client.states) < states:
            client.take(telemetry.recv(1024))
        log = board.rest()
    active = [each for each in log if each.get('state') == 'ACTIVE']
    assert active and not any(each.get('state') == 'SAFE' for each in log)
    assert ';DHB1A:1000,1;' in client.states[-1] and ';SERVO1POS:300;' in client.states[-1]
    outputs = [each['outputs'] for each in active if 'outputs' in each][-1]
    assert outputs['dhb'] == [[1000, 1], [1000, 0], [1000, 1], [1000, 0]]


@pytest.mark.parametrize('packs', [True, False])
def test_the_board_answers_an_fd_host_in_fd(tmp_path, packs):
    with recording(tmp_path / 'bus.log'), Board(BOARD_URL + '&fd=1', options=PATIENTLY) as board, \
            python_host(fd=True, packs=packs) as host:
        host.take_control()
        assert host.command('O:358,1,1') == 'done'
        assert host.command('O:358,1,9') == 'CHANNEL'
        host.fd = False
        assert host.command('O:359,1,1') == 'done'
        board.executed('O:359,1,1')
    assert ' 403##' in (tmp_path / 'bus.log').read_text()


# --- python is the board, r4 is the host

def test_monitor_shows_the_states_of_a_python_board():
    with can_python.Board('vcan0', 4) as board, monitor(HOST_URL) as host:
        host.next(lambda each: each['type'] == 'link' and each['fields']['state'] == 'active')
        state = host.next(lambda each: is_state(each) and 'CMD' in each['fields'])
        assert state['fields']['AIN24'] == 24.1 and state['transport'] == HOST_URL
        times = [host.next(is_state)['t'] for _ in range(20)]
        assert times == sorted(set(times))
        assert host.end() == 0
    assert set(board.executed) == {'F:DEFAULT,SAFE,CMD'} and board.stops == 0


@pytest.mark.parametrize('options, url', [
    ({}, HOST_URL), ({}, HOST_URL + '&pack=0'), ({'packs': False}, HOST_URL), ({'fd': True}, HOST_URL + '&fd=1')])
def test_send_is_confirmed_by_a_python_board(options, url):
    with can_python.Board('vcan0', 4, **options) as board:
        result = send(url, 'O:358,1,1', 'Q:ID')
    assert set(board.heard_packed) == {'pack=0' not in url}
    assert result.returncode == 0 and 'second' in result.stdout, result
    # If the board's states are late, the host may request the fields again.
    assert board.executed[0] == 'F:DEFAULT,RELAYS,SAFE,CMD'
    assert [each for each in board.executed if not each.startswith('F:')] == ['O:358,1,1']


def test_send_reports_a_refusal_of_a_python_board():
    with can_python.Board('vcan0', 4, refuses='S') as board:
        result = send(HOST_URL, 'S:1500,1')
    assert result.returncode == 3 and 'RANGE' in result.stderr, result
    assert board.executed == ['F:DEFAULT,SAFE,CMD']


def test_stop_sends_the_emergency_frame_and_waits_for_confirmation():
    with can_python.Board('vcan0', 4) as board, monitor(HOST_URL) as host:
        host.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 0)
        result = run('stop', HOST_URL, timeout=60)
        assert result.returncode == 0 and 'SAFE (stop)' in result.stdout, result
        host.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 2)
    assert board.stops >= 1 and board.osmc == '0,0'
