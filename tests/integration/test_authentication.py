# SPDX-License-Identifier: GPL-3.0-or-later
"""A second implementation can drive a board with a key, and an attacker cannot. Also tests r4 with keys."""
import os
import pathlib
import pwd
import re
import shutil
import socket
import stat
import subprocess
import tempfile

import pytest
from r4_process import ERROR, R4, Board, monitor, run
from signing import SigningHost, closed

KEY = bytes(range(32))
OTHER = bytes(range(1, 33))


def key_setting(number, key):
    return f'key,{number}:{key.hex()}'


@pytest.fixture
def board():
    with Board('udp://127.0.0.1:0', options=('--set', key_setting(3, KEY), '--set', key_setting(5, OTHER))) as it:
        yield it


@pytest.fixture
def host(board):
    it = SigningHost(board.url, 3, KEY)
    it.connect()
    it.run(seconds=0.15)  # after this pause, the board may answer an unsigned heartbeat again
    yield it
    it.close()


@pytest.fixture
def stranger():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as it:
        it.bind(('127.0.0.1', 0))
        yield it


def write_key(path, text, mode=0o600):
    path.write_text(text, encoding='ascii')
    path.chmod(mode)
    return str(path)


def pwm(host):
    return host.state.get('OSMC1')


def driven(host, speed):
    return host.run(lambda: pwm(host) == f'{speed},1')


def test_a_second_implementation_drives_the_board(board, host):
    number, _ = host.command('O:358,1,1')
    assert host.executed(number) and driven(host, 358)
    board.executed('O:358,1,1')


def test_the_board_accepts_signed_datagrams_of_every_length(host):
    for size in range(0, 140):
        number, bytes_ = host.command(f'O:{size},1,1', more=f'PAD:{"x" * size};')
        assert host.executed(number), (size, len(bytes_))


def test_a_replay_is_not_executed_and_a_stranger_gets_no_answer(board, host, stranger):
    number, bytes_ = host.command('O:358,1,1')
    assert host.executed(number)
    number, _ = host.command('O:0,1,1')
    assert host.executed(number)
    board.skip_past()
    host.send(bytes_, host.socket)
    board.next(lambda each: each.get('refused', {}).get('code') == 'DUPLICATE'
               or each.get('rejected') == 'replayed')  # on a slow machine the replayed datagram is too old
    host.send(bytes_, stranger)
    board.next(lambda each: each.get('rejected') == 'replayed')
    stranger.settimeout(0.3)
    with pytest.raises(TimeoutError):
        stranger.recv(2048)
    assert host.run(lambda: False, 0.3) is False
    assert pwm(host) == '0,1' and {code for _, code in host.refused} <= {'DUPLICATE'}


@pytest.mark.parametrize('kind', ['old', 'future', 'foreign', 'unknown', 'cut', 'none', 'nonce'])
def test_a_command_without_a_valid_signature_is_not_executed(board, host, kind):
    fields = host.fields('O:358,1,1')
    if kind == 'old':
        bytes_, why = host.signed(fields, board_t=host.board_t - 300), 'old'
    elif kind == 'future':
        bytes_, why = host.signed(fields, board_t=host.board_t + 5000), 'old'
    elif kind == 'foreign':
        bytes_, why = host.signed(fields, key=OTHER), 'wrong tag'
    elif kind == 'unknown':
        bytes_, why = host.signed(fields, key_id=4), 'unknown key'
    elif kind == 'cut':
        whole = host.signed(fields).split(b'^')[0].decode()
        bytes_, why = closed(whole[:whole.rindex(',')] + ';'), 'missing'
    elif kind == 'none':
        bytes_, why = closed(fields), 'missing'
    else:
        nonce, host.nonce = host.nonce, '0123456789abcdef'
        bytes_, why = host.signed(fields), 'wrong tag'
        host.nonce = nonce
    host.send(bytes_)
    board.next(lambda each: each.get('rejected') == why)
    number, _ = host.command('S:1500,1')
    assert host.executed(number)
    assert pwm(host) == '0,0'
    answered = why not in ('old', 'replayed')
    assert [code for _, code in host.refused] == (['AUTH'] if answered else [])


def test_a_stop_needs_no_signature_but_its_clear_does(board, host, stranger):
    number, _ = host.command('O:358,1,1')
    assert host.executed(number)
    nonce = host.nonce
    host.send(closed('E:STOP;'), stranger)
    board.state('SAFE', 'stop')
    assert host.run(lambda: host.reasons and host.reasons[-1] == 2)
    assert host.nonce != nonce, 'the safe state has the same nonce as before'
    host.send(closed('E:CLEAR;PNum:1;T:1;'), stranger)
    board.next(lambda each: each.get('rejected') == 'missing')
    number, _ = host.command(f'E:CLEAR,{host.cause}')
    assert host.executed(number)
    assert host.run(lambda: host.state.get('SAFE') == '0')


def test_r4_drives_a_board_only_with_its_key(board, tmp_path):
    key = write_key(tmp_path / 'key', f'3:{KEY.hex()}\n')
    sent = run('send', board.host_url, 'O:358,1,1', 'D:1000,1,1', '--key', key)
    assert sent.returncode == 0, sent.stderr
    sent = run('send', board.host_url, 'O:358,1,1', env={**os.environ, 'R4_KEY': key})
    assert sent.returncode == 0, sent.stderr
    sent = run('send', board.host_url, 'O:99,1,1', '--timeout', '2')
    assert sent.returncode == 3 and '--key FILE' in sent.stderr and ERROR.match(sent.stderr)
    wrong = write_key(tmp_path / 'wrong', f'3:{OTHER.hex()}')
    sent = run('send', board.host_url, 'O:99,1,1', '--timeout', '2', '--key', wrong)
    assert sent.returncode == 3 and 'signed with our key' in sent.stderr
    stopped = run('stop', board.host_url)
    assert stopped.returncode == 0, stopped.stderr
    assert not [each for each in board.log if 'O:99,1,1' in str(each)]


def test_r4_with_a_key_refuses_a_board_without_a_key(tmp_path):
    key = write_key(tmp_path / 'key', f'3:{KEY.hex()}\n')
    with Board('udp://127.0.0.1:0') as board:
        sent = run('send', board.host_url, 'O:358,1,1', '--timeout', '1.5', '--key', key)
        assert sent.returncode == 3 and 'the board has no key' in sent.stderr
        stopped = run('stop', board.host_url, '--key', key)
        assert stopped.returncode == 0, stopped.stderr
        with monitor(board.host_url, '--key', key) as watcher:
            watcher.next(lambda each: each['type'] == 'link' and 'board has no key' in each['fields']['causes'])
        assert not [each for each in board.rest() if 'O:358' in str(each)]


def test_r4_key_gives_and_removes_a_key_only_over_a_cable(tmp_path):
    file = tmp_path / 'key'
    made = run('key', 'new', str(file), '--id', '7')
    assert made.returncode == 0, made.stderr
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert re.fullmatch(r'7:[0-9a-f]{64}\n', file.read_text(encoding='ascii'))
    again = run('key', 'new', str(file))
    assert again.returncode == 4 and 'never overwritten' in again.stderr
    with Board(f'pty:{tmp_path}/cable', 'udp://127.0.0.1:0') as board:
        cable = f'serial://{tmp_path}/cable'
        network = [each for each in board.log if each['type'] == 'listening'][1]['host_url'] + '?listen=0'
        refused = run('key', 'give', str(file), network)
        assert refused.returncode == 2 and 'over USB' in refused.stderr
        given = run('key', 'give', str(file), cable)
        assert given.returncode == 0, given.stderr
        board.executed('C:key,7:...')
        assert file.read_text(encoding='ascii').strip()[2:] not in str(board.log)
        driven_by_cable = run('send', cable, 'O:358,1,1')
        assert driven_by_cable.returncode == 0, 'a host on the cable needed a key'
        board.state('SAFE', 'link')
        assert run('send', network, 'O:1,1,1', '--timeout', '1.5').returncode == 3
        signed = run('send', network, 'O:1,1,1', '--key', str(file))
        assert signed.returncode == 0, signed.stderr
        board.state('SAFE', 'link')
        assert run('send', cable, 'C:key,7:off').returncode == 0
        board.state('SAFE', 'link')
        assert run('send', network, 'O:1,1,1').returncode == 0


@pytest.mark.parametrize('mode, text, code, words', [
    (0o644, f'3:{"0" * 64}', 5, 'chmod 600'),
    (0o620, f'3:{"0" * 64}', 5, 'chmod 600'),
    (0o600, f'0:{"0" * 64}', 1, 'does not hold a key'),
    (0o600, f'3:{"0" * 63}', 1, 'does not hold a key'),
    (0o600, '', 1, 'does not hold a key'),
    (0o600, f'3:{"0" * 64}' + 'x' * 10000, 1, 'does not hold a key'),
])
def test_a_key_file_that_is_invalid_or_readable_by_others_is_refused(tmp_path, mode, text, code, words):
    file = write_key(tmp_path / 'key', text, mode)
    for command in (('monitor',), ('send', 'O:1,1,1'), ('bench',)):
        done = run(command[0], 'udp://127.0.0.1:9', *command[1:], '--key', file)
        assert done.returncode == code, done.stderr
        assert words in done.stderr and ERROR.match(done.stderr)


def test_a_missing_key_file_is_named_but_does_not_prevent_a_stop(board, tmp_path):
    missing = str(tmp_path / 'missing')
    done = run('send', board.host_url, 'O:1,1,1', '--key', missing)
    assert done.returncode == 4 and missing in done.stderr
    stopped = run('stop', board.host_url, '--key', missing, env={**os.environ, 'R4_KEY': missing})
    assert stopped.returncode == 0, stopped.stderr


def test_a_stopped_board_accepts_a_key_and_its_removal(tmp_path):
    with Board(f'pty:{tmp_path}/cable') as board:
        cable = f'serial://{tmp_path}/cable'
        assert run('stop', cable).returncode == 0
        given = run('key', 'give', write_key(tmp_path / 'key', f'3:{KEY.hex()}\n'), cable)
        assert given.returncode == 0, given.stderr
        board.executed('C:key,3:...')
        taken = run('send', cable, 'C:key,3:off')
        assert taken.returncode == 0 and taken.stdout.startswith('C:key,3:off  confirmed')
        board.executed('C:key,3:off')


def test_a_key_file_of_another_user_is_a_permission_error():
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        key = write_key(pathlib.Path(folder, 'key'), f'3:{KEY.hex()}')
        program = [R4]
        options = {}
        if os.geteuid() == 0:  # root may read anything, so another user runs r4 from a folder that this user can read
            program = [shutil.copy(R4, os.path.join(folder, 'r4'))]
            nobody = pwd.getpwnam('nobody')
            options = {'user': nobody.pw_uid, 'group': nobody.pw_gid, 'extra_groups': []}
        else:
            os.chmod(key, 0)
        done = subprocess.run([*program, 'monitor', 'udp://127.0.0.1:9', '--key', key], check=False, text=True,
                              capture_output=True, timeout=10, **options)
    assert done.returncode == 5, done
    assert 'run this as the owner of the key' in done.stderr and ERROR.match(done.stderr)


@pytest.mark.parametrize('arguments, code, words', [
    (['monitor', 'udp://127.0.0.1:9', '--key', ''], 2, '--key: does not name a file'),
    (['monitor', 'udp://127.0.0.1:9', '--key', '/'], 4, '/: is a directory; give the file'),
    (['monitor', 'udp://127.0.0.1:9', '--key=~/.no-key'], 4, 'write $HOME/.no-key'),
    (['key', 'new', ''], 2, 'is not a file; name a file: r4 key new FILE'),
    (['key', 'new', 'serial:auto'], 2, 'is not a file; name a file: r4 key new FILE'),
    (['key', 'new', '/no-such-folder/key'], 4, 'a folder that you may write to'),
    (['key', 'new', 'key', '--id', '10'], 2, 'write 1 to 9'),
    (['key', 'new', 'key', 'serial:auto'], 2, 'is not needed for a new key'),
    (['key', 'give', 'serial:auto', 'key'], 2, 'is not a file; name a file: r4 key give FILE serial:auto'),
    (['key', 'give', 'key'], 2, 'URL: is missing'),
    (['key', 'give', 'key', 'serial:auto', '--id', '3'], 2, 'r4 key new FILE --id N'),
    (['key', 'give', '/no/such/key', 'serial:auto'], 4, '/no/such/key: No such file'),
    (['key', 'give', 'key', 'can://can0'], 2, 'over USB only'),
    (['key', 'take', 'key'], 2, 'use new or give'),
])
def test_wrong_uses_of_keys_are_refused_with_a_fix(arguments, code, words):
    done = run(*arguments)
    assert done.returncode == code, done.stderr
    assert words in done.stderr and ERROR.fullmatch(done.stderr.strip())


@pytest.mark.parametrize('command', [f'C:key,1:{KEY.hex()}', 'C:password,letmein!'])
def test_a_key_or_password_is_never_sent_over_a_network(stranger, command):
    url = f'udp://127.0.0.1:{stranger.getsockname()[1]}?listen=0'
    done = run('send', url, 'O:1,1,1', command)
    assert done.returncode == 2 and 'over USB only' in done.stderr and ERROR.match(done.stderr)
    assert KEY.hex() not in done.stderr and 'letmein' not in done.stderr
    stranger.setblocking(False)
    with pytest.raises(BlockingIOError):
        stranger.recv(2048)


def test_a_second_host_with_its_own_key_is_refused_as_busy(board, host):
    other = SigningHost(board.url, 5, OTHER)
    assert other.run(lambda: other.nonce is not None)
    other.command('O:77,1,1')
    assert other.run(lambda: other.refused, 5, beats=False)
    assert other.refused[0][1] == 'BUSY'
    number, _ = host.command('O:358,1,1')
    assert host.executed(number)
    other.close()


def test_a_wrong_key_is_reported_even_after_a_stop(board, tmp_path):
    key = write_key(tmp_path / 'key', f'3:{KEY.hex()}')
    wrong = write_key(tmp_path / 'wrong', f'3:{OTHER.hex()}')
    for _ in range(2):
        assert run('send', board.host_url, 'E:CLEAR', 'O:358,1,1', '--key', key).returncode == 0
        assert run('stop', board.host_url, '--key', key).returncode == 0
        with monitor(board.host_url, '--key', wrong) as watcher:
            told = watcher.next(lambda each: each['type'] == 'link' and 'key' in str(each['fields']['causes']))
        assert 'key not taken' in told['fields']['causes']
        sent = run('send', board.host_url, 'O:99,1,1', '--timeout', '1', '--key', wrong)
        assert sent.returncode == 3 and 'signed with our key' in sent.stderr, sent.stderr
    assert not [each for each in board.log if 'O:99,1,1' in str(each)]


def test_monitor_reports_that_the_board_needs_a_key(board):
    with monitor(board.host_url) as watcher:
        watcher.next(lambda each: each['type'] == 'link' and each['fields']['causes'] == ['key needed'])
