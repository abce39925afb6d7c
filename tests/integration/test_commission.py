# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 commission at simulated boards: by JSON lines, and at a terminal with a keyboard."""
import json
import os
import pty
import re
import select
import signal
import subprocess
import time

import pytest

from machine import within
from r4_process import ERROR, R4, Board, Running, objects, run

CHECKS = ['handle', 'relay 2', 'motor supply', 'osmc 1', 'silence', 'stop']


@pytest.fixture(name='board')
def board_on_a_cable(tmp_path):
    """A new board whose motor 1 is reversed."""
    wiring = tmp_path / 'truth.wiring'
    wiring.write_text(run('wiring', 'template').stdout.replace('osmc 1 direction = osmc.1', 'osmc 1 direction = osmc.1 inverted'))
    with Board(f'pty:{tmp_path}/r4', options=['--wired', str(wiring), '--new', '--stdin'], stdin=subprocess.PIPE) as board:
        yield board


def happen(board, words):
    board.process.stdin.write(words + '\n')
    board.process.stdin.flush()
    board.next(lambda each: each.get('happened') == words)


class Script(Running):
    """r4 commission --json with a program that answers the questions."""

    def __init__(self, board, *options):
        super().__init__('commission', board.host_url, '--json', *options, stdin=subprocess.PIPE)
        self.board = board
        self.asked = []

    def write(self, line):
        self.process.stdin.write(json.dumps(line) + '\n')
        self.process.stdin.flush()

    def answer(self, question):
        topic = question['topic']
        self.asked.append(topic)
        if topic in ('handle held', 'handle released'):
            happen(self.board, topic)
        if topic == 'restart':
            happen(self.board, 'reboot')
        if topic == 'which':
            return question['check']
        if topic == 'forward':
            return True  # the reversed motor turns forward when it should turn backward
        return topic not in ('supply with relay open', 'two pwm inputs')

    def until_the_end(self):
        results = {}
        for each in iter(self.next, None):
            if each['type'] == 'question':
                self.write({'answer': self.answer(each)})
            elif each['type'] == 'movement':
                self.write({'key': True})
            elif each['type'] == 'check':
                results[each['id']] = each
            elif each['type'] == 'report':
                return results, each


def test_a_script_commissions_a_board_and_its_report_is_resumed(board, tmp_path):
    report = tmp_path / 'robot.html'
    only = [option for check in CHECKS for option in ('--only', check)]
    with Script(board, '--report', str(report), *only) as script:
        results, end = script.until_the_end()
        assert script.wait() == 1
    assert {id: each['status'] for id, each in results.items()} == {
        **dict.fromkeys(CHECKS, 'passed'), 'osmc 1': 'found', 'offer': 'passed'}, results
    assert [(each['thing'], each['finding']) for each in results['osmc 1']['found']] == [('osmc 1', 'reversed')]
    assert script.asked.count('clear') == 1 and script.asked[-2:] == ['give wiring', 'restart']
    assert end == {**end, 'found': 1, 'left': False}
    text = report.with_suffix('.json').read_text()
    whole = json.loads(text)
    assert whole['board']['id'] == 'sim-1' and 'osmc 1 direction = osmc.1 inverted' in whole['learnt_wiring']
    page = report.read_text()
    assert 'The movement is in the opposite direction of the command.' in page and '<script' not in page
    assert 'http' not in page, 'the page is one file'

    for options in ((), ('--resume', '/dev/null')):
        refused = run('commission', board.host_url, '--report', str(report), *options)
        assert refused.returncode == 2 and '--resume' in refused.stderr
        assert report.with_suffix('.json').read_text() == text
    # The board uses the learnt wiring, so the motor turns in the commanded direction.
    with Script(board, '--resume', str(report.with_suffix('.json')), '--only', 'osmc 1') as script:
        script.answer = lambda question: {'which': 'osmc 1', 'forward': len(script.asked) > 2}.get(
            script.asked.append(question['topic']) or question['topic'], True)
        results, _ = script.until_the_end()
    assert results['osmc 1']['status'] == 'passed', (results, script.asked)
    assert json.loads(report.with_suffix('.json').read_text())['checks'][0]['id'] == 'handle'


def test_the_end_of_the_input_and_a_signal_stop_what_moves(board, tmp_path):
    for number, end in enumerate((lambda script: script.process.stdin.close(),
                                  lambda script: script.signal(signal.SIGTERM),
                                  lambda script: script.signal(signal.SIGKILL),
                                  lambda script: script.write({'key': False}))):
        with Script(board, '--report', f'{tmp_path}/{number}.html', '--only', 'motor supply') as script:
            for each in iter(script.next, None):
                if each['type'] == 'question':
                    script.write({'answer': each['topic'] != 'supply with relay open'})
                elif each['type'] == 'movement':
                    board.skip_past()
                    script.write({'key': True})
                    break
            board.outputs(lambda outputs: outputs['relays'] == 1)
            began = time.monotonic()
            end(script)
            off = board.outputs(lambda outputs: outputs['relays'] == 0)
            assert off['came'] - began < within(1.5 if number == 2 else 0.4)
            script.process.kill()


class Terminal:
    """r4 commission in a pseudo-terminal."""

    def __init__(self, *arguments):
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.execv(R4, [R4, 'commission', *arguments])
        self.text = ''

    def until(self, pattern, typing='', timeout=30):
        """Types as a held key does, and reads until the new text matches."""
        deadline = time.monotonic() + timeout
        while not (found := re.search(pattern, self.text)):
            assert time.monotonic() < deadline, f'no {pattern} in {self.text}'
            if select.select([self.fd], [], [], 0.04)[0]:
                try:
                    self.text += os.read(self.fd, 4096).decode()
                except OSError as gone:
                    raise AssertionError(f'r4 has ended: {self.text}') from gone
            elif typing:
                self.type(typing)
        self.text = self.text[found.end():]

    def answer(self, question, keys):
        self.until(question + '[^$]*leave: |' + question)
        self.type(keys)

    def type(self, keys):
        os.write(self.fd, keys.encode())

    def wait(self):
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        self.pid = 0
        return code

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.pid != 0:
            os.kill(self.pid, signal.SIGKILL)
            self.wait()
        os.close(self.fd)


def test_a_keyboard_is_enough_and_letting_go_of_the_space_bar_stops(board, tmp_path):
    with Terminal(board.host_url, '--report', f'{tmp_path}/r.html', '--only', 'motor supply') as terminal:
        terminal.answer('wheels are OFF THE GROUND', 'y')
        terminal.answer('does the meter show', 'n')
        terminal.answer('clear the fault', 'y')
        with pytest.raises(AssertionError):  # a key that is already held starts no movement
            terminal.until('HOLD the space bar', typing=' ', timeout=0.7)
        terminal.until('HOLD the space bar[^$]*leave: ')
        board.skip_past()
        terminal.type(' ')
        with pytest.raises(AssertionError):  # one press moves no motor
            board.outputs(timeout=0.5)
        terminal.type('  ')
        on = board.outputs(lambda outputs: outputs['relays'] == 1)
        off = board.outputs(lambda outputs: outputs['relays'] == 0)
        assert off['came'] - on['came'] < within(0.5), 'no repeat came: the key was released'
        terminal.until('too short to see[^$]*leave: ')
        terminal.until('Did the meter show[^$]*leave: ', typing=' ')
        terminal.type('y')
        terminal.until('1 checks, 0 findings')
        assert terminal.wait() == 0


def test_a_terminal_takes_numbers_and_choices_and_can_be_left(board, tmp_path):
    only = ['--only', 'supply AIN24', '--only', 'relay 3', '--only', 'osmc 1']
    with Terminal(board.host_url, '--report', f'{tmp_path}/r.html', *only) as terminal:
        terminal.answer('supply is OFF', 'y')
        terminal.answer('multimeter show', 'abc\n')
        terminal.answer("'abc' is not a valid answer", '24.2\x7f23\n')
        terminal.until('meter: 24.23 V')
        terminal.answer('clear the fault', 'y')
        terminal.until('HOLD the space bar[^$]*leave: ')
        terminal.until('9 relay 7[^$]*leave: ', typing=' ')
        terminal.type('5\n')
        terminal.answer('wheels are OFF', 'q')
        terminal.until('continue with: r4 commission')
        assert terminal.wait() == 0
    checks = json.loads((tmp_path / 'r.json').read_text())['checks']
    assert [(each['id'], each['status']) for each in checks] == [('supply AIN24', 'passed'), ('relay 3', 'passed')]


@pytest.mark.parametrize('arguments, code', [
    ([], 2), (['sim:'], 2), (['sim:', '--only', 'osmc 9'], 2), (['sim:', '--report', 'x.txt'], 2), (['sim:', '--resume', '/nowhere'], 4),
    (['sim:', '--resume', '/dev/null'], 1), (['sim:', '--report', '/nowhere/x.html'], 4)])
def test_a_wrong_use_says_what_is_right(arguments, code, tmp_path):
    result = run('commission', *arguments, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (code, '') and ERROR.search(result.stderr), result.stderr


def test_the_checks_are_listed():
    checks = objects(run('commission', '--list', '--json').stdout)
    assert len(checks) == 65 and checks[0]['id'] == 'identity' and checks[-1]['id'] == 'stop'
    assert all(each['section'] == 'motor supply off' or each['moves'] for each in checks)
