# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 record beside a driving program, after a kill, and on a full disk, and r4 info on the recordings."""
import contextlib
import datetime
import re
import resource
import signal
import socket
import subprocess
import time

import pytest

from r4_process import (ERROR, PATIENCE_S, R4, Board, Running, driving, lasts, objects, run, text_of,
                        wait_for)

DATA_BAD, USAGE, REFUSED, OPEN = 1, 2, 3, 4


@pytest.fixture(name='board')
def a_board():
    with Board('udp://127.0.0.1:0') as board:
        yield board


@contextlib.contextmanager
def record(*arguments, **options):
    with Running('record', *map(str, arguments), **options) as recorder:
        yield recorder


def info(*paths):
    """Returns the objects of r4 info, and its exit code."""
    told = run('info', '--json', *map(str, paths))
    return objects(told.stdout), told.returncode


def test_record_includes_commands_of_a_program_on_the_same_path(tmp_path):
    path = tmp_path / 'drive.r4log'
    with Board(f'pty:{tmp_path}/r4') as board, record(board.host_url, '-o', path) as recorder:
        wait_for(path, r'^[0-9.]+ 1< AIN24')
        # The recorder receives only commands sent after the recorder has connected to the program that holds the path.
        commands = [f'O:{pwm},1,1' for pwm in range(319, 359)]
        with driving(board.host_url, *commands) as host:
            wait_for(path, r'^[0-9.]+ 1> H:ROS2-R4')
            wait_for(path, r'^[0-9.]+ 1> O:358,1,1')
            host.end()
        wait_for(path, r'OSMC1:0,.*SAFE:1;')
        assert recorder.end() == 0, recorder.errors
    (told,), code = info(path)
    assert code == 0 and told['ended'] and told['paths'][0]['heartbeats'] > 0, told


@pytest.mark.parametrize('name', ['drive.r4log', 'drive.r4log.zst'])
def test_records_beside_a_program_that_drives(board, tmp_path, name):
    path = tmp_path / name
    with record(board.host_url, '-o', path) as recorder:
        wait_for(path, r'^[0-9.]+ 1< AIN24')
        with driving(board.host_url, 'O:358,1,1') as host:
            wait_for(path, r'OSMC1:358,1;')
            host.end()
        wait_for(path, r'OSMC1:0,.*SAFE:1;')
        assert recorder.end() == 0, recorder.errors
    assert not [each for each in board.log if each.get('reason') == 'watchdog']
    (told,), code = info(path)
    assert code == 0 and told['ended'] and not told['damage'], told
    heard = told['paths'][0]
    assert heard['name'] == 'sim-1' and heard['url'].startswith('udp://127.0.0.1:')
    assert heard['damaged'] == 0 and heard['lost'] == 0 and heard['states'] >= 10, heard
    assert heard['safe']['link'] >= 1
    assert heard['heartbeats'] == 0, 'a watcher sent a heartbeat'
    lines = [line for line in text_of(path).splitlines() if ' 1< ' in line]
    assert run('decode', stdin='\n'.join(line.split('< ', 1)[1] for line in lines)).returncode == 0
    assert lines == sorted(lines, key=lambda line: float(line.split(' ')[0]))


def test_monitor_reads_a_recording_as_a_transport(board, tmp_path):
    path = tmp_path / 'drive.r4log.zst'
    with record(board.host_url, '-o', path) as recorder, driving(board.host_url, 'O:358,1,1'):
        wait_for(path, 'OSMC1:358,1;')
        assert recorder.end() == 0
    recorded = re.findall(r' 1< (AIN24.*)$', text_of(path), re.MULTILINE)
    decoded = objects(run('decode', stdin='\n'.join(recorded)).stdout)
    shown = objects(run('monitor', f'replay:{path}?speed=2', '--json', '--count', str(len(recorded))).stdout)
    states = [each for each in shown if each['type'] == 'state']
    assert [(each['pnum'], each['fields']) for each in states] == \
        [(each['pnum'], each['fields']) for each in decoded]
    assert run('send', f'replay:{path}', 'O:1,1,1', '--timeout', '0.5').returncode == REFUSED


@pytest.fixture(name='recorded')
def a_recording(board, tmp_path):
    path = tmp_path / 'drive.r4log'
    with driving(board.host_url, 'O:358,1,1'):
        assert run('record', board.host_url, '-o', str(path), '--duration', '0.5').returncode == 0
    return path


@pytest.mark.parametrize('where', ['udp://127.0.0.1:0', 'pty'])
def test_replay_acts_as_a_board_for_other_hosts(recorded, tmp_path, where):
    was = re.findall(r' 1< AIN24.*PNum:(\d+)', recorded.read_text())
    url = f'pty:{tmp_path}/r4' if where == 'pty' else where
    with Running('replay', str(recorded), url, '--speed', '0.2', '--json') as replay:
        host_url = replay.next(lambda each: each['type'] == 'listening')['host_url']
        host_url += '?listen=0' if where.startswith('udp') else ''
        shown = objects(run('monitor', host_url, '--json', '--count', '10').stdout)
        states = [each for each in shown if each['type'] == 'state']
        assert len(states) == 10 and {str(each['pnum']) for each in states} <= set(was)
        refused = run('send', host_url, 'O:1,1,1', '--timeout', '0.3')
        assert refused.returncode == 3, refused
        assert replay.end() == 0, replay.errors


def test_replay_obeys_the_option_speed(tmp_path):
    path = tmp_path / 'slow.r4log'
    path.write_text('# r4log 1 by r4\n' + ''.join(f'179546829{i}.000000 1< no datagram\n' for i in range(6)))
    began = time.monotonic()
    result = run('replay', str(path), 'udp://127.0.0.1:0', '--speed', '5')
    took = time.monotonic() - began
    assert result.returncode == 0 and '6 datagrams' in result.stdout, result
    assert 1 <= took < 3, 'the replay of 5 s at speed 5 did not take about 1 s'


def test_replay_steps_from_any_time_and_reports_damage(recorded):
    with recorded.open('a') as file:
        file.write('no line of a recording\n' + recorded.read_text().splitlines()[-2] + '\n')
    was = re.findall(r'^[\d.]+ 1< (.*)$', recorded.read_text(), re.MULTILINE)
    ended = run('replay', str(recorded), 'udp://127.0.0.1:0', '--step', stdin='\n' * 1000)
    assert [line.split(' ', 1)[1] for line in ended.stdout.splitlines()[1:-1]] == was
    assert ended.returncode == DATA_BAD and re.search(r'line \d+: the line does not begin with a time', ended.stderr), ended
    first = float(re.search(r'^([\d.]+) 1', recorded.read_text(), re.MULTILINE)[1])
    said = re.findall(r'^([\d.]+) 1< (.*)$', recorded.read_text(), re.MULTILINE)
    then = next(datagram for at, datagram in said if float(at) >= first + 0.2)
    for start in ('0.2', datetime.datetime.fromtimestamp(first + 0.2, datetime.timezone.utc).isoformat()[:26]):
        late = run('replay', str(recorded), 'udp://127.0.0.1:0', '--step', '--from', start, stdin='\n')
        assert late.stdout.splitlines()[1].split(' ', 1)[1] == then, late
    for arguments, code in ((['--path', '7'], DATA_BAD), (['--speed', '0'], USAGE), (['--from', 'x'], USAGE)):
        wrong = run('replay', str(recorded), *arguments)
        assert wrong.returncode == code and ERROR.search(wrong.stderr), wrong


def test_records_several_boards_into_one_file(tmp_path):
    path = tmp_path / 'two.r4log'
    with Board('udp://127.0.0.1:0') as left, Board(f'pty:{tmp_path}/r4') as right:
        ended = run('record', left.host_url, right.host_url, '-o', str(path), '--duration', '1')
        assert ended.returncode == 0, ended.stderr
        assert re.search(r'two.r4log: \d+ datagrams and events in 1\.\d s', ended.stdout)
    (told,), code = info(path)
    assert code == 0 and [path['path'] for path in told['paths']] == [1, 2]
    assert all(path['states'] >= 10 for path in told['paths']), told


@pytest.mark.parametrize('name, most_bytes', [('many.r4log', 200), ('many.r4log.zst', 40)])
def test_records_the_boards_of_a_url_pattern(tmp_path, name, most_bytes):
    path = tmp_path / name
    first = 28600
    ports = f'udp://127.0.0.1:{first}-{first + 9}'
    with Board(ports, listens=10):
        ended = run('record', f'{ports}?listen=0', '-o', str(path), '--duration', '1')
        assert ended.returncode == 0, ended.stderr
    (told,), code = info(path)
    assert code == 0 and [path['name'] for path in told['paths']] == [f'sim-{first + i}' for i in range(10)]
    assert all(path['states'] >= 10 for path in told['paths']), told
    text = text_of(path)
    states = re.findall(r'^[0-9.]+ [0-9]+< AIN24.*\n', text, re.MULTILINE)
    state_bytes = path.stat().st_size * len(''.join(states)) / len(text) / len(states)
    print(f'{state_bytes:.0f} bytes a state')
    assert state_bytes <= most_bytes


def newest_states(path):
    """The time of the newest state of each path."""
    found = re.findall(r'^([\d.]+) (\d+)< AIN24.*\^$', text_of(path), re.MULTILINE) if path.exists() else []
    return {path: float(when) for when, path in found}


@pytest.mark.parametrize('name', ['drive.r4log', 'drive.r4log.zst'])
def test_a_killed_recorder_loses_at_most_one_second(tmp_path, name):
    path = tmp_path / name
    ports = 'udp://127.0.0.1:28620-28627'
    with Board(ports, listens=8):
        for run_number in range(3):
            began = time.time()
            with record(f'{ports}?listen=0', '-o', path) as recorder:
                deadline = time.monotonic() + PATIENCE_S
                while sum(when > began for when in newest_states(path).values()) < 8:
                    assert time.monotonic() < deadline, newest_states(path)
                    lasts(0.02)
                lasts(0.3 + 0.17 * run_number)
                before = time.time()
                recorder.signal(signal.SIGKILL)
                recorder.wait()
            newest = newest_states(path)
            print(f'{name}: {before - min(newest.values()):.3f} s of it are missing')
            assert len(newest) == 8 and before - min(newest.values()) <= 1.0
            (told,), code = info(path)
            assert not told['ended'] and all(path['states'] >= 10 for path in told['paths'])
            for each in told['damage']:
                assert each['kind'] in ('torn', 'zstd'), told['damage']
            assert code == (DATA_BAD if told['damage'] else 0)
            if name == 'drive.r4log':
                assert len(told['damage']) <= run_number + 1
            if name.endswith('.zst'):
                path.unlink()


@pytest.mark.parametrize('limit', [10, 20_000])  # the header alone is longer than 10 bytes
def test_a_file_size_limit_ends_the_recording_with_an_error(board, tmp_path, limit):
    full = run('record', board.host_url, '-o', str(tmp_path / 'drive.r4log'), '--duration', '20', timeout=15,
               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    assert full.returncode == OPEN and ERROR.search(full.stderr), full
    assert 'the recording has ended: File too large' in full.stderr


def test_record_starts_a_new_file_when_its_file_is_moved_or_removed(board, tmp_path):
    path, moved = tmp_path / 'drive.r4log', tmp_path / 'drive.r4log.1'
    with record(board.host_url, '-o', path) as recorder:
        wait_for(path, ' 1< AIN24')
        path.rename(moved)  # as logrotate does
        wait_for(path, ' 1< AIN24')
        assert recorder.end() == 0, recorder.errors
    for each in (path, moved):
        (told,), code = info(each)
        assert code == 0 and told['paths'][0]['name'] == 'sim-1' and not told['damage'], told
    path = tmp_path / 'removed.r4log'
    with record(board.host_url, '-o', path) as recorder:
        wait_for(path, ' 1< AIN24')
        path.unlink()
        wait_for(path, ' 0! warning ')
        assert recorder.end() == DATA_BAD
    assert ERROR.search(recorder.errors) and 'the earlier records are lost' in recorder.errors
    (told,), code = info(path)
    assert code == 0 and told['ended'] and not told['damage'], told


def test_a_full_disk_ends_the_recording_with_a_reason(board, tmp_path):
    # The file system ends with its new namespace. If the namespace is refused, unshare reports the reason.
    script = ('mount -t tmpfs -o size=16k none "$1" && cd "$1" && "$2" record "$3" -o drive.r4log; echo $?;'
              ' "$2" info drive.r4log')
    full = subprocess.run(['unshare', '--map-root-user', '--mount', 'sh', '-c', script, 'sh', tmp_path, R4,
                           board.host_url], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert full.stdout, f'the test could not make a file system to fill: {full.stderr}'
    code, *told = full.stdout.splitlines()
    assert int(code) == OPEN and 'the recording has ended: No space left on device' in full.stderr, full
    assert ERROR.search(full.stderr) and full.returncode == 0, full
    assert not any('damage' == line.split()[0] for line in told), told


def test_record_keeps_the_beginning_of_an_oversized_datagram(tmp_path):
    path = tmp_path / 'drive.r4log'
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as talker:
        talker.bind(('127.0.0.1', 0))
        talker.settimeout(PATIENCE_S)
        with record(f'udp://127.0.0.1:{talker.getsockname()[1]}?listen=0', '-o', path):
            _, host = talker.recvfrom(2048)
            talker.sendto(b'x' * 3000, host)
            wait_for(path, r'^[0-9.]+ 1! oversize x{1024}$')
    (told,), _ = info(path)
    assert told['paths'][0]['oversize'] == 1 and told['paths'][0]['damaged'] == 0, told


def test_every_rotated_file_is_a_complete_recording(board, tmp_path):
    with record(board.host_url, '-o', tmp_path / 'drive.r4log', '--rotate', '1s', '--rotate', '1M'):
        wait_for(tmp_path / 'drive-00003.r4log', ' 1< AIN24')
    told, _ = info(*sorted(tmp_path.glob('drive-*.r4log')))
    assert len(told) >= 3 and all(each['paths'][0]['name'] == 'sim-1' for each in told[1:])
    assert all(each['seconds'] <= 1.0 for each in told)


def test_record_fails_if_the_board_is_silent(tmp_path):
    silent = run('record', 'udp://127.0.0.1:9?listen=0', '-o', str(tmp_path / 'x.r4log'), '--duration', '0.3')
    assert silent.returncode == REFUSED and ERROR.search(silent.stderr), silent


def test_info_locates_damage_and_reads_the_rest(tmp_path):
    path = tmp_path / 'x.r4log'
    good = '1795468293.404765 1< H:R4-ROS2;PNum:0;T:0;^0x1^\n'
    path.write_text('# r4log 1 by r4\n' + good + '17954x\n' + good + good[:20])
    result = run('info', str(path))
    assert result.returncode == DATA_BAD
    assert 'line 3, byte 64: the line does not begin with a time' in result.stdout
    assert 'line 5, byte 119: the last line is not complete' in result.stdout
    assert info(path)[0][0]['records'] == 2


def test_info_reads_a_pipe():
    text = '# r4log 1 by r4\n1795468293.404765 1! up x\n'
    result = run('info', '-', stdin=text)
    assert result.returncode == 0 and '2026-11-23T21:11:33.404765Z' in result.stdout
    assert result.stdout.startswith('standard input\n')


def test_control_characters_of_a_recording_are_not_printed(tmp_path):
    path = tmp_path / 'others.r4log'
    path.write_text('# r4log 1 by r4 0.1.0\n# path 1 udp://x\\x1b]0;owned\\x07\\x0afake arm\\x1b]0;owned\\x07\n'
                    '1795468293.000000 1< garbage\\x1b]0;owned\\x07\n'
                    '1795468293.000001 1! down \\x1b]0;owned\\x07\n')
    for arguments in (('info', path), ('info', '--json', path), ('replay', path, 'udp://127.0.0.1:0', '--step'),
                      ('convert', path, '-o', tmp_path / 'o.csv'), ('monitor', f'replay:{path}', '--duration', '1')):
        told = run(*map(str, arguments), stdin='\n\n')
        shown = told.stdout + told.stderr
        assert shown.replace('\n', '').isprintable(), (arguments, shown)
        assert '\nfake' not in shown
    assert r'garbage\x1b]0;owned\x07' in run('replay', str(path), 'udp://127.0.0.1:0', '--step', stdin='\n\n').stdout
    assert (tmp_path / 'o.csv').read_text().replace('\n', '').isprintable()


@pytest.mark.parametrize('arguments, message', [
    (['sim:'], '--output: is missing'),
    (['sim:', '-o', 'x', '--rotate', '5'], 'is neither a size nor a time'),
    (['sim:', '-o', 'x', '--keep', '1K'], 'is too little'),
    (['sim:', '-o', 'x', '--keep', '2M', '--rotate', '1M'], 'the limit is too small for the size of the files'),
    (['sim:', '-o', 'x', '--duration', '0'], 'is too short'),
])
def test_wrong_uses_are_refused_before_anything_is_opened(tmp_path, arguments, message):
    result = run('record', *arguments, cwd=tmp_path)
    assert result.returncode == USAGE and message in result.stderr and ERROR.search(result.stderr), result
    assert not list(tmp_path.iterdir())
