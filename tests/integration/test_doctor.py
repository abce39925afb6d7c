# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 doctor: a healthy link, and faulty links."""
import os
import pathlib
import socket
import subprocess
import sys
import threading
import zlib

from r4_process import PATIENCE_S, Board, objects, run

REFUSED, OPEN = 3, 4
RULES = pathlib.Path(__file__).resolve().parents[2] / 'tools/udev/70-r4.rules'
HOLDER = 'import os, sys; os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print("open", flush=True); sys.stdin.read()'


def doctor(*arguments):
    """Returns the exit code, and the findings by their checks."""
    result = run('doctor', *arguments, '--json', timeout=2 * PATIENCE_S)
    assert not result.stderr
    printed = objects(result.stdout)
    assert printed[-1]['type'] == 'summary'
    return result.returncode, {each['check']: each for each in printed if each['type'] == 'finding'}


def test_doctor_names_another_program_that_uses_the_port(tmp_path):
    with Board(f'pty:{tmp_path}/r4') as board:
        port = os.path.realpath(tmp_path / 'r4')
        with subprocess.Popen([sys.executable, '-S', '-c', HOLDER, port], stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE) as other:
            assert other.stdout.readline() == b'open\n'
            code, found = doctor(board.host_url, '--duration', '0.5')
            assert f'pid {other.pid}' in found['serial.holder']['reason']
            assert found['serial.holder']['fix'] == f'kill {other.pid}' and code != 0
            other.stdin.close()
        _, found = doctor(board.host_url, '--duration', '1')
    assert found['serial.permission']['severity'] == 'ok' and 'serial.holder' not in found
    assert not {'link.silent', 'link.open', 'link.damaged'} & set(found), found


def state(number, damage=0):
    fields = f'AIN24:24.28;SAFE:0;PNum:{number};T:{10 * number};^'.encode()
    return fields + f'0x{zlib.crc32(fields) ^ damage:x}^'.encode()


def asks_to_watch(board):
    """Waits for the next request to watch, which a host sends twice a second, and returns the host's address."""
    while True:
        bytes_, host = board.recvfrom(2048)
        if bytes_.startswith(b'W:'):
            return host


def speak(board):
    """Sends one state to the host, then many states: each fifth state is missing, and each seventh state is damaged."""
    board.sendto(state(1), asks_to_watch(board))
    host = asks_to_watch(board)
    for number in range(2, 100):
        if number % 5 != 0:
            board.sendto(state(number, damage=number % 7 == 0), host)


def test_doctor_reports_lost_and_damaged_datagrams():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        board.bind(('127.0.0.1', 0))
        board.settimeout(PATIENCE_S)
        speaker = threading.Thread(target=speak, args=(board,))
        speaker.start()
        code, found = doctor(f'udp://127.0.0.1:{board.getsockname()[1]}?listen=0', '--duration', '1.5')
        speaker.join()
    assert code == REFUSED and found['link.loss']['severity'] == 'error', found
    assert found['link.damaged']['severity'] == 'warning'


def test_doctor_reports_a_silent_board_and_a_missing_port(tmp_path):
    code, found = doctor('udp://127.0.0.1:9?listen=0', '--duration', '0.1')
    assert code == REFUSED and found['link.silent']['severity'] == 'error'
    code, found = doctor(f'serial://{tmp_path}/none', '--duration', '0.1')
    assert code == OPEN and found['serial.permission']['reason'] == 'the port does not exist'


def test_doctor_runs_no_program_of_the_working_directory(tmp_path):
    for name in ('iw', 'nft', 'iptables', 'sh'):
        (tmp_path / name).write_text(f'#!/bin/sh\n: > {tmp_path}/executed\n')
        (tmp_path / name).chmod(0o755)
    listened = run('doctor', 'udp://127.0.0.1:9?listen=0', '--duration', '0.1', cwd=tmp_path,
                   env={**os.environ, 'PATH': ':' + os.environ['PATH']})
    assert listened.returncode == REFUSED, listened
    assert not (tmp_path / 'executed').exists()


def test_doctor_prints_the_udev_rules():
    assert run('doctor', '--udev-rules').stdout == RULES.read_text(encoding='ascii')
    if subprocess.run(['which', 'udevadm'], capture_output=True, check=False).returncode == 0:
        verify = subprocess.run(['udevadm', 'verify', str(RULES)], capture_output=True, text=True, check=False)
        assert verify.returncode == 0 or 'Unknown' in verify.stderr or 'unknown' in verify.stderr, verify
