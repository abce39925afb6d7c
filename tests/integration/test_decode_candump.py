# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 decode --candump: turns the output of candump into the datagrams of the bus.

can_python_inside.py decodes the frames of real boards and hosts.
"""
import random
import subprocess
import zlib

import pytest

from machine import SANITIZED
import packed_form
from r4_process import R4, objects, run

DATA_BAD = 1
STATE = 'AIN24:24.28;OSMC1:400,1;PNum:7434;T:79090;'


def with_crc(fields):
    return f'{fields}^0x{zlib.crc32((fields + "^").encode()):x}^'.encode()


def frames_of(data, size=8):
    """The ISO-TP frames of a message of 8 bytes or more."""
    first, rest = size - 2, data[size - 2:]
    yield bytes([0x10 | len(data) >> 8, len(data) & 255]) + data[:first]
    for index in range(0, len(rest), size - 1):
        yield bytes([0x20 | (index // (size - 1) + 1) & 15]) + rest[index:index + size - 1]


def log_lines(frames, identifier=0x403, interface='can0', start_us=1795248809000000):
    return [f'({(start_us + 300 * i) / 1e6:.6f}) {interface} {identifier:03X}#{each.hex().upper()}\n'
            for i, each in enumerate(frames)]


def decode(text, *options):
    result = run('decode', '--candump', *options, stdin=text)
    assert result.stderr == ''
    *rest, summary = objects(result.stdout)
    assert summary['type'] == 'summary'
    return result.returncode, rest, summary


def test_both_formats_of_candump_give_the_same_datagrams():
    frames = list(frames_of(with_crc(STATE)))
    log = log_lines(frames)
    screen = [f' {line.split()[0]}  can0  403   [{len(frame)}]  {frame.hex(" ").upper()}\n'
              for line, frame in zip(log, frames)]
    expected = decode(''.join(log))
    assert expected[0] == 0 and len(expected[1]) == 1
    (state,) = expected[1]
    assert state == {
        'line': len(frames), 'time': state['time'], 'interface': 'can0', 'node': 3, 'from': 'board',
        'lane': 'telemetry', 'frames': len(frames), 'took_ms': state['took_ms'], 'ok': True, 'type': 'state',
        'pnum': 7434, 't': 79090, 'fields': {'AIN24': 24.28, 'OSMC1': [400, 1]},
        'text': with_crc(STATE).decode()}
    assert state['took_ms'] == pytest.approx(0.3 * (len(frames) - 1))
    assert state['time'] == 1795248809.0 + 0.0003 * (len(frames) - 1)
    assert decode(''.join(screen)) == expected
    assert decode(''.join(a if i % 2 else b for i, (a, b) in enumerate(zip(log, screen)))) == expected
    assert decode(''.join(log).replace('\n', '\r\n')) == expected


def test_decodes_fd_frames_and_packed_datagrams():
    whole = with_crc(';'.join(f'SERVO{n}POS:1500' for n in range(1, 17)) + ';PNum:1;T:2;')
    *full, last = frames_of(whole, 64)
    padded = last.ljust(next(size for size in (8, 12, 16, 20, 24, 32, 48, 64) if size >= len(last)), b'\xcc')
    fd = [f'(1.0) can0 403##1{frame.hex()}\n' for frame in (*full, padded)]
    code, (state,), _ = decode(''.join(fd))
    assert code == 0 and state['frames'] == len(fd) == 5 and state['text'] == whole.decode()
    packed = packed_form.pack(with_crc(STATE).decode())
    code, (state,), _ = decode(''.join(log_lines(frames_of(packed))))
    assert code == 0 and state['packed'] == len(packed) and state['text'] == with_crc(STATE).decode()


def test_a_damaged_line_is_reported_and_the_rest_is_decoded():
    lines = ['what is this\n', *log_lines(frames_of(with_crc(STATE))), '(1795248809.1) can0 403#10']
    code, printed, summary = decode(''.join(lines)[:-1])
    assert code == DATA_BAD and summary['damaged_lines'] == 2
    assert printed[0] == {'line': 1, 'ok': False, 'error': 'candump', 'reason': 'not a line of candump',
                          'fix': 'record with: candump -L INTERFACE', 'text': 'what is this'}
    assert printed[1]['ok']
    assert printed[2]['line'] == len(lines) and printed[2]['reason'] == 'the line is cut off'


def test_an_empty_dump_gives_a_summary_of_zeros():
    code, printed, summary = decode('')
    assert (code, printed) == (0, []) and set(summary.values()) == {'summary', 0}


def test_arbitrary_bytes_are_decoded_in_little_memory():
    rng = random.Random(7)
    pieces = [rng.randbytes(200_000), b'x' * 10_000_000, b'(1.0) can0 403#' + b'0' * 5_000_000,
              *(f'(1.0) i{n} {n % 0x800:03X}#{rng.randbytes(8).hex()}'.encode() for n in range(20_000)),
              *(f'(1.0) can0 {n % 0x800:03X}##1{rng.randbytes(64).hex()}'.encode() for n in range(20_000))]
    with subprocess.Popen(['/usr/bin/env', 'bash', '-c', f'"{R4}" decode --candump | tail -n 1; '
                           'echo "${PIPESTATUS[0]}"'], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        output, _ = process.communicate(b'\n'.join(pieces))
    summary, code = output.decode().splitlines()
    assert code == '1' and '"type":"summary"' in summary
    limited = subprocess.run(['/usr/bin/env', 'bash', '-c', f'ulimit -v 60000; exec "{R4}" decode --candump'],
                             input=b'\n'.join(pieces), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
    assert SANITIZED or (limited.returncode, limited.stderr) == (DATA_BAD, b'')
