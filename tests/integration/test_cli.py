# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: encode and decode, bad input with exit code and message, help, completion."""
import json
import os
import pty
import pwd
import re
import shutil
import socket
import subprocess
import tempfile
import time

import pytest

from r4_process import DATA, ERROR, PATIENCE_S, R4, SANITIZED, objects, run

DATA_BAD, USAGE, REFUSED, OPEN, PERMISSION, UNSUPPORTED = 1, 2, 3, 4, 5, 6
COMMANDS = ['monitor', 'send', 'stop', 'list', 'doctor', 'bridge', 'bus', 'bench', 'record', 'info', 'convert', 'plot',
            'replay', 'metrics', 'web', 'ros2', 'sim', 'key', 'demo', 'encode', 'decode', 'completion', 'man', 'devices']


def captured_lines():
    with open(os.path.join(DATA, 'paper_capture.tsv'), encoding='ascii') as file:
        return [line.rstrip('\n').split('\t')[1] for line in file]


# Of a fleet, one board after the other.
@pytest.mark.parametrize('command', [
    ['monitor', 'udp://127.1.0.{1-100}'], ['monitor', 'udp://127.1.0.{1-100}?listen=0'],
    ['record', 'udp://127.1.0.{1-100}', '-o', 'fleet.r4log'], ['metrics', 'udp://127.1.0.{1-100}?listen=0'],
    ['sim', 'udp://127.1.0.{1-100}:20180']])
def test_a_program_that_may_open_no_more_files_says_so(command, tmp_path):
    result = subprocess.run(['sh', '-c', 'ulimit -n 40; exec "$0" "$@"', R4, *command], capture_output=True, text=True,
                            timeout=PATIENCE_S, cwd=tmp_path, check=False)
    assert result.returncode == OPEN, result.stderr
    assert 'this program may have 40 files open, and has them' in result.stderr and 'ulimit -n 160' in result.stderr


# --- encode and decode

def test_encodes_the_papers_command():
    result = run('encode', 'O:358,1,1', '--pnum', '66', '--time', '1699276044383')
    assert (result.returncode, result.stdout) == (0, 'O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^\n')


def test_writes_a_checksum_without_leading_zeros():
    result = run('encode', 'O:1,0,1', '--pnum', '67', '--time', '1699276044483')
    assert result.stdout == 'O:1,0,1;PNum:67;T:1699276044483;^0xa13d0ac^\n'


def test_encodes_every_captured_datagram_byte_for_byte():
    form = re.compile(r'^(.*);PNum:(\d+);T:(\d+);\^')
    lines = [line for line in captured_lines() if form.match(line)]
    damaged = 0
    for line in lines:
        fields, pnum, t = form.match(line).groups()
        written = run('encode', fields, '--pnum', pnum, '--time', t).stdout.rstrip('\n')
        damaged += written != line
    assert (len(lines), damaged) == (69, 2)


def test_decodes_all_captured_datagrams_and_finds_the_two_damaged_ones():
    lines = captured_lines()
    result = run('decode', stdin='\n'.join(lines) + '\n')
    decoded = objects(result.stdout)
    assert result.returncode == DATA_BAD
    assert len(decoded) == 71
    assert [each['line'] for each in decoded] == list(range(1, 72))
    assert [each['text'] for each in decoded] == lines
    bad = [each for each in decoded if not each['ok']]
    assert len(bad) == 2 and all(each['error'] == 'crc' for each in bad)
    assert [re.search(r'PNum:(\d+)', each['text']).group(1) for each in bad] == ['7460', '7491']
    assert (bad[0]['expected'], bad[0]['found']) == ('0xc9640169', '0x306eb6ac')
    assert bad[0]['text'][bad[0]['position']:] == '306eb6ac^'


def test_decodes_numbers_as_numbers_and_several_values_as_an_array():
    first = objects(run('decode', stdin=captured_lines()[0]).stdout)[0]
    text = first.pop('text')
    assert text.startswith('AIN24:24.28;')
    assert first == {
        'line': 1, 'ok': True, 'type': 'state', 'pnum': 7434, 't': 79090,
        'fields': {'AIN24': 24.28, 'AIN12': 12.12, 'AIN5': 5.12, 'AINDMH': 12.11, 'DMHSTA': 1,
                   'AINSTEER': 1.03, 'DHB1A': [4095, 1], 'OSMC1': [400, 1], 'STEP1POS': -100,
                   'SERVO1POS': 2000}}


@pytest.mark.parametrize('fields, kind', [
    ('O:358,1,1', 'command'), ('H:ROS2-R4', 'heartbeat'), ('H:R4-ROS2', 'heartbeat'),
    ('N:66,RANGE', 'nack'), ('I:R4,0.1.0,sim-1,sim', 'identity'), ('AIN24:24.28;AIN12:1', 'state'),
    ('V:1', 'command'), ('O:358,1,1;O:358,1,2;S:1500,3', 'command')])
def test_decode_takes_what_encode_writes_and_names_its_type(fields, kind):
    decoded = objects(run('decode', stdin=run('encode', fields).stdout).stdout)
    assert len(decoded) == 1 and decoded[0]['ok'] and decoded[0]['type'] == kind
    assert decoded[0]['pnum'] == 0 and decoded[0]['t'] > 1_600_000_000_000


def test_decodes_the_commands_of_a_group_in_their_order():
    datagram = run('encode', 'O:1,1,1;S:1500,3;O:2,1,2;O:3,1,3').stdout
    assert objects(run('decode', stdin=datagram).stdout)[0]['fields'] == {
        'O': [[1, 1, 1], [2, 1, 2], [3, 1, 3]], 'S': [1500, 3]}


def test_decodes_a_heartbeat_without_a_packet_number():
    decoded = objects(run('decode', stdin='H:ROS2-R4;T:79201;^0xf390d9ad^').stdout)
    assert decoded[0]['pnum'] is None and decoded[0]['t'] == 79201


def test_decode_counts_lines_whatever_ends_them():
    good = run('encode', 'Q:ID', '--time', '1').stdout.strip()
    result = run('decode', stdin=f'{good}\r\n{good}\n\n{good}\r{good}')
    assert result.returncode == 0
    assert [each['line'] for each in objects(result.stdout)] == [1, 2, 4, 5]


def test_decode_goes_on_after_binary_junk():
    good = run('encode', 'Q:ID', '--time', '1').stdout.encode()
    junk = bytes(range(256)) * 20
    result = subprocess.run([R4, 'decode'], input=junk + b'\n' + good, capture_output=True, check=False)
    decoded = objects(result.stdout.decode('ascii'))
    assert result.returncode == DATA_BAD
    assert decoded[-1]['ok'] and decoded[-1]['fields'] == {'Q': 'ID'}
    assert not any(each['ok'] for each in decoded[:-1])


def test_decode_of_10_mb_without_a_terminator_needs_little_memory():
    with subprocess.Popen([R4, 'decode'], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdin.write(b'x' * 10_000_000)
        process.stdin.flush()
        with open(f'/proc/{process.pid}/status', encoding='ascii') as status:
            # Without the program and its libraries, which are files.
            own_kib = int(re.search(r'RssAnon:\s*(\d+)', status.read()).group(1))
        output, _ = process.communicate()
    assert process.returncode == DATA_BAD
    assert objects(output.decode()) == [
        {'line': 1, 'ok': False, 'error': 'length', 'position': 1024, 'size': 10_000_000}]
    print(f'its own memory {own_kib} KiB')
    assert SANITIZED or own_kib < 4_000


def test_decode_of_nothing_is_no_error():
    result = run('decode')
    assert (result.returncode, result.stdout) == (0, '')


# --- bad input: exit code, and a message with the fix

NO_BOARD = 'udp://127.0.0.1:9?listen=0'


@pytest.mark.parametrize('arguments, code, message', [
    ([], USAGE, 'none was given'),
    ([''], USAGE, "^r4: '': no such command"),
    (['frobnicate'], USAGE, 'frobnicate: no such command'),
    (['monitr', 'sim:'], USAGE, 'did you mean monitor'),
    (['monitor'], USAGE, 'URL: is missing'),
    (['monitor', 'sim:', '--jsn'], USAGE, 'did you mean --json'),
    (['monitor', 'sim:', '--count'], USAGE, '--count: needs a value'),
    (['monitor', 'sim:', '--count', '0'], USAGE, 'out of range'),
    (['monitor', 'sim:', '--count', 'many'], USAGE, 'is no whole number'),
    (['monitor', 'sim:', '--duration', '-1'], USAGE, 'is no time'),
    (['monitor', 'sim:', '--fields', 'AIN99'], USAGE, 'no such state field'),
    (['bench', 'sim:', 'sim:?node=2'], USAGE, 'a board of its own'),
    (['send', 'sim:', 'sim:?node=2', 'O:1,1,1'], USAGE, 'a board of its own'),
    (['monitor', 'ftp://192.168.1.77'], USAGE, "no transport 'ftp'"),
    (['monitor', 'nonsense'], USAGE, 'nonsense'),
    (['monitor', 'udp://'], USAGE, 'udp://'),
    (['monitor', 'udp://127.0.0.1:99999'], USAGE, '99999'),
    (['monitor', 'udp://127.0.0.1?speed=9'], USAGE, 'speed'),
    (['monitor', 'pty:/tmp/r4'], USAGE, 'pty:'),
    (['monitor', 'can:can0'], USAGE, 'as in can://can0'),
    (['monitor', 'can://can0/x?node=1'], USAGE, 'as in can://can0'),
    (['monitor', 'can://can0?fd'], USAGE, 'as in can://can0.node=1&fd=1'),
    (['sim', 'can://can0', 'can://can0?node=1'], USAGE, 'name a node once'),
    (['sim', 'serial:auto?baud=1'], USAGE, 'baud'),
    (['monitor', 'serial:///dev/tty-that-is-not-there'], OPEN, 'tty-that-is-not-there'),
    (['monitor', 'udp://no-such-host.invalid'], OPEN, 'no-such-host.invalid'),
    (['monitor', NO_BOARD, '--duration', '0.3'], REFUSED, 'nothing was heard'),
    (['send', NO_BOARD, 'O:1,1,1', '--timeout', '0.3'], REFUSED, 'not confirmed within 3'),
    (['stop', NO_BOARD, '--timeout', '0.3'], REFUSED, '^r4: E:STOP to udp://127.0.0.1:9.*CUT THE POWER'),
    (['stop', 'serial:///dev/tty-that-is-not-there'], OPEN, 'CUT THE POWER'),
    (['send', NO_BOARD, 'O:358,1'], USAGE, 'O:pwm,dir,ch'),
    (['send', NO_BOARD, 'O:358,1,5'], USAGE, 'no such channel.*ch 1-4'),
    (['send', NO_BOARD, 'O:5000,1,1'], USAGE, 'outside its range.*pwm 0-4095'),
    (['send', NO_BOARD, 'O:358,1,1;O:1,0,1'], USAGE, '^r4: O:1,0,1: is the second command for the same channel'),
    (['send', NO_BOARD, 'O:358,1,1;O:358,1,5'], USAGE, '^r4: O:358,1,5: no such channel'),
    (['send', NO_BOARD, 'O:358,1,1;C:rate,50'], USAGE, '^r4: C:rate,50: drives no output'),
    (['send', NO_BOARD, 'O:358,1,1;U:10,1'], USAGE, '^r4: U:10,1: drives no output'),
    (['send', NO_BOARD, 'O:358,1,1;E:STOP'], USAGE, '^r4: E:STOP: drives no output'),
    (['send', NO_BOARD, 'Q:ID;O:358,1,1'], USAGE, '^r4: Q:ID: drives no output'),
    (['send', NO_BOARD, 'O:358,1,1;;O:358,1,2'], USAGE, 'no such command'),
    (['send', NO_BOARD, ';'.join(f'S:1500,{i}' for i in range(1, 17)) + ';R:1,On'], USAGE, 'one more than the 16'),
    (['send', NO_BOARD, 'O:358,1,1;O:358,1,2', '--timeout', '0.3'], REFUSED, 'not confirmed within 3'),
    (['send', NO_BOARD, 'G:1'], USAGE, 'no such command; the commands are O:'),
    (['send', NO_BOARD, 'X:1'], USAGE, r'^r4: X:1: the board knows no such command.*use X:READ'),
    (['send', NO_BOARD, 'X:READ,3,x75,1'], USAGE, 'outside its range.*address 8-119'),
    (['send', NO_BOARD, 'X:READ,104,75,1'], USAGE, 'not the form.*bytes as x3B00'),
    (['send', NO_BOARD, 'X:POLL,104,x3b,14,10,9'], USAGE, 'no such channel.*slot 1-8'),
    (['send', NO_BOARD, 'X:POLL,104,x3b,14,4,1'], USAGE, 'outside its range.*5-60000 ms'),
    (['send', NO_BOARD, 'O:358,1,1;X:WRITE,104,x00'], USAGE, 'is a transfer of its own, so it cannot be part'),
    (['send', NO_BOARD, 'C:i2c1,104:3b:14:10'], USAGE, 'write i2c1,value with address:register:count:period'),
    (['send', NO_BOARD, 'hello'], USAGE, 'no such command'),
    (['send', NO_BOARD, 'O'], USAGE, 'O:pwm,dir,ch'),
    (['send', NO_BOARD, 'F:AIN99'], USAGE, 'F:'),
    (['send', NO_BOARD, 'C:rate,100000'], USAGE, 'C:'),
    (['send', NO_BOARD, 'H:ROS2-R4'], USAGE, 'heartbeats'),
    (['send', NO_BOARD, 'O:1,1,1^'], USAGE, 'O:'),
    (['encode', 'O:358,1,5'], USAGE, 'no such channel'),
    (['encode', 'O:5000,1,1'], USAGE, 'outside its range'),
    (['encode', 'O:1,1,1;O:2,1,1'], USAGE, '^r4: O:2,1,1: is the second command for the same channel'),
    (['encode', 'O:1,1,1;D:1,1,5'], USAGE, '^r4: D:1,1,5: no such channel'),
    (['encode', 'O:1,1,1;C:rate,50'], USAGE, '^r4: C:rate,50: drives no output'),
    (['encode', 'E:STOP;O:1,1,1'], USAGE, '^r4: E:STOP: drives no output'),
    (['encode', 'AIN24'], USAGE, 'is no field'),
    (['encode', 'A:1;^0x0^'], USAGE, 'is no field'),
    (['encode', 'A:1\nB:2'], USAGE, 'is no field'),
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
    (['sim', '--link', 'loss=101%'], USAGE, '^r4: loss=101%: is no number from 0 to 100'),
    (['sim', '--link', 'loss=5'], USAGE, '^r4: loss=5: is no share in percent; write a link as in loss=5%,delay=20ms'),
    (['sim', '--link', 'loss=5%,delay=10ms±20'], USAGE, '^r4: delay=10ms±20: varies by more than it is'),
    (['sim', '--link', 'cut=1s'], USAGE, '^r4: cut=1s: does not say for how long'),
    (['sim', '--link', 'speed=1'], USAGE, '^r4: speed=1: says nothing of a link'),
    (['sim', '--link', ''], USAGE, '--link|says nothing of a link'),
    (['sim', '--board-id', 'a,b'], USAGE, 'cannot be sent'),
    (['sim', '--board-id', 'x' * 65], USAGE, 'use 1 to 64'),
    (['monitor', 'udp://255.255.255.255'], USAGE, 'the address of many'),
    (['monitor', 'udp://224.0.0.1'], USAGE, 'the address of many'),
    (['sim', 'udp://127.0.0.1:0', 'pty:', 'pty:', 'pty:', 'pty:'], USAGE, 'at most 4'),
    (['completion', 'csh'], USAGE, 'bash, zsh or fish'),
    (['man', 'sned'], USAGE, 'there is no such command'),
    (['man', '--into', '/nowhere/at/all'], OPEN, 'folder'),
])
def test_bad_input_has_its_exit_code_and_a_message_with_the_fix(arguments, code, message):
    result = run(*arguments)
    assert result.returncode == code, result
    assert re.search(message, result.stderr), result.stderr
    assert ERROR.fullmatch(result.stderr.strip()), result.stderr


def test_encode_force_writes_what_no_board_takes():
    result = run('encode', 'O:5000,1,9', '--force', '--time', '1')
    assert result.returncode == 0 and result.stdout.startswith('O:5000,1,9;')


def test_a_wrong_command_keeps_all_from_being_sent():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        board.bind(('127.0.0.1', 0))
        board.setblocking(False)
        url = f'udp://127.0.0.1:{board.getsockname()[1]}?listen=0'
        assert run('send', url, 'O:1,1,1', 'O:5000,1,1').returncode == USAGE
        with pytest.raises(BlockingIOError):
            board.recv(2000)


def test_a_scenario_that_is_wrong_is_bad_data():
    with tempfile.NamedTemporaryFile('w') as file:
        file.write('0.5 handle released\n1 explode\n')
        file.flush()
        result = run('sim', 'udp://127.0.0.1:0', '--script', file.name)
    assert result.returncode == DATA_BAD
    assert f'{file.name}:2' in result.stderr and ERROR.match(result.stderr)


def test_a_board_tells_at_its_end_what_passed_over_its_transports(tmp_path):
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


def test_a_stop_goes_out_although_another_program_has_the_port_of_hosts():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board, \
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        board.bind(('127.0.0.1', 0))
        board.settimeout(5)
        try:
            other.bind(('0.0.0.0', 2390))
        except OSError:
            pass  # somebody has it: as well
        run('stop', f'udp://127.0.0.1:{board.getsockname()[1]}', '--timeout', '0.3')
        # A heartbeat may come first.
        assert any(board.recv(2000).startswith(b'E:STOP;') for _ in range(2))


def test_permission_denied_is_named_with_the_fix():
    master, slave = pty.openpty()
    device = os.ttyname(slave)
    os.chmod(device, 0)
    options = {}
    # Root may open anything: as root, somebody else asks. The build may be out of that one's reach.
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


def test_r4_alone_says_which_part_of_it_is_missing(tmp_path):
    program = shutil.copy(R4, tmp_path / 'r4')
    for command in ('ros2', 'metrics'):
        result = subprocess.run([program, command, 'sim:', '--for', '1'], capture_output=True, text=True, timeout=30,
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
    lost_errno = 'Input/output error'  # stdio does not keep it
    reason = 'No space left on device' if arguments[0] == 'sim' else f'(No space left on device|{lost_errno})'
    assert re.match(f'r4: standard output: {reason}; ', result.stderr), result.stderr


def test_a_board_does_not_wait_for_whoever_reads_its_log():
    """The pipe holds 64 KB, and nobody empties it; each command is a line or two."""
    with subprocess.Popen([R4, 'sim', 'udp://127.0.0.1:0', '--json', '--duration', '20'],
                          stdout=subprocess.PIPE, text=True) as board:
        url = json.loads(board.stdout.readline())['host_url'] + '?listen=0'
        result = run('send', url, *[f'O:{pwm},1,1' for pwm in range(1, 301)], timeout=60)
        assert result.returncode == 0, result
        monitor = run('monitor', url, '--json', '--duration', '3', timeout=60)
        states = [each for each in objects(monitor.stdout) if each['type'] == 'state']
        assert len(states) > 50
        board.terminate()
        written = board.stdout.read()
    events = objects(written)  # whole lines, nothing torn
    assert sum('executed' in each for each in events) > 100


def test_nothing_that_is_opened_takes_the_place_of_a_closed_output():
    closed = f'exec "{R4}" sim --quiet udp://127.0.0.1:0 <&- >&-'
    with subprocess.Popen(['bash', '-c', closed], stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + PATIENCE_S
        while len(os.listdir(f'/proc/{process.pid}/fd')) < 6 and time.monotonic() < deadline:
            time.sleep(0.01)
        streams = [os.readlink(f'/proc/{process.pid}/fd/{fd}') for fd in range(3)]
        process.kill()
    assert streams == ['/dev/null'] * 3


def test_with_json_an_error_is_an_object_too():
    result = run('monitor', 'serial:///dev/tty-that-is-not-there', '--json')
    error = objects(result.stdout)[-1]
    assert error['type'] == 'error' and error['kind'] == 'open'
    assert all(error[key] for key in ('thing', 'reason', 'fix'))
    assert f"r4: {error['thing']}: {error['reason']}; {error['fix']}\n" == result.stderr


# --- help, list, completion

def test_version():
    result = run('--version')
    assert result.returncode == 0 and re.fullmatch(r'r4 \d+\.\d+\.\d+\n', result.stdout)


def test_help_names_every_command_url_and_exit_code():
    result = run('--help')
    assert result.returncode == 0 and result.stderr == ''
    commands = result.stdout.split('\nCommands:\n')[1].split('\n\n')[0]
    assert re.findall(r'^  (\S+) +\S', commands, re.MULTILINE) == COMMANDS
    for word in ('udp://', 'serial:', 'pty:', 'sim:', 'Exit codes', 'r4 demo'):
        assert word in result.stdout


@pytest.mark.parametrize('command', COMMANDS)
def test_help_of_every_command_teaches(command):
    result = run(command, '--help')
    assert result.returncode == 0
    assert 'Usage: r4 ' + command in result.stdout and 'Exit codes' in result.stdout
    assert max(len(line) for line in result.stdout.splitlines()) <= 110


def test_list_names_ports_and_urls():
    assert run('list').returncode == 0
    listed = objects(run('list', '--json').stdout)
    assert {'udp', 'serial', 'pty', 'sim'} <= {each.get('scheme') for each in listed}


def complete(*words):
    """What bash offers for the last word."""
    script = '''
        source "$1"; shift
        COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
        _r4; printf '%s\\n' "${COMPREPLY[@]}"'''
    with tempfile.NamedTemporaryFile('w') as file:
        file.write(run('completion', 'bash').stdout)
        file.flush()
        result = subprocess.run(['bash', '-c', script, 'bash', file.name, *words],
                                capture_output=True, text=True, check=True)
    assert result.stderr == ''
    return result.stdout.split()


def test_bash_completes_commands_options_urls_and_files():
    assert complete('r4', 'mo') == ['monitor']
    assert set(COMMANDS) <= set(complete('r4', ''))
    assert complete('r4', 'monitor', '--js') == ['--json']
    assert {'--count', '--duration', '--fields', '--help'} <= set(complete('r4', 'monitor', '--'))
    assert complete('r4', 'sim', 'ud') == ['udp://']
    assert complete('r4', 'monitor', '--count', '') == []
    assert complete('r4', 'completion', '') == ['bash', 'zsh', 'fish']
    assert complete('r4', 'decode', DATA + '/paper_c') == [DATA + '/paper_capture.tsv']
    assert complete('r4', 'key', 'giv') == ['give']
    assert complete('r4', 'send', '--key', DATA + '/paper_c') == [DATA + '/paper_capture.tsv']
    assert complete('r4', 'sim', '--script', DATA + '/paper_c') == [DATA + '/paper_capture.tsv']


def test_fish_completes_commands_options_urls_and_files(tmp_path):
    script = tmp_path / 'r4.fish'
    script.write_text(run('completion', 'fish').stdout)

    def offered(*lines):
        """The words that fish offers at the end of each line."""
        asked = ''.join(f"complete -C '{line}'; echo; " for line in lines)
        result = subprocess.run(['fish', '--no-config', '-c', f'source {script}; {asked}'], capture_output=True, text=True,
                                check=True, env={**os.environ, 'HOME': str(tmp_path)})
        assert result.stderr == ''
        return [[word.split('\t')[0] for word in each.split('\n') if word]
                for each in result.stdout.split('\n\n')[:len(lines)]]

    commands, option, values, url, choices, path = offered(
        'r4 ', 'r4 monitor --co', 'r4 monitor --count ', 'r4 --json monitor ud', 'r4 completion ',
        f'r4 send --key {DATA}/paper_c')
    assert set(COMMANDS) <= set(commands) and 'udp://' not in commands
    assert option == ['--control', '--count']
    assert not {'monitor', '--json'} & set(values)
    assert url == ['udp://']
    assert sorted(choices) == ['bash', 'fish', 'zsh']
    assert path == [DATA + '/paper_capture.tsv']


@pytest.mark.parametrize('shell', ['bash', 'zsh', 'fish'])
def test_completion_scripts_are_valid_in_their_shell(shell):
    script = run('completion', shell).stdout
    assert all(command in script for command in COMMANDS)
    result = subprocess.run([shell, '-n', '/dev/stdin'], input=script, capture_output=True, text=True,
                            check=False)
    assert (result.returncode, result.stderr) == (0, '')


def test_manual_pages_say_what_the_help_says_and_checkers_find_nothing(tmp_path):
    assert run('man', '--into', str(tmp_path)).returncode == 0
    pages = sorted(tmp_path.iterdir())
    assert {page.name for page in pages} >= {'r4.1', *(f'r4-{command}.1' for command in COMMANDS)}
    lint = subprocess.run(['mandoc', '-T', 'lint', *pages], capture_output=True, text=True, check=False)
    assert (lint.returncode, lint.stdout, lint.stderr) == (0, '', '')

    def words_of(text):
        return set(re.findall(r'[\w./=]{4,}', text.lower()))

    for page in pages:
        command = page.stem.removeprefix('r4').removeprefix('-')
        shown = subprocess.run(['mandoc', '-T', 'utf8', '-O', 'width=500', page], capture_output=True, text=True,
                               check=True).stdout
        shown = re.sub('.\b', '', shown)  # what is bold or underlined is printed twice
        told = run(*command.split(), '--help').stdout
        assert words_of(told) - words_of(shown) <= {'usage', 'codes', 'excludes'}, command
    assert run('man').stdout == (tmp_path / 'r4.1').read_text()
    assert run('man', 'send').stdout == (tmp_path / 'r4-send.1').read_text()


def test_every_json_line_of_decode_is_ascii():
    result = subprocess.run([R4, 'decode'], input='gr\u00fc\u00dfe;\n'.encode(), capture_output=True,
                            check=False)
    assert json.loads(result.stdout.decode('ascii'))['text'] == 'gr\\xc3\\xbc\\xc3\\x9fe;'
