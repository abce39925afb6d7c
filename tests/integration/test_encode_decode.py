# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 encode and r4 decode, with the real datagrams of the paper."""
import os
import re
import subprocess

import pytest

from machine import SANITIZED
from r4_process import DATA, R4, objects, run

DATA_BAD = 1


def captured_lines():
    with open(os.path.join(DATA, 'paper_capture.tsv'), encoding='ascii') as file:
        return [line.rstrip('\n').split('\t')[1] for line in file]


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
def test_decode_reads_the_output_of_encode_and_names_its_type(fields, kind):
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


def test_decode_counts_lines_with_any_line_ending():
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
            # Anonymous memory: without the program and its libraries, which are mapped files.
            own_kib = int(re.search(r'RssAnon:\s*(\d+)', status.read()).group(1))
        output, _ = process.communicate()
    assert process.returncode == DATA_BAD
    assert objects(output.decode()) == [
        {'line': 1, 'ok': False, 'error': 'length', 'position': 1024, 'size': 10_000_000}]
    print(f'its own memory {own_kib} KiB')
    assert SANITIZED or own_kib < 4_000


def test_decode_of_empty_input_succeeds():
    result = run('decode')
    assert (result.returncode, result.stdout) == (0, '')


def test_encode_force_writes_an_invalid_command():
    result = run('encode', 'O:5000,1,9', '--force', '--time', '1')
    assert result.returncode == 0 and result.stdout.startswith('O:5000,1,9;')
