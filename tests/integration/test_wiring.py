# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 wiring, and boards whose wiring differs from the plan."""
import re
import subprocess

import pytest

from every_channel import channels
from r4_process import ERROR, Board, Running, is_state, monitor, objects, run, watch

# Thirty places that differ from the plan: pins, chips, lines, forms and levels.
OTHER = {
    'chip osmc': '0x44', 'chip servo': '0x43', 'chip expander': '0x21', 'chip dac': '0x60',
    'handle': 'D53 low',
    'stepper 1 step': 'D47', 'stepper 1 direction': 'D34 inverted', 'stepper 3 direction': 'D49', 'stepper 4 step': 'D13',
    'encoder 1 a': 'D27', 'encoder 1 b': 'D25', 'encoder 2 index': 'D48',
    'ultrasonic 2 trigger': 'D51', 'ultrasonic 3 echo': 'D74',
    'analog 1': 'A6', 'analog 5': 'A0', 'input 1': 'D62', 'input 8': 'D5',
    'osmc 1 pwm': 'osmc.8 two-pwm', 'osmc 1 direction': 'osmc.15',
    'osmc 2 pwm': 'osmc.3', 'osmc 2 direction': 'osmc.2 inverted',
    'dhb12 4 pwm': 'osmc.10', 'dhb12 4 direction': 'osmc.11',
    'servo 1': 'servo.15', 'servo 16': 'servo.0',
    'bldc 1 speed': 'VOUTD', 'bldc 4 speed': 'VOUTA', 'bldc 2 brake': 'GPB7 inverted',
    'relay 1': 'GPB0 inverted', 'relay 8': 'GPA3',
}


def other_wiring():
    text = run('wiring', 'template').stdout
    for signal, place in OTHER.items():
        text, count = re.subn(rf'^{signal} = [^#\n]*?(?=  #|$)', f'{signal} = {place}', text, flags=re.MULTILINE)
        assert count == 1, signal
    return text


@pytest.fixture(name='other')
def file_of_another_wiring(tmp_path):
    path = tmp_path / 'other.wiring'
    path.write_text(other_wiring())
    return str(path)


def test_a_template_is_the_plan(tmp_path):
    path = tmp_path / 'plan.wiring'
    path.write_text(run('wiring', 'template').stdout)
    assert run('wiring', 'check', str(path)).stdout == (
        f'{path}: a valid wiring: 101 of 101 signals are connected, 101 as in the plan\n')
    same = run('wiring', 'diff', 'plan', str(path))
    assert (same.returncode, same.stdout) == (0, '')


def test_a_check_counts_and_diff_names_each_difference(other):
    assert objects(run('wiring', 'check', other, '--json').stdout) == [
        {'type': 'wiring', 'file': other, 'signals': 101, 'connected': 101, 'as_planned': 101 - len(OTHER)}]
    result = run('wiring', 'diff', 'plan', other, '--json')
    assert result.returncode == 1
    assert {each['signal']: each['b'] for each in objects(result.stdout)} == OTHER
    assert 'handle: D42 -> D53 low\n' in run('wiring', 'diff', 'plan', other).stdout


def test_a_fault_is_reported_with_its_line(tmp_path):
    path = tmp_path / 'bad.wiring'
    path.write_text(run('wiring', 'template').stdout.replace('handle = D42', 'handle = D20'))
    line = path.read_text()[:path.read_text().index('handle = ')].count('\n') + 1
    result = run('wiring', 'check', str(path))
    assert result.returncode == 1 and ERROR.search(result.stderr)
    assert result.stderr == f'r4: {path}:{line}: handle: D20 belongs to an I2C bus; choose another pin\n'


@pytest.mark.parametrize('arguments, code', [
    ([], 2), (['check'], 2), (['look', 'x'], 2), (['check', 'a', 'b'], 2), (['template', 'a'], 2), (['diff', 'a'], 2),
    (['give', 'a'], 2), (['show'], 2), (['confirm', 'sim:', 'b'], 2), (['check', '/nowhere'], 4),
    (['check', '/dev/null'], 1), (['diff', 'plan', '/dev/zero'], 1)])
def test_a_wrong_use_says_what_is_right(arguments, code):
    result = run('wiring', *arguments)
    assert (result.returncode, result.stdout) == (code, '') and ERROR.search(result.stderr), result.stderr


def check_outputs(board):
    """Asserts that each command sets its output."""
    table = channels(50)
    with Running('send', board.host_url, *(command for command, *_ in table), '--hold', '120', '--json') as host:
        for command, is_so, *_ in table:
            assert host.next()['confirmed'], command
            board.next(lambda each, is_so=is_so: 'outputs' in each and is_so(each['outputs']))
        host.end()


INPUTS = [
    *((f'enc {n} {100 * n}', f'ENC{n}', 100 * n) for n in range(1, 5)),
    *((f'us {n} {50 * n}', f'US{n}', 50 * n) for n in range(1, 5)),
    *((f'analog {name} {volts}', name, volts)
      for name, volts in (('AIN24', 20.5), ('AIN12', 11.5), ('AIN5', 4.5), ('AINSTEER', 2.5), ('AIN6', 1.5))),
    ('gpio 1 low', 'GPIO', 0b11111110), ('gpio 8 low', 'GPIO', 0b01111110),
    ('handle released', 'DMHSTA', 0), ('handle held', 'DMHSTA', 1),
]


def check_inputs(board):
    """Asserts that each input reports its simulated value."""
    fields = 'ALL,GPIO'
    with monitor(board.host_url, '--fields', fields) as host:
        for words, field, value in INPUTS:
            board.process.stdin.write(words + '\n')
            board.process.stdin.flush()
            host.next(lambda each, field=field, value=value: is_state(each) and
                      abs(each['fields'].get(field, 1e9) - value) < 0.011)


def wired(*options):
    return Board('udp://127.0.0.1:0', options=[*options, '--stdin'], stdin=subprocess.PIPE)


def test_every_channel_of_a_board_with_another_wiring_works(other):
    with wired('--wiring', other) as board:
        check_inputs(board)  # first, because a motor turns its encoder
        check_outputs(board)


def restart(board):
    board.process.stdin.write('reboot\n')
    board.process.stdin.flush()
    board.next(lambda each: each.get('happened') == 'reboot')


@pytest.fixture(name='cable')
def pty_of_a_board(tmp_path):
    return f'pty:{tmp_path}/r4', f'serial://{tmp_path}/r4'


def test_a_given_wiring_is_used_from_the_next_start_on_in_every_channel(other, cable):
    """A new board, whose wiring differs from the plan in thirty places, needs one restart and no recompilation."""
    assert len(OTHER) >= 30
    pty, serial = cable
    with Board(pty, 'udp://127.0.0.1:0', listens=2, options=['--wired', other, '--new', '--stdin'],
               stdin=subprocess.PIPE) as board:
        board.next(lambda each: 'fault' in each)
        given = run('wiring', 'give', other, serial)
        assert given.returncode == 0, given.stderr
        kept = objects(run('wiring', 'show', serial, '--json').stdout)[0]
        assert (kept['source'], kept['in_use']) == ('given', False)
        assert {signal: kept['places'][signal] for signal in OTHER} == OTHER
        restart(board)
        assert objects(run('wiring', 'show', serial, '--json').stdout)[0]['in_use']
        assert run('wiring', 'diff', other, serial).stdout == ''
        board.host_url = serial
        check_inputs(board)
        check_outputs(board)


def test_a_new_board_is_safe_until_its_owner_confirms_the_plan(cable):
    pty, serial = cable
    with Board(pty, options=['--new', '--stdin'], stdin=subprocess.PIPE) as board:
        board.next(lambda each: each.get('fault', {}).get('trouble') == 'not confirmed')
        refused = run('send', serial, 'O:358,1,1')
        assert refused.returncode == 3 and 'r4 wiring confirm' in refused.stderr
        cleared = run('send', serial, 'E:CLEAR', 'O:358,1,1')
        assert cleared.returncode == 0, cleared.stderr
        restart(board)
        assert run('send', serial, 'O:358,1,1').returncode == 3, 'each time'
        confirmed = run('wiring', 'confirm', serial)
        assert confirmed.returncode == 0, confirmed.stderr
        assert run('send', serial, 'O:358,1,1').returncode == 3, 'from the next start on'
        restart(board)
        assert run('send', serial, 'O:358,1,1').returncode == 0
        assert 'a confirmation is not needed' in run('wiring', 'confirm', serial).stdout
        assert run('wiring', 'diff', 'plan', serial).returncode == 0


def test_a_wiring_is_given_and_told_over_a_cable_only(other):
    with Board('udp://127.0.0.1:0') as board:
        for words in (['give', other, board.host_url], ['show', board.host_url], ['confirm', board.host_url],
                      ['diff', 'plan', board.host_url]):
            result = run('wiring', *words)
            assert result.returncode == 2 and 'USB only' in result.stderr, result.stderr
        assert run('send', board.host_url, 'C:wiring,off').returncode == 3


def test_a_board_without_a_handle_says_so(tmp_path):
    path = tmp_path / 'none.wiring'
    path.write_text(run('wiring', 'template').stdout.replace('handle = D42', 'handle = none'))
    with wired('--wiring', str(path)) as board:
        board.process.stdin.write('handle released\n')
        board.process.stdin.flush()
        board.next(lambda each: each.get('happened') == 'handle released')
        sent = run('send', board.host_url, 'O:358,1,1')
        assert sent.returncode == 0, sent.stderr
        with watch(board.host_url) as host:
            assert host.next(is_state)['fields']['DMHSTA'] == 2


def test_chips_on_the_other_bus_are_named(tmp_path):
    path = tmp_path / 'bus.wiring'
    path.write_text(run('wiring', 'template').stdout.replace('chip bus = D20/D21', 'chip bus = SDA1/SCL1'))
    with wired('--wired', str(path)) as board:
        board.next(lambda each: each.get('fault', {}).get('trouble') == 'other bus')
        refused = run('send', board.host_url, 'O:358,1,1')
        assert refused.returncode == 3 and "correct 'chip bus'" in refused.stderr
        assert run('send', board.host_url, 'X:SCAN').returncode == 3


def test_a_board_that_believes_the_plan_drives_what_is_really_there(other):
    with wired('--wired', other) as board:
        silent = board.next(lambda each: 'fault' in each)
        assert 'no acknowledge' in str(silent['fault']), 'its chips are at other addresses'


@pytest.mark.parametrize('option', ['--wiring', '--wired'])
def test_a_simulated_board_refuses_a_wrong_wiring(tmp_path, option):
    path = tmp_path / 'bad.wiring'
    path.write_text('r4-wiring 1\nhandle = \x1b[2J\n')
    result = run('sim', 'udp://127.0.0.1:0', option, str(path))
    assert result.returncode == 1 and ERROR.search(result.stderr) and '\x1b' not in result.stderr
