# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: a board and hosts on a bus with bit time and errors.

slcan0 (the board's controller) and slcan1 (the host's controller) are nodes of slcan_bus. Error frames, error
counters, bus-off and the states that the kernel reports are those of ISO 11898-1.
"""
import os
import pathlib
import pty
import re
import subprocess
import time

import pytest

from can_inside import PATIENTLY, SLOWLY, Dump, in_control
from r4_process import PATIENCE_S, Board, Running, driving, is_link, is_state, lasts, monitor, objects, run, send
from slcan_bus import BITRATE, SlcanBus

BOARD, HOST = 'can://slcan0?node=1', 'can://slcan1?node=1'
STOP, COMMAND, TELEMETRY, FLOOD = 0x010, 0x181, 0x401, 0x7FF
OF_HOST = (STOP, COMMAND, FLOOD)
DRIVING, OFF = [358, 1], [0, 0]


@pytest.fixture(name='bus')
def running_bus():
    with SlcanBus() as bus:
        yield bus


@pytest.fixture(name='board')
def running_board(bus):
    assert bus.interfaces == ['slcan0', 'slcan1']
    with Board(BOARD, options=SLOWLY) as board:
        yield board


def driving_host(board):
    """A host that runs a motor and stays connected."""
    host = driving(HOST, 'O:358,1,1')
    board.outputs(lambda outputs: outputs['osmc'][0] == DRIVING)
    return host


def told(reason):
    """Matches a host's error event that has the reason and a fix."""
    return lambda each: each['type'] == 'error' and reason in each['fields'].get('reason', '')


def board_told(reason):
    return lambda each: reason in each.get('transport', {}).get('reason', '')


def streams_again(host, since):
    host.skip_past()
    state = host.next(is_state)
    print(f'streams again after {(state["came"] - since) * 1000:.0f} ms')


def test_the_reported_load_equals_the_busy_time_of_the_bus(bus, board):
    result = send(HOST, 'O:358,1,1', 'S:1500,16', 'Q:ID')
    assert result.returncode == 0, result
    with monitor(HOST) as host:
        in_control(host)
        before = bus.status()
        *_, shown = objects(run('bus', 'can://slcan1', '--json', '--duration', '2', timeout=60).stdout)
        after = bus.status()
    busy_us, frames = (after[each] - before[each] for each in ('busy_us', 'frames'))
    print(f'a frame {1e6 * shown["load"] / shown["frames"]:.2f} us, by the bus {busy_us / frames:.2f} us')
    assert shown['bitrate'] == BITRATE  # read from the controller, because no option gives the bit rate
    assert after['failed'] == 0
    assert abs(1e6 * shown['load'] / shown['frames'] / (busy_us / frames) - 1) < 0.01


def test_r4_bus_asks_for_a_bit_rate_that_the_adapter_does_not_report():
    """Like slcand, which sets the bit rate only in the adapter, the test reports no bit rate to the kernel."""
    near, far = pty.openpty()
    try:
        name = SlcanBus.attach(os.ttyname(far))
        subprocess.run(['ip', 'link', 'set', name, 'up'], check=True)
        guessed = run('bus', f'can://{name}', '--duration', '0.2', timeout=60)
        given = run('bus', f'can://{name}', '--duration', '0.2', '--bitrate', '500000', timeout=60)
        listed = run('list', timeout=60)
    finally:
        os.close(near)
        os.close(far)
    assert guessed.returncode == 0 and '1000 kbit/s' in guessed.stdout, guessed
    assert re.fullmatch('r4: warning: .* does not report its bit rate, .*; add --bitrate\n', guessed.stderr), guessed
    assert given.returncode == 0 and given.stderr == '' and '500 kbit/s' in given.stdout, given
    assert re.search(f'{name} .* no bit rate', listed.stdout) and listed.stderr == '', listed


def test_a_host_reports_a_controller_that_is_already_bus_off(bus):
    bus.order('spoil', 1)
    subprocess.run(['cansend', 'slcan1', f'{FLOOD:X}#00'], check=True)
    bus.state(1, 'bus-off')
    with monitor(HOST) as host:
        down = host.next(told('bus-off'))
    assert 'ip link set slcan1' in down['fields']['fix'], down


def test_a_board_reports_bus_off_goes_safe_at_once_and_recovers(bus):
    with Board(BOARD, options=PATIENTLY) as board, driving_host(board):
        bus.order('spoil', 0)
        off = bus.state(0, 'bus-off')
        down = board.next(board_told('bus-off'))
        assert down['transport']['event'] == 'down' and 'ip link set slcan0' in down['transport']['fix']
        print(f'told {(down["came"] - off["came"]) * 1000:.1f} ms after it')
        board.outputs(lambda outputs: outputs['osmc'][0] == OFF)
        assert board.state('SAFE', 'link')['silence'] < 5000, 'the safe state came only with the timeout'
        bus.order('heal', 0)
        since = time.monotonic()
        bus.reset(0)
        back = board.outputs(lambda outputs: outputs['osmc'][0] == DRIVING)
        print(f'drives again after {(back["came"] - since) * 1000:.0f} ms')


def test_a_host_reports_its_bus_off_and_recovers_by_itself(bus, board):
    with monitor(HOST) as host:
        in_control(host)
        bus.order('spoil', 1)
        down = host.next(told('bus-off'))
        assert 'ip link set slcan1' in down['fields']['fix']
        assert not host.next(lambda each: each['type'] == 'link')['fields']['up']
        board.state('SAFE', 'link')
        bus.order('heal', 1)
        since = time.monotonic()
        bus.reset(1)
        assert host.next(is_link('active'))['fields']['up']
        streams_again(host, since)


def test_board_and_host_report_bus_errors_and_their_end(bus):
    with Board(BOARD, options=PATIENTLY) as board, monitor(HOST) as host:
        in_control(host)
        for node, where, end in ((0, board_told, board), (1, told, host)):
            for errors, reason in ((100, 'warns of errors'), (130, 'error-passive')):
                bus.order('errors', node, errors, 0)
                each = end.next(where(reason))
                assert 'wiring' in str(each)
            end.next(where('the errors have stopped'))  # each frame without an error lowers the error counter by one
        streams_again(host, time.monotonic())
    assert not any(each.get('state') == 'SAFE' and each['reason'] == 'link' for each in board.log)


def test_a_host_alone_on_the_bus_reports_missing_acknowledgements(bus, board):
    with monitor(HOST) as host:
        in_control(host)
        bus.order('away', 0)
        lonely = host.next(told('no node acknowledges'))
        assert 'bit rate' in lonely['fields']['fix']
        bus.state(1, 'passive')  # never bus-off: ISO 11898-1, 12.1.4.2
        board.state('SAFE', 'link')
        bus.order('back', 0)
        since = time.monotonic()
        board.state('ACTIVE')
        streams_again(host, since)
        assert bus.status()['nodes'][1]['state'] != 'b'


def test_a_full_queue_drops_old_states_but_damages_no_datagram():
    with SlcanBus(txqueuelen=10) as bus, Board(BOARD) as board, monitor(HOST) as host:
        in_control(host)
        # Another program keeps the queue of the board's interface full.
        flood = subprocess.Popen(['cangen', 'slcan0', '-g', '0', '-i', '-I', f'{FLOOD:X}', '-L', '8'])
        try:
            for _ in range(10):
                bus.order('stall', 0)
                lasts(0.05)
                bus.order('go', 0)
                host.next(is_state)
        finally:
            flood.terminate()
            flood.wait()
        bus.order('stall', 0)
        lasts(0.3)
        host.skip_past()
        bus.order('go', 0)
        since = time.monotonic()
        states = [host.next(is_state) for _ in range(20)]
        streams_again(host, since)
        log = list(host.log)
    gaps = [(later['t'] - earlier['t']) for earlier, later in zip(states, states[1:])]
    print(f'gaps after the stall: {gaps} ms')
    assert sorted(gaps)[len(gaps) // 4] <= 20, 'each transfer waits for the next event'
    pnums = [each['pnum'] for each in log if each['type'] == 'state']
    assert pnums == sorted(set(pnums))
    damaged = [each for each in log if each['type'] == 'error' and each['fields']['error'] != 'transport']
    assert not damaged, damaged


def wait_for_sockets(interface, identifier, count):
    """Waits until `count` sockets receive the id on the interface."""
    entry = re.compile(rf'^\s*{interface}\s+{identifier:x}\s', re.MULTILINE)
    deadline = time.monotonic() + PATIENCE_S
    while len(entry.findall(pathlib.Path('/proc/net/can/rcvlist_sff').read_text(encoding='ascii'))) < count:
        assert time.monotonic() < deadline, f'fewer than {count} sockets hear {identifier:x} on {interface}'
        lasts(0.05)


def test_a_stop_overtakes_a_full_queue():
    with SlcanBus(txqueuelen=10) as bus, Board(BOARD) as board, Dump('slcan0') as dump:
        with driving_host(board):
            bus.order('stall', 1)
            flood = subprocess.Popen(['cangen', 'slcan1', '-g', '0', '-i', '-I', f'{FLOOD:X}', '-L', '8'])
            stop = Running('stop', HOST, '--timeout', '20')
            wait_for_sockets('slcan1', TELEMETRY, 2)  # the sockets of the driving host and of r4 stop
            lasts(0.3)
            went_on = time.time()
            bus.order('go', 1)
            since = time.monotonic()
            stopped = board.state('SAFE', 'stop')
            print(f'stopped {(stopped["came"] - since) * 1000:.1f} ms after the bus went on')
            assert stop.wait(30) == 0, stop.errors
            flood.terminate()
            flood.wait()
            stop.process.stdout.close()
            stop.process.stderr.close()
        ids = [frame for at, (frame, _) in zip(dump.times, dump.frames) if at > went_on and frame in OF_HOST]
        print(f'{ids.index(STOP)} frames before the stop')
        assert ids.index(STOP) <= 4, ids  # the frames in three mailboxes and in the driver are sent first
