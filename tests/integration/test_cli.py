# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: exit codes and messages for bad input, and programs with closed pipes, full disks and signals."""
import json
import os
import pty
import pwd
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time

import pytest

from r4_process import ERROR, PATIENCE_S, R4, Running, objects, run
from ros2_peer import own_domain

DATA_BAD, USAGE, REFUSED, OPEN, PERMISSION, UNSUPPORTED = 1, 2, 3, 4, 5, 6


# With a fleet, the command handles one board after the other.
@pytest.mark.parametrize('command', [
    ['monitor', 'udp://127.1.0.{1-100}'], ['monitor', 'udp://127.1.0.{1-100}?listen=0'],
    ['record', 'udp://127.1.0.{1-100}', '-o', 'fleet.r4log'], ['metrics', 'udp://127.1.0.{1-100}?listen=0'],
    ['sim', 'udp://127.1.0.{1-100}:20180']])
def test_a_program_reports_the_limit_of_open_files(command, tmp_path):
    result = subprocess.run(['sh', '-c', 'ulimit -n 40; exec "$0" "$@"', R4, *command], capture_output=True, text=True,
                            timeout=PATIENCE_S, cwd=tmp_path, check=False)
    assert result.returncode == OPEN, result.stderr
    assert 'this program has reached its limit of 40 open files' in result.stderr and 'ulimit -n 160' in result.stderr


NO_BOARD = 'udp://127.0.0.1:9?listen=0'


@pytest.mark.parametrize('arguments, code, message', [
    ([], USAGE, 'the command is missing'),
    ([''], USAGE, "^r4: '': this is not a command"),
    (['frobnicate'], USAGE, 'frobnicate: this is not a command'),
    (['monitr', 'sim:'], USAGE, 'did you mean monitor'),
    (['monitor'], USAGE, 'URL: is missing'),
    (['monitor', 'sim:', '--jsn'], USAGE, 'did you mean --json'),
    (['monitor', 'sim:', '--count'], USAGE, '--count: needs a value'),
    (['monitor', 'sim:', '--count', '0'], USAGE, 'out of range'),
    (['monitor', 'sim:', '--count', 'many'], USAGE, 'is not a whole number'),
    (['monitor', 'sim:', '--duration', '-1'], USAGE, 'is not a valid time'),
    (['monitor', 'sim:', '--fields', 'AIN99'], USAGE, 'this is not a list of state fields'),
    (['bench', 'sim:', 'sim:?node=2'], USAGE, 'a separate board'),
    (['send', 'sim:', 'sim:?node=2', 'O:1,1,1'], USAGE, 'a separate board'),
    (['monitor', 'ftp://192.168.1.77'], USAGE, "no transport 'ftp'"),
    (['monitor', 'nonsense'], USAGE, 'nonsense'),
    (['monitor', 'udp://'], USAGE, 'udp://'),
    (['monitor', 'udp://127.0.0.1:99999'], USAGE, '99999'),
    (['monitor', 'udp://127.0.0.1?speed=9'], USAGE, 'speed'),
    (['monitor', 'pty:/tmp/r4'], USAGE, 'pty:'),
    (['monitor', 'can:can0'], USAGE, 'such as can://can0'),
    (['monitor', 'can://can0/x?node=1'], USAGE, 'such as can://can0'),
    (['monitor', 'can://can0?fd'], USAGE, 'as in can://can0.node=1&fd=1'),
    (['sim', 'can://can0', 'can://can0?node=1'], USAGE, 'name a node once'),
    (['sim', 'serial:auto?baud=1'], USAGE, 'baud'),
    (['monitor', 'serial:///dev/tty-that-is-not-there'], OPEN, 'tty-that-is-not-there'),
    (['monitor', 'udp://no-such-host.invalid'], OPEN, 'no-such-host.invalid'),
    (['monitor', NO_BOARD, '--duration', '0.3'], REFUSED, 'nothing was received'),
    (['bench', NO_BOARD], REFUSED, 'nothing was received'),
    (['send', NO_BOARD, 'O:1,1,1', '--timeout', '0.3'], REFUSED, 'not confirmed within 3'),
    (['stop', NO_BOARD, '--timeout', '0.3'], REFUSED, '^r4: E:STOP to udp://127.0.0.1:9.*CUT THE POWER'),
    (['stop', 'serial:///dev/tty-that-is-not-there'], OPEN, 'CUT THE POWER'),
    (['send', NO_BOARD, 'O:358,1'], USAGE, 'O:pwm,dir,ch'),
    (['send', NO_BOARD, 'O:358,1,5'], USAGE, 'the channel does not exist.*ch 1-4'),
    (['send', NO_BOARD, 'O:5000,1,1'], USAGE, 'outside its range.*pwm 0-4095'),
    (['send', NO_BOARD, 'O:358,1,1;O:1,0,1'], USAGE, '^r4: O:1,0,1: is the second command for its channel'),
    (['send', NO_BOARD, 'O:358,1,1;O:358,1,5'], USAGE, '^r4: O:358,1,5: the channel does not exist'),
    (['send', NO_BOARD, 'O:358,1,1;C:rate,50'], USAGE, '^r4: C:rate,50: drives no output'),
    (['send', NO_BOARD, 'O:358,1,1;U:10,1'], USAGE, '^r4: U:10,1: drives no output'),
    (['send', NO_BOARD, 'O:358,1,1;E:STOP'], USAGE, '^r4: E:STOP: drives no output'),
    (['send', NO_BOARD, 'Q:ID;O:358,1,1'], USAGE, '^r4: Q:ID: drives no output'),
    (['send', NO_BOARD, 'O:358,1,1;;O:358,1,2'], USAGE, 'this is not a command'),
    (['send', NO_BOARD, ';'.join(f'S:1500,{i}' for i in range(1, 17)) + ';R:1,On'], USAGE, 'one command too many: a group has at most 16'),
    (['send', NO_BOARD, 'O:358,1,1;O:358,1,2', '--timeout', '0.3'], REFUSED, 'not confirmed within 3'),
    (['send', NO_BOARD, 'G:1'], USAGE, 'this is not a command; use one of O:'),
    (['send', NO_BOARD, 'X:1'], USAGE, r'^r4: X:1: the board does not know this command.*use X:DAC,channel,mV.*X:READ,'),
    (['send', NO_BOARD, 'X:READ,3,x75,1'], USAGE, 'outside its range.*address 8-119'),
    (['send', NO_BOARD, 'X:READ,104,75,1'], USAGE, 'does not have the form.*bytes as x3B00'),
    (['send', NO_BOARD, 'X:POLL,104,x3b,14,10,9'], USAGE, 'the channel does not exist.*slot 1-8'),
    (['send', NO_BOARD, 'X:POLL,104,x3b,14,4,1'], USAGE, 'outside its range.*5-60000 ms'),
    (['send', NO_BOARD, 'O:358,1,1;X:WRITE,104,x00'], USAGE, 'is a transfer of its own, so it cannot be part'),
    (['send', NO_BOARD, 'C:i2c1,104:3b:14:10'], USAGE, 'write i2c1,value with address:register:count:period'),
    (['send', NO_BOARD, 'hello'], USAGE, 'this is not a command'),
    (['send', NO_BOARD, 'O'], USAGE, 'O:pwm,dir,ch'),
    (['send', NO_BOARD, 'F:AIN99'], USAGE, 'F:'),
    (['send', NO_BOARD, 'C:rate,100000'], USAGE, 'C:'),
    (['send', NO_BOARD, 'H:ROS2-R4'], USAGE, 'heartbeats'),
    (['send', NO_BOARD, 'O:1,1,1^'], USAGE, 'O:'),
    (['encode', 'O:358,1,5'], USAGE, 'the channel does not exist'),
    (['encode', 'O:5000,1,1'], USAGE, 'outside its range'),
    (['encode', 'O:1,1,1;O:2,1,1'], USAGE, '^r4: O:2,1,1: is the second command for its channel'),
    (['encode', 'O:1,1,1;D:1,1,5'], USAGE, '^r4: D:1,1,5: the channel does not exist'),
    (['encode', 'O:1,1,1;C:rate,50'], USAGE, '^r4: C:rate,50: drives no output'),
    (['encode', 'E:STOP;O:1,1,1'], USAGE, '^r4: E:STOP: drives no output'),
    (['encode', 'AIN24'], USAGE, 'is not a field'),
    (['encode', 'A:1;^0x0^'], USAGE, 'is not a field'),
    (['encode', 'A:1\nB:2'], USAGE, 'is not a field'),
    (['encode', 'O:1,1,1;PNum:7'], USAGE, '--pnum'),
    (['encode', 'N:66,NONSENSE'], USAGE, 'N:<PNum>,<CODE>'),
    (['encode', 'A:' + 'x' * 1024], USAGE, 'longer than 1024 bytes'),
    (['encode', 'O:1,1,1', '--pnum', '4294967296'], USAGE, 'out of range'),
    (['decode', '/no/such/file'], OPEN, '/no/such/file'),
    (['decode', '/'], OPEN, 'directory'),
    (['sim', '--script', '/no/such/file'], USAGE, '/no/such/file'),
    (['sim', '--sensors', '0.1'], USAGE, 'add --json'),
    (['sim', '--json', '--sensors', '0'], USAGE, 'too short'),
    (['sim', '--set', 'pack,2'], USAGE, '--set pack,2'),
    (['sim', '--set', 'colour,red'], USAGE, '--set colour'),
    (['sim', '--link', 'loss=101%'], USAGE, '^r4: loss=101%: is not a number from 0 to 100'),
    (['sim', '--link', 'loss=5'], USAGE, '^r4: loss=5: is not a valid share: expected percent, such as 5%; write a link as in loss=5%,delay=20ms'),
    (['sim', '--link', 'loss=5%,delay=10ms±20'], USAGE, '^r4: delay=10ms±20: is not a valid delay: the variation is larger than the delay'),
    (['sim', '--link', 'cut=1s'], USAGE, '^r4: cut=1s: is not a valid cut: the duration is missing'),
    (['sim', '--link', 'speed=1'], USAGE, '^r4: speed=1: is not a property of a link'),
    (['sim', '--link', ''], USAGE, '--link|is not a property of a link'),
    (['sim', '--board-id', '=1+1'], USAGE, 'is not a valid board id'),
    (['sim', '--board-id', 'x' * 65], USAGE, 'use 1 to 64'),
    (['monitor', 'udp://255.255.255.255'], USAGE, 'a multicast or broadcast address'),
    (['monitor', 'udp://224.0.0.1'], USAGE, 'a multicast or broadcast address'),
    (['sim', 'udp://127.0.0.1:0', 'pty:', 'pty:', 'pty:', 'pty:'], USAGE, 'at most 4'),
    (['completion', 'csh'], USAGE, 'bash, zsh or fish'),
    (['man', 'sned'], USAGE, 'this is not a command'),
    (['man', '--output', '/nowhere/at/all'], OPEN, 'folder'),
])
def test_bad_input_has_its_exit_code_and_a_message_with_the_fix(arguments, code, message):
    result = run(*arguments)
    assert result.returncode == code, result
    assert re.search(message, result.stderr), result.stderr
    assert ERROR.fullmatch(result.stderr.strip()), result.stderr


def test_no_command_is_sent_if_one_of_them_is_wrong():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        board.bind(('127.0.0.1', 0))
        board.setblocking(False)
        url = f'udp://127.0.0.1:{board.getsockname()[1]}?listen=0'
        assert run('send', url, 'O:1,1,1', 'O:5000,1,1').returncode == USAGE
        with pytest.raises(BlockingIOError):
            board.recv(2000)


def test_a_wrong_line_of_a_scenario_is_a_data_error():
    with tempfile.NamedTemporaryFile('w') as file:
        file.write('0.5 handle released\n1 explode\n')
        file.flush()
        result = run('sim', 'udp://127.0.0.1:0', '--script', file.name)
    assert result.returncode == DATA_BAD
    assert f'{file.name}:2' in result.stderr and ERROR.match(result.stderr)


def test_a_board_reports_its_transport_counters_when_it_ends(tmp_path):
    urls = ['udp://127.0.0.1:0', f'pty:{tmp_path}/r4']
    result = run('sim', '--json', '--duration', '0.1', *urls)
    assert result.returncode == 0, result.stderr
    udp, cable = [each for each in objects(result.stdout) if each['type'] == 'counters']
    assert udp['transport'].startswith('udp://127.0.0.1:') and cable['transport'].startswith('pty:')
    assert udp['received'] == cable['received'] == 0 and 'transfers' not in udp
    in_words = run('sim', '--duration', '0.1', *urls).stdout.splitlines()[-1]
    assert 'pty:' in in_words and '0 datagrams received' in in_words and 'dropped' in in_words


@pytest.mark.parametrize('command', [['sim', 'udp://127.0.0.1:{}'],
                                     ['monitor', 'udp://127.0.0.1:9?listen={}']])
def test_a_port_in_use_is_named(command):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(('0.0.0.0', 0))
        port = str(other.getsockname()[1])
        result = run(*[each.format(port) for each in command], '--duration', '5')
    assert result.returncode == OPEN
    assert re.search(f'{port}.*in use', result.stderr) and ERROR.match(result.stderr)


def test_stop_works_while_another_program_has_the_port_of_hosts():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board, \
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        board.bind(('127.0.0.1', 0))
        board.settimeout(5)
        try:
            other.bind(('0.0.0.0', 2390))
        except OSError:
            pass  # another program has the port, as the test requires
        run('stop', f'udp://127.0.0.1:{board.getsockname()[1]}', '--timeout', '0.3')
        # A heartbeat may arrive first.
        assert any(board.recv(2000).startswith(b'E:STOP;') for _ in range(2))


def test_a_denied_permission_is_reported_with_a_fix():
    master, slave = pty.openpty()
    device = os.ttyname(slave)
    os.chmod(device, 0)
    options = {}
    # Root may open anything, so root runs a copy of r4 as another user, which may be unable to read the build.
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        program = shutil.copy(R4, os.path.join(folder, 'r4'))
        if os.geteuid() == 0:
            nobody = pwd.getpwnam('nobody')
            options = {'user': nobody.pw_uid, 'group': nobody.pw_gid, 'extra_groups': []}
        result = subprocess.run([program, 'monitor', f'serial://{device}', '--duration', '5', '--json'],
                                capture_output=True, text=True, timeout=30, check=False, **options)
    os.close(master)
    os.close(slave)
    assert result.returncode == PERMISSION, result
    assert ERROR.match(result.stderr) and device in result.stderr and 'dialout' in result.stderr
    assert objects(result.stdout)[-1]['kind'] == 'permission'


def test_r4_names_a_missing_part_of_its_installation(tmp_path):
    program = shutil.copy(R4, tmp_path / 'r4')
    result = subprocess.run([program, 'ros2', 'sim:', '--duration', '1'], capture_output=True, text=True, timeout=30,
                            check=False)
    assert result.returncode == UNSUPPORTED and ERROR.match(result.stderr), result
    assert f'{tmp_path}/r4-services' in result.stderr and 'libexec' in result.stderr


@pytest.mark.parametrize('arguments', [['encode', 'Q:ID'], ['decode'], ['--help'], ['--version'],
                                       ['sim', 'udp://127.0.0.1:0', '--duration', '0.1']])
def test_output_that_cannot_be_written_is_an_error(arguments):
    with open('/dev/full', 'wb') as full:
        result = subprocess.run([R4, *arguments], input='AIN:1;^0x1^\n', stdout=full, stderr=subprocess.PIPE,
                                text=True, check=False)
    assert result.returncode == OPEN
    lost_errno = 'Input/output error'  # stdio loses errno
    reason = 'No space left on device' if arguments[0] == 'sim' else f'(No space left on device|{lost_errno})'
    assert re.match(f'r4: standard output: {reason}; ', result.stderr), result.stderr


@pytest.mark.parametrize('closed', [False, True])
def test_a_standard_error_that_cannot_be_written_changes_no_exit_code(closed):
    with open('/dev/full', 'wb') as full:
        arguments = [R4, 'stop', 'udp://127.0.0.1:9', '--timeout', '0.1', '--json']
        command = ['sh', '-c', 'exec "$@" 2>&-', 'sh', *arguments] if closed else arguments
        result = subprocess.run(command, stdout=subprocess.PIPE, stderr=full, text=True, check=False)
    assert result.returncode == REFUSED, result
    assert objects(result.stdout)[-1]['kind'] == 'refused'


def test_a_board_does_not_wait_for_the_reader_of_its_log():
    """No program reads the pipe, which holds 64 KB. Each command logs a line or two."""
    with subprocess.Popen([R4, 'sim', 'udp://127.0.0.1:0', '--json', '--duration', '20'],
                          stdout=subprocess.PIPE, text=True) as board:
        url = json.loads(board.stdout.readline())['host_url'] + '?listen=0'
        result = run('send', url, *[f'O:{pwm},1,1' for pwm in range(1, 301)], timeout=60)
        assert result.returncode == 0, result
        monitor = run('monitor', url, '--json', '--count', '60', timeout=60)
        states = [each for each in objects(monitor.stdout) if each['type'] == 'state']
        assert len(states) == 60
        board.terminate()
        written = board.stdout.read()
    events = objects(written)  # objects() fails if a line is not whole
    assert sum('executed' in each for each in events) > 100


def test_dev_null_replaces_closed_standard_streams():
    closed = f'exec "{R4}" sim --quiet udp://127.0.0.1:0 <&- >&-'
    with subprocess.Popen(['bash', '-c', closed], stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + PATIENCE_S
        while len(os.listdir(f'/proc/{process.pid}/fd')) < 6 and time.monotonic() < deadline:
            time.sleep(0.01)
        streams = [os.readlink(f'/proc/{process.pid}/fd/{fd}') for fd in range(3)]
        process.kill()
    assert streams == ['/dev/null'] * 3


def signals_of(pid, kind):
    """The signals that a process catches (`kind` SigCgt) or ignores (SigIgn)."""
    with open(f'/proc/{pid}/status', encoding='ascii') as status:
        mask = next(int(line.split()[1], 16) for line in status if line.startswith(kind))
    return {number for number in signal.Signals if mask >> (number - 1) & 1}


@pytest.mark.parametrize('command', [
    ['sim', 'udp://127.0.0.1:0'], ['monitor', NO_BOARD], ['monitor', NO_BOARD, 'udp://127.0.0.1:10?listen=0'],
    ['record', NO_BOARD, '-o', 'drive.r4log'], ['bridge', 'udp://127.0.0.1:0', NO_BOARD],
    ['metrics', NO_BOARD, '--listen', '127.0.0.1:0'], ['web', NO_BOARD, '--listen', '127.0.0.1:0'], ['ros2', NO_BOARD],
    ['replay', 'drive.r4log', 'udp://127.0.0.1:0', '--step']], ids=' '.join)
def test_a_signal_that_was_ignored_at_the_start_stays_ignored(command, tmp_path):
    if command[0] == 'replay':
        assert run('record', 'sim:', '-o', 'drive.r4log', '--duration', '0.2', cwd=tmp_path).returncode == 0
    ignored = {signal.SIGHUP, signal.SIGINT}

    def as_nohup_and_the_background_of_a_script():
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)

    with Running(*command, cwd=tmp_path, env=own_domain(), stdin=subprocess.PIPE,
                 preexec_fn=as_nohup_and_the_background_of_a_script) as program:
        deadline = time.monotonic() + PATIENCE_S
        while signal.SIGTERM not in signals_of(program.process.pid, 'SigCgt:'):
            assert program.process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        assert ignored <= signals_of(program.process.pid, 'SigIgn:')
        program.signal(signal.SIGTERM)
        assert program.wait() in (0, REFUSED), program.errors  # REFUSED: no board answered
        program.process.stdin.close()


def test_with_json_an_error_is_also_a_json_object():
    result = run('monitor', 'serial:///dev/tty-that-is-not-there', '--json')
    error = objects(result.stdout)[-1]
    assert error['type'] == 'error' and error['kind'] == 'open'
    assert all(error[key] for key in ('thing', 'reason', 'fix'))
    assert f"r4: {error['thing']}: {error['reason']}; {error['fix']}\n" == result.stderr
