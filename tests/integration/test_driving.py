# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs each command of the documentation and the help that drives a motor, and asserts that the motor turns. The
simulated motors have supply only while relay 1 is closed, as on a real robot."""
import pathlib
import re
import select
import signal
import socket
import subprocess
import threading

import pytest

from r4_process import PATIENCE_S, Board, Running, driving, run

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
SENDS = re.compile(r'r4 send (.*)')
COMMANDS = re.compile(r'(?<![\w/:;])[A-Z]:[\w,.-]+(?:;[A-Z]:[\w,.-]+)*')  # a group is one match
DRIVES = re.compile(r'[ODPB]:')


def shown_commands():
    """Yields the commands of each shown `r4 send` that drives a motor. The id names the page or the help."""
    texts = [(page.name, page.read_text()) for page in PAGES]
    texts += [(f'r4 {" ".join(words)}', run(*words).stdout)
              for words in (['--help'], ['send', '--help'], ['key', '--help'], ['stop', '--help'])]
    for where, text in texts:
        for line in text.splitlines():
            shown = SENDS.search(line)
            if shown is None:
                continue
            commands = COMMANDS.findall(shown[1])
            # quick-start.md shows O:358,1,5 as a mistake.
            if any(map(DRIVES.match, commands)) and 'O:358,1,5' not in commands:
                yield pytest.param(commands, id=f'{where}: {" ".join(commands)}')


def drives(outputs):
    return (any(pwm for pwm, _ in outputs['osmc'] + outputs['dhb']) or any(speed for speed, _, _ in outputs['bldc'])
            or any(stepping for _, stepping in outputs['stepper']))


@pytest.mark.parametrize('commands', shown_commands())
def test_every_documented_drive_command_turns_a_motor(commands):
    with Board('udp://127.0.0.1:0') as board:
        result = run('send', board.host_url, *commands)
        assert result.returncode == 0, result.stderr
        driven = board.next(lambda each: 'outputs' in each and drives(each['outputs']))
        assert driven['supply'], f'{commands} drives a motor that has no supply: close relay 1 first'


def test_a_motor_turns_only_while_relay_1_is_closed_and_the_handle_held(tmp_path):
    """Uses the reports of the simulated sensors."""
    script = tmp_path / 'script'
    script.write_text('2.5 handle released\n')
    with Board('udp://127.0.0.1:0', options=['--sensors', '0.05', '--script', str(script)]) as board:
        def sensors(is_it=lambda each: True):
            return board.next(lambda each: each['type'] == 'sensors' and is_it(each))

        assert run('send', board.host_url, 'O:4095,1,1', '--hold', '0.2').returncode == 0
        board.next(lambda each: 'outputs' in each and each['outputs']['osmc'][0] == [4095, 1])
        still = sensors()
        assert (still['supply'], still['enc'][0]) == (False, 0)
        assert sensors()['enc'][0] == 0
        assert run('send', board.host_url, 'R:1,On', 'O:4095,1,1', '--hold', '1').returncode == 0
        turning = sensors(lambda each: each['supply'])
        assert sensors(lambda each: each['enc'][0] > turning['enc'][0])
        assert not sensors(lambda each: each['handle'] == 'released')['supply']


def test_ctrl_c_switches_the_outputs_off_at_once_and_ends_the_script():
    with Board('udp://127.0.0.1:0', options=('--set', 'timeout,5000')) as board:
        with driving(board.host_url, 'O:358,1,1') as host:
            assert host.end() == -signal.SIGINT, 'a shell would continue its script'
        board.executed('E:LEAVE')


class DroppingRelay:
    """Carries datagrams between a host and a board, except those for which `drops` is true."""

    def __init__(self, board_url, drops):
        self.drops = drops
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.near.bind(('127.0.0.1', 0))
        self.far.connect(('127.0.0.1', int(re.search(r':(\d+)', board_url[6:])[1])))
        self.url = f'udp://127.0.0.1:{self.near.getsockname()[1]}?listen=0'
        self.host = None
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while True:
            for ready in select.select([self.near, self.far], [], [])[0]:
                datagram, peer = ready.recvfrom(2048)
                if ready is self.near:
                    self.host = peer
                if self.drops(datagram):
                    continue
                if ready is self.near:
                    self.far.send(datagram)
                else:
                    self.near.sendto(datagram, self.host)


def test_ctrl_c_before_the_confirmation_is_reported_and_switches_the_outputs_off():
    sent, farewells = threading.Event(), []

    def drops(datagram):
        """The states after the command, so that it is not confirmed, and the first farewell."""
        if datagram.startswith(b'O:'):
            sent.set()
        if datagram.startswith(b'E:LEAVE'):
            farewells.append(datagram)
            return len(farewells) == 1
        return sent.is_set() and b';CMD:' in datagram

    with Board('udp://127.0.0.1:0', options=('--set', 'timeout,5000')) as board:
        relay = DroppingRelay(board.host_url, drops)
        with Running('send', relay.url, 'R:1,On', 'O:358,1,1', '--timeout', '60') as host:
            board.executed('O:358,1,1')
            assert host.end() == -signal.SIGINT
            assert host.errors.startswith('r4: O:358,1,1 to udp://127.0.0.1:'), host.errors
            assert 'interrupted before it was confirmed; look at the robot: it may have been executed' in host.errors
        board.executed('E:LEAVE')
    assert len(farewells) > 1, 'a lost farewell is repeated'


def test_ctrl_c_before_a_stop_is_confirmed_says_to_cut_the_power():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent_board:
        silent_board.bind(('127.0.0.1', 0))
        silent_board.settimeout(PATIENCE_S)
        url = f'udp://127.0.0.1:{silent_board.getsockname()[1]}?listen=0'
        with Running('send', url, 'E:STOP', '--timeout', '60') as host:
            while not silent_board.recv(1024).startswith(b'E:STOP'):
                pass
            assert host.end() == -signal.SIGINT
            assert 'E:STOP to udp://127.0.0.1:' in host.errors and 'before it was confirmed; cut the power' in host.errors


def test_events_from_standard_input_happen_at_once():
    with Board('udp://127.0.0.1:0', options=['--stdin', '--sensors', '0.05'], stdin=subprocess.PIPE) as board:
        def write(line):
            board.process.stdin.write(line + '\n')
            board.process.stdin.flush()

        write('us 3 15')
        assert board.next(lambda each: 'happened' in each)['happened'] == 'us 3 15'
        assert board.next(lambda each: each['type'] == 'sensors')['us'] == [0, 0, 15, 0]
        write('  # nothing\n\nus 3 far')
        error = board.next(lambda each: each['type'] == 'error')
        assert (error['thing'], error['reason']) == ('standard input', "'far' is not a distance")
        write('handle released')
        board.next(lambda each: each.get('reason') == 'handle')
        write('handle held')
        board.next(lambda each: each.get('reason') == 'link')
        write('motor 1 stalled')
        board.next(lambda each: each.get('happened') == 'motor 1 stalled')
        assert run('send', board.host_url, 'R:1,On', 'O:4095,1,1', '--hold', '1').returncode == 0
        driven = board.next(lambda each: each['type'] == 'sensors' and each['supply'])
        assert driven['enc'][0] == 0
        board.process.stdin.write('fault')  # without a newline
        board.process.stdin.close()
        board.next(lambda each: each.get('reason') == 'fault')
        assert board.next(lambda each: each['type'] == 'sensors'), 'the board has stopped'
