# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 convert as a program, and its files as other programs read them: pandas, Wireshark, and npm's reader of MCAP."""
import json
import os
import pathlib
import pty
import re
import signal
import struct
import subprocess
import zlib

import pandas
import pytest

from machine import SANITIZED
from r4_process import DATA, ERROR, PATIENCE_S, R4, objects, run, run_measured

DATA_BAD, USAGE, OPEN = 1, 2, 4
HERE = pathlib.Path(__file__).resolve().parent
NODE_MODULES = HERE.parents[1] / 'build/npm/node_modules'
MOST_MIB = 20


def capture(path, url='udp://192.168.0.125'):
    """The paper's capture as a recording, 10 ms apart."""
    lines = ['# r4log 1 by r4 0.1.0', f'# path 1 {url} left-arm', '# from 2026-11-23T21:11:33.404765Z',
             f'1795468293.404765 1! up {url}']
    with open(f'{DATA}/paper_capture.tsv', encoding='ascii') as file:
        for index, line in enumerate(file):
            sender, datagram = line.rstrip('\n').split('\t')
            lines.append(f'{1795468293.5 + index / 100:.6f} 1{"<" if sender == "board" else ">"} {datagram}')
    path.write_text('\n'.join(lines + ['1795468295.000000 0! end', '']), encoding='ascii')
    return path


@pytest.fixture(name='native')
def a_capture(tmp_path):
    return capture(tmp_path / 'drive.r4log')


def convert(source, target, *options, code=0):
    """Runs r4 convert, and returns the output."""
    result = run('convert', str(source), '-o', str(target), *options)
    assert result.returncode == code, result
    assert not list(target.parent.glob('*.part'))
    return result


def test_pandas_reads_csv_with_the_right_types(native, tmp_path):
    said = convert(native, tmp_path / 'drive.csv').stdout
    table = pandas.read_csv(tmp_path / 'drive.csv')
    assert f'73 records; left out are {73 - len(table)} records that are not states' in said
    kinds = {name: kind.kind for name, kind in table.dtypes.items()}
    assert kinds['time [s]'] == kinds['AIN24 [V]'] == 'f'
    for name in ('path', 'PNum', 'T [ms]', 'DMHSTA [0/1/2]', 'OSMC1 pwm [0-4095]', 'STEP1POS [steps]'):
        assert kinds[name] == 'i', name
    first = table.iloc[0]
    assert (first['board'], first['PNum'], first['AIN24 [V]']) == ('left-arm', 7434, 24.28)
    assert first['time [s]'] == 1795468293.5


def tshark(*arguments):
    result = subprocess.run(['tshark', *map(str, arguments)], capture_output=True, text=True, check=True)
    return result.stdout.splitlines()


def datagrams(path):
    """The lines of a native recording, without the times."""
    lines = path.read_text().splitlines()
    return [line.split(' ', 1)[1] for line in lines if line[0] != '#' and '! ' not in line]


def test_wireshark_reads_the_datagrams_and_the_events(native, tmp_path):
    packets = tmp_path / 'drive.pcapng'
    convert(native, packets)
    read = tshark('-r', packets, '-Y', 'udp', '-T', 'fields', '-e', 'frame.time_epoch', '-e', 'udp.srcport',
                  '-e', 'ip.checksum.status', '-e', 'udp.payload', '-o', 'ip.check_checksum:TRUE')
    rows = [line.split('\t') for line in read]
    assert [(bytes.fromhex(row[3]).decode(), '<' if row[1] == '2018' else '>') for row in rows] == \
        [(line.split(' ', 1)[1], line[1]) for line in datagrams(native)]
    assert rows[0][0] == '1795468293.500000000' and {row[2] for row in rows} == {'1'}, 'a checksum is wrong'
    assert not tshark('-r', packets, '-Y', '_ws.malformed')
    events = tshark('-r', packets, '-Y', 'syslog.msg contains "! "', '-T', 'fields', '-e', 'syslog.msg')
    assert events == [line for line in native.read_text().splitlines() if '! ' in line and line[0] != '#']


def test_convert_reads_files_that_wireshark_writes(native, tmp_path):
    packets, again = tmp_path / 'drive.pcapng', tmp_path / 'again.pcapng'
    convert(native, packets)
    tshark('-r', packets, '-w', again)
    convert(again, tmp_path / 'again.r4log')
    assert (tmp_path / 'again.r4log').read_bytes() == native.read_bytes()
    # A capture without the comments of a recording: one link, and no names.
    subprocess.run(['editcap', '-F', 'pcap', '-T', 'rawip4', '-r', packets, tmp_path / 'plain.pcap', '5-75'],
                   check=True)
    convert(tmp_path / 'plain.pcap', tmp_path / 'plain.r4log')
    assert datagrams(tmp_path / 'plain.r4log') == datagrams(native)


def read_mcap(path):
    """Returns the records that @mcap/core reads in the file, or its error text."""
    assert NODE_MODULES.is_dir(), f'{NODE_MODULES} is missing; tools/setup --can installs it'
    return subprocess.run(['node', HERE.parent / 'npm/read_mcap.cjs', path], capture_output=True, text=True,
                          env={**os.environ, 'NODE_PATH': str(NODE_MODULES)}, check=False)


@pytest.fixture(name='two_boards')
def in_several_chunks(native):
    """A recording that repeats the capture's lines and adds a second board."""
    lines = native.read_text().splitlines(True)
    native.write_text(''.join(lines[:2]) + '# path 2 can://can0?node=2\n' +
                      ''.join(lines[2:-1] + [line.replace(' 1', ' 2', 1) for line in lines[4:-1]]) * 40 + lines[-1])
    return native


def test_the_mcap_reader_finds_every_message_by_every_index(two_boards, tmp_path):
    convert(two_boards, tmp_path / 'drive.mcap')
    read = read_mcap(tmp_path / 'drive.mcap')
    assert read.returncode == 0, read.stderr
    told = json.loads(read.stdout)
    assert told['topics'] == {
        '/r4log': ['r4.Line', {'path': '0'}],
        '/left-arm': ['r4.Record', {'path': '1', 'url': 'udp://192.168.0.125', 'name': 'left-arm'}],
        '/board2': ['r4.Record', {'path': '2', 'url': 'can://can0?node=2'}]}
    convert(two_boards, tmp_path / 'drive.jsonl')
    expected = {1: [], 2: []}
    for each in objects((tmp_path / 'drive.jsonl').read_text()):
        time, path = round(each.pop('time') * 1e6), each.pop('path')
        each.pop('board', None)
        expected.get(path, []).append([time, each])
    assert len(expected[1]) == 40 * 72 and expected[1][1][1]['fields']['DHB1A'] == [4095, 1]
    for path, topic in (1, '/left-arm'), (2, '/board2'):
        assert [each[1:] for each in told['messages'] if each[0] == topic] == expected[path]
    lines = [each[2]['line'] for each in told['messages'] if each[0] == '/r4log']
    assert lines == [line for line in two_boards.read_text().splitlines() if line[0] == '#' or ' 0! ' in line]
    convert(tmp_path / 'drive.mcap', tmp_path / 'again.r4log')
    assert (tmp_path / 'again.r4log').read_bytes() == two_boards.read_bytes()


def test_the_mcap_reader_finds_a_wrong_byte(two_boards, tmp_path):
    convert(two_boards, tmp_path / 'drive.mcap')
    whole = (tmp_path / 'drive.mcap').read_bytes()
    chunk = whole.index(b'\x04\0\0\0zstd') - 37
    index = chunk + 9 + struct.unpack_from('<Q', whole, chunk + 1)[0]
    for place, words in ((chunk + 9 + 24, 'Incorrect chunk CRC'), (chunk + 5000, ''), (index + 9 + 6 + 8, ''),
                         (len(whole) - 100, 'Incorrect summary CRC')):
        damaged = bytearray(whole)
        damaged[place] ^= 0x10
        (tmp_path / 'damaged.mcap').write_bytes(damaged)
        read = read_mcap(tmp_path / 'damaged.mcap')
        assert read.returncode != 0 and words in read.stderr, (place, read)


def test_convert_locates_damage_and_converts_the_rest(native, tmp_path):
    good = native.read_text()
    native.write_text(good.replace('1795468293.520000', 'x') + '17954')
    result = convert(native, tmp_path / 'again.r4log', code=DATA_BAD)
    assert 'line 7, byte ' in result.stderr and 'the line does not begin with a time; this part is left out' in result.stderr
    assert 'the last line is not complete' in result.stderr
    kept = [line for line in good.splitlines(True) if not line.startswith('1795468293.520000')]
    assert (tmp_path / 'again.r4log').read_text() == ''.join(kept)
    piped = run('convert', '-', '-o', str(tmp_path / 'piped.r4log'), stdin=native.read_text())
    assert piped.returncode == DATA_BAD and 'r4: standard input: line 7, byte ' in piped.stderr


@pytest.mark.parametrize('command', ['info', 'convert'])
def test_all_whole_lines_of_an_interrupted_pipe_are_read(native, tmp_path, command):
    pipe, target = tmp_path / 'pipe', tmp_path / 'again.r4log'
    os.mkfifo(pipe)
    output = ['-o', target] if command == 'convert' else []
    lines = native.read_text().splitlines(True)
    with subprocess.Popen([R4, command, pipe, *output], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True) as process:
        with open(pipe, 'w', encoding='ascii') as writer:
            writer.write(''.join(lines[:-2]) + lines[-2][:30])
        told, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == DATA_BAD and 'the last line is not complete' in told, told
    assert command == 'info' or target.read_text().startswith(''.join(lines[:-2]))


@pytest.mark.parametrize('ending', ['.pcapng', '.mcap', '.log'])
def test_info_recognises_a_format_whatever_the_file_name(tmp_path, ending):
    capture(tmp_path / 'drive.r4log', 'can://can0?node=3')
    convert(tmp_path / 'drive.r4log', tmp_path / f'drive{ending}')
    (tmp_path / f'drive{ending}').rename(tmp_path / 'drive.txt')
    told = objects(run('info', str(tmp_path / 'drive.txt'), '--json').stdout)[0]
    assert [(path['url'], path['states']) for path in told['paths']] == [('can://can0?node=3', 60)]


def test_mixed_files_of_mergecap_are_refused_appended_ones_are_read(tmp_path):
    for name, url in (('a', 'udp://192.168.0.125'), ('b', 'udp://192.168.0.126')):
        convert(capture(tmp_path / f'{name}.r4log', url), tmp_path / f'{name}.pcapng')
    both = [tmp_path / 'a.pcapng', tmp_path / 'b.pcapng']
    for mode in ('none', 'all'):
        subprocess.run(['mergecap', '-I', mode, '-w', tmp_path / 'mixed.pcapng', *both], check=True)
        said = convert(tmp_path / 'mixed.pcapng', tmp_path / 'mixed.csv', code=DATA_BAD).stderr
        assert 'several recordings are mixed' in said
    subprocess.run(['mergecap', '-a', '-I', 'none', '-w', tmp_path / 'after.pcapng', *both], check=True)
    convert(tmp_path / 'after.pcapng', tmp_path / 'after.r4log')
    assert (tmp_path / 'after.r4log').read_text() == ''.join(
        (tmp_path / f'{name}.r4log').read_text() for name in 'ab')


def test_convert_reads_a_pipe_and_replaces_a_file_only_with_force(native, tmp_path):
    target = tmp_path / 'piped.jsonl'
    assert run('convert', '-', '-o', str(target), stdin=native.read_text()).returncode == 0
    assert len(target.read_text().splitlines()) == 73
    refused = convert(native, target, code=OPEN).stderr
    assert ERROR.search(refused) and 'already exists' in refused and '--force' in refused
    convert(native, native, '--force')
    assert native.read_text() == capture(tmp_path / 'same.r4log').read_text()


@pytest.mark.parametrize('name, content, code, message', [
    ('x.r4log', 'zeros', DATA_BAD, 'is not a recording'),
    ('x.r4log', b'', DATA_BAD, 'is not a recording'),
    ('x.r4log', b'# r4log 2 by r4 9.0\n', DATA_BAD, 'the recording has a later version'),
    ('x.csv', b'time [s],path\n', USAGE, '.csv cannot be read, only written'),
    ('x.r4log', None, OPEN, 'No such file'),
    ('x.r4log', 'directory', OPEN, 'Is a directory'),
    ('x.mcap', 'directory', OPEN, 'Is a directory'),
])
def test_an_invalid_recording_creates_no_output_file(tmp_path, name, content, code, message):
    if content == 'directory':
        (tmp_path / name).mkdir()
    elif content is not None:
        (tmp_path / name).write_bytes(bytes(100_000) if content == 'zeros' else content)
    result = convert(tmp_path / name, tmp_path / 'out.jsonl', code=code)
    assert ERROR.search(result.stderr) and message in result.stderr, result
    assert not (tmp_path / 'out.jsonl').exists()


@pytest.mark.parametrize('target, code', [('x.xlsx', USAGE), ('.', OPEN), ('no/such/x.csv', OPEN)])
def test_an_output_that_cannot_be_written_is_reported(native, tmp_path, target, code):
    result = convert(native, tmp_path / target, code=code)
    assert ERROR.search(result.stderr), result


def test_an_interrupted_conversion_leaves_no_file(native, tmp_path):
    with subprocess.Popen([R4, 'convert', '-', '-o', str(tmp_path / 'drive.csv')], stdin=subprocess.PIPE) as process:
        text = native.read_bytes()
        for _ in range(2 * 65536 // len(text) + 1):  # more than a pipe holds, so r4 has begun to read
            process.stdin.write(text)
        process.stdin.flush()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) != 0
        process.stdin = None
    assert [path.name for path in tmp_path.iterdir()] == [native.name]


def claims(ending):
    """Files whose headers claim 100 GB, or the format's limit: (the bytes, the reason in the error)."""
    much, most = 100_000_000_000, 0xFFFFFFFC
    line = b'# r4log 1 by r4\n1795468293.404765 1! up x\n'
    mcap = b'\x89MCAP0\r\n\x01' + struct.pack('<QI', 14, 5) + b'r4log' + struct.pack('<I', 1) + b'x'
    chunk = struct.pack('<QQQII', 0, 0, much, 0, 4) + b'zstd' + struct.pack('<Q', much)
    section = struct.pack('<IIIIqI', 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, -1, 28)
    begins = subprocess.run(['zstd', '-cq'], input=line, capture_output=True, check=True).stdout
    endless = subprocess.run(['zstd', '-cq'], input=line + b'x' * 100_000_000, capture_output=True, check=True).stdout
    frame = b'\x28\xb5\x2f\xfd'
    return {
        '.mcap': [(mcap + b'\x06' + struct.pack('<Q', much), 'a record of more than 256 MiB'),
                  (mcap + b'\x06' + struct.pack('<Q', len(chunk)) + chunk, 'an incomplete chunk')],
        '.pcapng': [(section + struct.pack('<II', 6, most) + bytes(100), 'not a block of pcapng')],
        '.pcap': [(struct.pack('<IIQIIIIII', 0xA1B2C3D4, 0x40002, 0, most, 228, 1, 0, most, most) + bytes(100),
                   'the length of a packet is not valid')],
        # A frame of 100 GB, a frame with a window of 2 GiB, a line of 100 MB.
        '.r4log.zst': [(begins + frame + b'\xe0' + struct.pack('<Q', much) + bytes(100), 'a zstd frame that needs a window'),
                       (begins + frame + b'\0\xa8' + bytes(100), 'a zstd frame that needs a window'),
                       (endless, 'the last line is not complete')],
    }[ending]


@pytest.mark.parametrize('ending', ['.mcap', '.pcapng', '.pcap', '.r4log.zst'])
def test_a_false_size_in_a_header_allocates_no_memory(tmp_path, ending):
    for number, (content, words) in enumerate(claims(ending)):
        source = tmp_path / f'{number}{ending}'
        source.write_bytes(content)
        result = run_measured('convert', str(source), '-o', str(tmp_path / f'{number}.jsonl'))
        assert result.returncode == DATA_BAD, result
        assert re.search(f'^r4: {source}: .*byte [0-9]+: {words}', result.stderr, re.MULTILINE), result
        assert SANITIZED or result.peak_mib < MOST_MIB, result.peak_mib


@pytest.fixture(name='eight_boards', scope='module')
def two_minutes_of_eight_boards(tmp_path_factory):
    """Eight boards on a CAN bus, each with 100 states a second: 24 MB of text."""
    path = tmp_path_factory.mktemp('long') / 'drive.r4log'
    lines = ['# r4log 1 by r4 0.1.0', *(f'# path {1 + node} can://can0?node={node}' for node in range(8))]
    for number in range(20_000 if SANITIZED else 120_000):
        pnum, node = divmod(number, 8)
        fields = (f'AIN24:24.{pnum % 100:02};AIN12:12.12;AIN5:5.12;AINDMH:12.11;DMHSTA:1;AINSTEER:1.03;DHB1A:4095,1;'
                  f'OSMC1:{pnum % 4096},1;STEP1POS:-{pnum};SERVO1POS:2000;PNum:{pnum};T:{10 * pnum};^')
        us = 1795468293404765 + 1250 * number
        lines.append(f'{us // 10**6}.{us % 10**6:06} {1 + node}< {fields}0x{zlib.crc32(fields.encode()):x}^')
    path.write_text('\n'.join(lines + ['']), encoding='ascii')
    return path


@pytest.mark.parametrize('ending', ['.r4log', '.r4log.zst', '.csv', '.jsonl', '.log', '.pcapng', '.mcap'])
def test_a_long_recording_is_converted_and_back_in_little_memory(eight_boards, tmp_path, ending):
    there, back = tmp_path / f'there{ending}', tmp_path / 'back.r4log'
    ways = [(eight_boards, there)] + [(there, back)] * (ending not in ('.csv', '.jsonl'))
    for source, target in ways:
        result = run_measured('convert', str(source), '-o', str(target))
        assert result.returncode == 0 and not result.stderr, result
        print(f'{source.suffix} to {target.suffix}: {result.peak_mib:.1f} MiB')
        assert SANITIZED or result.peak_mib < MOST_MIB
    if ending == '.log':  # this format writes paths before their first records
        assert datagrams(back) == datagrams(eight_boards)
    elif len(ways) == 2:
        assert back.read_bytes() == eight_boards.read_bytes()


def test_a_terminal_shows_the_progress_of_convert(eight_boards, tmp_path):
    terminal, its_end = pty.openpty()
    with subprocess.Popen([R4, 'convert', eight_boards, '-o', tmp_path / 'drive.jsonl'], stdout=subprocess.DEVNULL,
                          stderr=its_end) as process:
        os.close(its_end)
        shown = b''
        try:
            while piece := os.read(terminal, 4096):
                shown += piece
        except OSError:  # r4 has ended
            pass
    os.close(terminal)
    assert process.returncode == 0
    bars = re.findall(rb'\rconverting \[(=*) *\] +(\d+) %', shown)
    assert len(bars) >= 2 and shown.endswith(b'\r\x1b[K'), shown
    done = [int(percent) for _, percent in bars]
    assert done == sorted(done) and done[-1] > done[0] and done[-1] <= 100
    assert all(abs(len(bar) - percent * 30 / 100) <= 1 for (bar, _), percent in zip(bars, done))
