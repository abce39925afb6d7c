# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.SimBoard: events around a simulated board, in this process and in a separate process."""
import pathlib
import re
import subprocess
import sys

import pytest

import r4link
from r4link import _core

SCENARIO = pathlib.Path(__file__).resolve().parents[2] / 'docs/how-to/simulation.md'


def volts(sim, _):
    return sim.look().volts[0] == pytest.approx(21.5, abs=0.02)


def safe(reason):
    return lambda sim, board: board.link.reason == reason and sim.look().is_safe


def fault_of(chip):
    return lambda sim, board: board.link.reason == 'fault' and chip in (board.link.chip or '')


def now(board, name, value):
    return getattr(board.state, name) == value


# (the event, the condition that shows it, the event that ends it)
HAPPENINGS = [
    ('handle released', safe('handle'), 'handle held'),
    ('us 1 15', lambda _, board: now(board, 'us1', 15), 'us 1 0'),
    ('us 1 off', safe('proximity'), 'us 1 0'),
    ('enc 2 100', lambda sim, board: now(board, 'enc2', 100) and sim.look().encoder[1] == 100, ''),
    ('analog AIN24 21.5', volts, ''),
    ('divider AIN24 0.5', lambda _, board: board.next_state().ain24 < 13, 'divider AIN24 1'),
    ('defect handle on', safe('handle'), 'defect handle off'),
    ('motor 1 stalled', lambda sim, board: board.osmc(1).post(1) and sim.look().volts[0] < 24, 'motor 1 free'),
    *((f'chip {name} off', fault_of(chip), f'chip {name} on') for name, chip in (
        ('osmc', 'PCA9685 0x40'), ('dhb', 'PCA9685 0x41'), ('servo', 'PCA9685 0x42'), ('expander', 'MCP23017 0x20'),
        ('dac', 'MCP4728 0x61'))),
    ('chip osmc reset', fault_of('PCA9685 0x40'), ''),
    ('i2c held', fault_of(''), 'i2c free'),
    ('hang 0.3', lambda sim, _: sim.look().is_safe, ''),
    ('fault', safe('fault'), ''),
    ('watchdog', safe('watchdog'), ''),
    ('reboot', lambda _, board: board.disarmed_by == 'restart', ''),
]


@pytest.mark.parametrize('words, seen, end', HAPPENINGS, ids=[each[0] for each in HAPPENINGS])
def test_a_board_reports_every_simulated_event(words, seen, end, sim, board, wait):
    happens_and_is_seen(sim, board, wait, words, seen, end)


def test_a_board_in_another_process_reports_simulated_events(wait):
    with r4link.SimBoard('udp://127.0.0.1:0', settings={'name': 'left'}) as sim, r4link.Board(sim.url) as board:
        board.wait_active()
        assert board.identify().name == 'left'
        for each in HAPPENINGS:
            if each[0] in ('us 1 15', 'analog AIN24 21.5', 'chip dac off', 'handle released'):
                happens_and_is_seen(sim, board, wait, *each)
        with pytest.raises(r4link.DataError, match='not a valid ultrasonic sensor'):
            sim.happen('us 5 1')


def happens_and_is_seen(sim, board, wait, words, seen, end):
    board.fields('DEFAULT,ENC2,US1')
    board.proximity(1, cm=5)
    board.arm()
    board.osmc(1).set(0.02)
    sim.happen(words)
    wait(lambda: seen(sim, board))
    if end:
        sim.happen(end)
        wait(lambda: can_be_armed(board))


def can_be_armed(board):
    try:
        board.arm()
    except r4link.RefusedError:
        return False
    return True


def test_every_documented_event_is_tested():
    table = SCENARIO.read_text().split('    # TIME what\n')[1].split('\n\n')[0]
    words = re.findall(r'^    [\d.]+ +(\w+)', table, re.MULTILINE)
    assert len(words) > 10 and {each.split()[0] for each, _, _ in HAPPENINGS} == set(words)
    chips = re.search(r'(osmc.*): acknowledges', table)[1].replace(' or ', ', ').split(', ')
    assert {each.split()[1] for each, _, _ in HAPPENINGS if each.startswith('chip')} == set(chips)


def test_typed_methods_produce_valid_events(sim, monkeypatch):
    said = []
    monkeypatch.setattr(r4link.SimBoard, 'happen', lambda _, words: said.append(words))
    sim.handle(False)
    sim.obstacle(1, 15)
    sim.obstacle(1, None)
    sim.turn(2, -100)
    sim.analog('ain24', 21.5)
    sim.motor(1, True)
    sim.chip('dac', 'off')
    sim.i2c(True)
    sim.hang(0.3)
    sim.reboot()
    assert said == ['handle released', 'us 1 15', 'us 1 off', 'enc 2 -100', 'analog AIN24 21.50', 'motor 1 stalled',
                    'chip dac off', 'i2c held', 'hang 0.300', 'reboot']
    for words in said:
        _core.SimulatedRobot().happen(words)


@pytest.mark.parametrize('url', [None, 'udp://127.0.0.1:0'])
def test_a_bad_link_loses_datagrams(url):
    with r4link.SimBoard(url, link='loss=20%,seed=3') as sim, r4link.Board(sim.url) as board:
        board.wait_active()
        for _ in range(50):
            board.next_state()
        assert board.statistics.lost > 2


def test_wrong_arguments_of_simboard_are_refused(tmp_path):
    for wrong, error in [({'link': 'lost=1%'}, r4link.UsageError), ({'settings': {'name': 'x'}}, r4link.UsageError),
                         ({'url': 'udp://192.0.2.1:2018'}, r4link.OpenError), ({'url': 'tcp://x'}, r4link.Error),
                         ({'url': 'udp://127.0.0.1:0', 'link': 'lost=1%'}, r4link.Error),
                         ({'url': 'udp://127.0.0.1:0', 'settings': {'rate': 'x'}}, r4link.Error)]:
        with pytest.raises(error) as raised:
            r4link.SimBoard(**wrong)
        assert raised.value.fix
    sim = r4link.SimBoard('pty:' + str(tmp_path / 'r4'))
    sim.close()
    sim.close()
    with pytest.raises(r4link.DataError, match='ended'):
        sim.happen('reboot')


def test_a_closed_simboard_leaves_no_file_open():
    program = """
import gc, os, r4link
files = len(os.listdir('/proc/self/fd'))
for url in 'udp://127.0.0.1:0', 'tcp://x':
    try:
        r4link.SimBoard(url).close()
    except r4link.Error:
        pass
gc.collect()
assert len(os.listdir('/proc/self/fd')) == files
"""
    ended = subprocess.run([sys.executable, '-W', 'error', '-X', 'dev', '-c', program], capture_output=True, text=True,
                           check=False)
    assert ended.returncode == 0 and 'ResourceWarning' not in ended.stderr, ended.stderr
