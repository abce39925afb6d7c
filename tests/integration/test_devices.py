# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices on the user's I2C bus: r4 send and r4 monitor against the simulated board, as docs/how-to/devices.md shows them."""

import pytest

from machine import within_ms
from r4_process import Board, Running, is_state, objects, run


@pytest.fixture(name='board')
def a_simulated_board():
    with Board('udp://127.0.0.1:0') as board:
        yield board


def test_send_scans_reads_and_writes_the_i2c_bus(board):
    result = run('send', board.host_url, 'X:SCAN', 'X:READ,0x68,x75,1', 'X:WRITE,0x68,x6b00', 'X:READ,0x40,x00,2')
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert [lines[1], lines[3], lines[6]] == ['  0x40 0x68', '  x68', '  x399f']
    missing = run('send', board.host_url, 'X:READ,0x50,x00,1')
    assert missing.returncode == 3 and 'no acknowledge; send X:SCAN to see which addresses answer' in missing.stderr
    answer = objects(run('send', board.host_url, 'X:READ,0x50,x00,1', '--json').stdout)[0]
    assert (answer['confirmed'], answer['transfer'], answer['bytes']) == (False, 'no acknowledge', 'x')


def test_states_contain_polled_readings_until_the_session_ends(board):
    commands = ['X:WRITE,0x68,x6b00', 'X:POLL,0x68,x3b,14,10,1', 'X:POLL,0x40,x02,2,50,2', 'F:I2C1,I2C2,I2CBUS']
    with Running('send', board.host_url, *commands, '--hold', '30', '--json') as host:
        for _ in commands:
            assert host.next()['confirmed']
        with Running('monitor', board.host_url, '--json') as watch:
            states = [watch.next(is_state) for _ in range(30)]
    newest = states[-1]['fields']
    assert newest['I2C1'][2] == 'x000000004000f0b0000000000000'
    assert newest['I2C2'][2] == 'x5f02' and newest['I2CBUS'] == [0, 0, 0]
    assert sorted(each['t'] - each['fields']['I2C1'][0] for each in states)[-3] <= within_ms(20)
    steps = [after['t'] - before['t'] for before, after in zip(states, states[1:])]
    # On a busy machine the board leaves states out, which shows in T.
    assert all(step % 10 == 0 for step in steps) and sum(steps) <= within_ms(11 * len(steps)), steps
    after = objects(run('send', board.host_url, 'F:I2C1', '--json', '--hold', '0.1').stdout)
    assert after[0]['confirmed']


def test_states_report_uart_bytes_voltages_and_inputs(board):
    commands = ['C:uart1,115200:8N1', 'F:UART1,DAC1,DAC2,GPIO', 'X:DAC,1,5', 'X:DAC,1,1650;S:1500,3;X:DAC,2,3300',
                'X:UART,1,x2450']
    with Running('send', board.host_url, *commands, '--hold', '30', '--json') as host:
        for _ in commands:
            assert host.next()['confirmed']
        with Running('monitor', board.host_url, '--json') as watch:
            states = [watch.next(is_state) for _ in range(40)]
    assert [states[-1]['fields'][name] for name in ('DAC1', 'DAC2', 'GPIO')] == [1650, 3300, 255]
    text, position = b'', None
    for earlier, each in zip([states[0], *states], states):
        begin, _, data = each['fields']['UART1']
        data = bytes.fromhex(data[1:])
        position = begin if position is None else position
        missed = each['pnum'] - earlier['pnum'] > 1  # the monitor has lost states, because the machine stood still
        assert missed or begin <= position
        text += data[position - begin:]
        position = begin + len(data)
    assert b'$GPRMC,' in text
    off = run('send', board.host_url, 'X:UART,2,x24')
    assert off.returncode == 3 and 'CHANNEL' in off.stderr or 'channel' in off.stderr, off.stderr
    assert 'use X:UART,uart,bytes' in run('send', board.host_url, 'X:UART,1').stderr
    assert 'C:uart1,115200:8N1' in run('send', '--help').stdout


def test_a_stuck_i2c_bus_does_not_block_other_commands(tmp_path):
    scenario = tmp_path / 'held.txt'
    scenario.write_text('0 userbus held\n')
    with Board('udp://127.0.0.1:0', options=('--script', str(scenario))) as board:
        stuck = run('send', board.host_url, 'X:READ,0x68,x75,1', 'R:1,On')
        assert stuck.returncode == 3 and 'bus stuck; find the device that holds SDA or SCL' in stuck.stderr
        assert run('send', board.host_url, 'R:1,On', 'O:358,1,1').returncode == 0
        assert run('stop', board.host_url).returncode == 0
