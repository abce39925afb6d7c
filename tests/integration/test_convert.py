# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 convert as a program, and its files as others read them: pandas, Wireshark, and a reader of MCAP."""
import signal
import subprocess

import pandas
import pytest

import mcap_reader
from r4_process import DATA, ERROR, PATIENCE_S, R4, run

DATA_BAD, USAGE, OPEN = 1, 2, 4


def capture(path, url='udp://192.168.0.125'):
    """The paper's capture as a recording, 10 ms apart."""
    lines = ['# r4log 1 by r4 0.1.0', f'# wire 1 {url} left-arm', '# from 2026-11-23T21:11:33.404765Z',
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
    """Runs it; what it says."""
    result = run('convert', str(source), '-o', str(target), *options)
    assert result.returncode == code, result
    assert not list(target.parent.glob('*.part'))
    return result


def test_pandas_reads_csv_with_the_right_types(native, tmp_path):
    said = convert(native, tmp_path / 'drive.csv').stdout
    table = pandas.read_csv(tmp_path / 'drive.csv')
    assert f'73 records; left out are {73 - len(table)} that are no state' in said
    kinds = {name: kind.kind for name, kind in table.dtypes.items()}
    assert kinds['time [s]'] == kinds['AIN24 [V]'] == 'f'
    for name in ('wire', 'PNum', 'T [ms]', 'DMHSTA [0/1]', 'OSMC1 pwm [0-4095]', 'STEP1POS [steps]'):
        assert kinds[name] == 'i', name
    first = table.iloc[0]
    assert (first['board'], first['PNum'], first['AIN24 [V]']) == ('left-arm', 7434, 24.28)
    assert first['time [s]'] == 1795468293.5


def tshark(*arguments):
    """The lines that it prints."""
    result = subprocess.run(['tshark', *map(str, arguments)], capture_output=True, text=True, check=True)
    return result.stdout.splitlines()


def datagrams(path):
    """Of a native recording: its lines, without the times."""
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
    assert rows[0][0] == '1795468293.500000000' and {row[2] for row in rows} == {'1'}, 'checksums are right'
    assert not tshark('-r', packets, '-Y', '_ws.malformed')
    events = tshark('-r', packets, '-Y', 'syslog.msg contains "! "', '-T', 'fields', '-e', 'syslog.msg')
    assert events == [line for line in native.read_text().splitlines() if '! ' in line and line[0] != '#']


def test_what_wireshark_writes_is_read(native, tmp_path):
    packets, again = tmp_path / 'drive.pcapng', tmp_path / 'again.pcapng'
    convert(native, packets)
    tshark('-r', packets, '-w', again)
    convert(again, tmp_path / 'again.r4log')
    assert (tmp_path / 'again.r4log').read_bytes() == native.read_bytes()
    # A capture that knows nothing of recordings: one link, and no names.
    subprocess.run(['editcap', '-F', 'pcap', '-T', 'rawip4', '-r', packets, tmp_path / 'plain.pcap', '5-75'],
                   check=True)
    convert(tmp_path / 'plain.pcap', tmp_path / 'plain.r4log')
    assert datagrams(tmp_path / 'plain.r4log') == datagrams(native)


def test_every_index_and_checksum_of_mcap_is_right(native, tmp_path):
    # Several chunks: the capture's lines again and again, and a second board.
    lines = native.read_text().splitlines(True)
    native.write_text(''.join(lines[:2]) + '# wire 2 can://can0?node=2\n' +
                      ''.join(lines[2:] + [line.replace(' 1', ' 2', 1) for line in lines[4:-1]]) * 40)
    convert(native, tmp_path / 'drive.mcap')
    topics, messages = mcap_reader.read(tmp_path / 'drive.mcap')
    assert topics == {'/r4log': ('r4.Line', {'wire': '0'}),
                      '/left-arm': ('r4.Record', {'wire': '1', 'url': 'udp://192.168.0.125'}),
                      '/board2': ('r4.Record', {'wire': '2', 'url': 'can://can0?node=2'})}
    told = [(topic, ns, each) for topic, ns, each in messages if topic == '/left-arm']
    assert len(told) == 40 * 72 and told[0][2] == {'type': 'event', 'event': 'up udp://192.168.0.125'}
    _, when, state = told[1]
    assert when == 1795468293_500000000 and state['fields']['DHB1A'] == [4095, 1] and state['pnum'] == 7434
    convert(tmp_path / 'drive.mcap', tmp_path / 'again.r4log')
    assert (tmp_path / 'again.r4log').read_bytes() == native.read_bytes()


def test_damage_has_a_place_and_the_rest_is_converted(native, tmp_path):
    good = native.read_text()
    native.write_text(good.replace('1795468293.520000', 'x') + '17954')
    result = convert(native, tmp_path / 'again.r4log', code=DATA_BAD)
    assert 'line 7, byte ' in result.stderr and 'it begins with no time; it is left out' in result.stderr
    assert 'the last line is not whole' in result.stderr
    kept = [line for line in good.splitlines(True) if not line.startswith('1795468293.520000')]
    assert (tmp_path / 'again.r4log').read_text() == ''.join(kept)


def test_a_pipe_is_read_and_nothing_is_replaced_unasked(native, tmp_path):
    target = tmp_path / 'piped.jsonl'
    assert run('convert', '-', '-o', str(target), stdin=native.read_text()).returncode == 0
    assert len(target.read_text().splitlines()) == 73
    refused = convert(native, target, code=OPEN).stderr
    assert ERROR.search(refused) and 'is there already' in refused and '--force' in refused
    convert(native, native, '--force')
    assert native.read_text() == capture(tmp_path / 'same.r4log').read_text()


@pytest.mark.parametrize('name, content, code, message', [
    ('x.r4log', 'zeros', DATA_BAD, 'no recording'),
    ('x.r4log', b'', DATA_BAD, 'no recording'),
    ('x.r4log', b'# r4log 2 by r4 9.0\n', DATA_BAD, 'a recording of a later version'),
    ('x.csv', b'time [s],wire\n', USAGE, '.csv is only written'),
    ('x.r4log', None, OPEN, 'No such file'),
])
def test_what_is_no_recording_makes_no_file(tmp_path, name, content, code, message):
    if content is not None:
        (tmp_path / name).write_bytes(bytes(100_000) if content == 'zeros' else content)
    result = convert(tmp_path / name, tmp_path / 'out.jsonl', code=code)
    assert ERROR.search(result.stderr) and message in result.stderr, result
    assert not (tmp_path / 'out.jsonl').exists()


@pytest.mark.parametrize('target, code', [('x.xlsx', USAGE), ('.', OPEN), ('no/such/x.csv', OPEN)])
def test_what_cannot_be_written_is_said(native, tmp_path, target, code):
    result = convert(native, tmp_path / target, code=code)
    assert ERROR.search(result.stderr), result


def test_what_is_broken_off_leaves_nothing(native, tmp_path):
    with subprocess.Popen([R4, 'convert', '-', '-o', str(tmp_path / 'drive.csv')], stdin=subprocess.PIPE) as process:
        text = native.read_bytes()
        for _ in range(2 * 65536 // len(text) + 1):  # more than a pipe holds: it has begun
            process.stdin.write(text)
        process.stdin.flush()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) != 0
        process.stdin = None
    assert [path.name for path in tmp_path.iterdir()] == [native.name]
