# SPDX-License-Identifier: GPL-3.0-or-later
"""The dissector of tools/wireshark in tshark, with the paper's capture, recordings, CAN, and damaged datagrams."""
import os
import pathlib
import random
import re
import resource
import shutil
import struct
import subprocess
import zlib

import pytest

import packed_form
from r4_process import DATA, Board, Running, driving, run, wait_for

DISSECTOR = pathlib.Path(__file__).resolve().parents[2] / 'tools/wireshark'
BOARD, HOST = (192, 168, 0, 125), (192, 168, 0, 10)
RAW_IP, SOCKETCAN = 101, 227
# Wireshark 4.4 loads no Lua for root. So another user runs tshark, with the right to read all files.
TSHARK = ['tshark'] if os.geteuid() != 0 else [
    'setpriv', '--reuid=65534', '--regid=65534', '--clear-groups', '--inh-caps=+dac_override', '--ambient-caps=+dac_override',
    'tshark']


def tshark(*arguments, plugin=True, **options):
    """Runs tshark, and returns the lines that tshark prints."""
    load = ['-X', f'lua_script:{DISSECTOR}/r4.lua'] if plugin else []
    result = subprocess.run([*TSHARK, *load, *map(str, arguments)], capture_output=True, check=False, **options)
    output, errors = result.stdout.decode('utf-8', 'replace'), result.stderr.decode('utf-8', 'replace')
    troubles = re.findall(r'.*Lua Error.*|.*Lua: .*|.*r4\w*\.lua.*', errors + output)
    assert result.returncode == 0 and not troubles, (errors, troubles[:3])
    return output.splitlines()


def fields(path, *names, only=None, options=()):
    """A list per packet, with the values of each field joined by commas."""
    chosen = [part for name in names for part in ('-e', name)]
    lines = tshark('-r', path, '-T', 'fields', *chosen, *(['-Y', only] if only else []), *options)
    return [line.split('\t') for line in lines]


def write_pcap(path, link_type, packets):
    """`packets`: (seconds, bytes) of each packet."""
    with open(path, 'wb') as file:
        file.write(struct.pack('<IHHiIII', 0xA1B2C3D4, 2, 4, 0, 0, 65535, link_type))
        for seconds, packet in packets:
            us = round(seconds * 1e6)
            file.write(struct.pack('<IIII', us // 10**6, us % 10**6, len(packet), len(packet)) + packet)
    return path


def udp(sender, payload, port=2018):
    ends = [(BOARD, port), (HOST, 2390)]
    (source, source_port), (target, target_port) = ends if sender == 'board' else ends[::-1]
    head = struct.pack('>HHHH', source_port, target_port, 8 + len(payload), 0)
    return struct.pack('>BBHHHBBH4s4s', 0x45, 0, 28 + len(payload), 0, 0, 64, 17, 0, bytes(source),
                       bytes(target)) + head + payload


def datagram(text):
    return f'{text}^0x{zlib.crc32((text + "^").encode()):x}^'.encode()


def can(ident, data=b'', extended=False, remote=False, fd=False):
    flags = (0x80000000 if extended else 0) | (0x40000000 if remote else 0)
    return struct.pack('>IBBBB', ident | flags, len(data), 4 if fd else 0, 0, 0) + data


def isotp(message, full=8):
    """The data of the frames of a message."""
    if len(message) < full:
        return [bytes([len(message)]) + message] if full == 8 else [bytes([0, len(message)]) + message]
    frames = [struct.pack('>H', 0x1000 | len(message)) + message[:full - 2]]
    for index, at in enumerate(range(full - 2, len(message), full - 1)):
        frames.append(bytes([0x20 | (index + 1) % 16]) + message[at:at + full - 1])
    return frames


def paper():
    with open(f'{DATA}/paper_capture.tsv', encoding='ascii') as file:
        return [line.rstrip('\n').split('\t') for line in file]


def paper_capture(path, port=2018):
    return write_pcap(path, RAW_IP, [(index / 100, udp(sender, text.encode(), port))
                                     for index, (sender, text) in enumerate(paper())])


def test_the_papers_capture_is_shown_field_by_field(tmp_path):
    path = paper_capture(tmp_path / 'paper.pcap')
    shown = fields(path, 'frame.number', 'r4.from', 'r4.type', 'r4.ain24', 'r4.osmc1.pwm', 'r4.step1pos', 'r4.pnum',
                   'r4.t', 'r4.o.pwm', 'r4.response_to', 'r4.response_time', 'r4.response_by')
    assert [row[1] for row in shown] == [sender for sender, _ in paper()]
    assert shown[6] == ['7', 'host', 'command', '', '', '', '66', '1699276044383', '358', '', '', '']
    assert shown[7] == ['8', 'board', 'state', '24.28', '358', '-100', '7440', '79150', '', '7', '0.010000000',
                        'the state shows it']
    assert shown[13][1:3] == ['board', 'heartbeat'] and shown[15][1:3] == ['host', 'heartbeat']
    assert [row[9] for row in shown if row[9]] == [row[0] for row in shown if row[2] == 'command'], 'unconfirmed'


def test_a_dissector_installed_twice_is_loaded_once(tmp_path):
    plugins = tmp_path / '.local/lib/wireshark/plugins'
    shutil.copytree(DISSECTOR, plugins)
    path = paper_capture(tmp_path / 'paper.pcap')
    lines = tshark('-r', path, env={**os.environ, 'HOME': str(tmp_path)})
    assert sum(' R4 ' in line for line in lines) == len(paper())


def test_a_wrong_checksum_is_shown_and_counts_as_a_lost_datagram(tmp_path):
    path = paper_capture(tmp_path / 'paper.pcap')
    right = {line.split('PNum:')[1].split(';')[0]: zlib.crc32(line[:line.index('^') + 1].encode())
             for _, line in paper() if 'PNum:' in line}
    shown = fields(path, 'r4.pnum', 'r4.crc', 'r4.crc.expected', only='r4.crc.status == 0')
    assert [row[0] for row in shown] == ['7460', '7491']
    assert all(int(row[2], 16) == right[row[0]] != int(row[1], 16) for row in shown)
    assert fields(path, 'r4.pnum', 'r4.lost', only='r4.expert.lost') == [['7461', '1'], ['7492', '1']]
    assert len(fields(path, 'frame.number', only='r4.expert.crc && r4.expert.malformed')) == 0


def test_datagrams_on_other_ports_are_recognised_by_their_checksum(tmp_path):
    path = paper_capture(tmp_path / 'paper.pcap', port=4711)
    assert len(fields(path, 'r4.pnum', only='r4')) == len(paper()), 'port 2390 is not taken for a host\'s'
    path = write_pcap(tmp_path / 'other.pcap', RAW_IP,
                      [(0, udp('board', paper()[0][1].encode(), 4711)[:20] + struct.pack('>HHHH', 4711, 4712,
                        8 + len(text), 0) + text) for text in (paper()[0][1].encode(), b'AIN24:1;^0x1^')])
    assert fields(path, 'frame.number', only='r4') == [['1']]


def test_lost_late_and_duplicate_packet_numbers_are_marked(tmp_path):
    numbers = [4294967294, 4294967295, 2, 0, 2, 3]
    path = write_pcap(tmp_path / 'numbers.pcap', RAW_IP,
                      [(0, udp('board', datagram(f'SAFE:0;PNum:{number};T:1;'))) for number in numbers])
    assert fields(path, 'frame.number', 'r4.lost', only='r4.expert.lost') == [['3', '2']]
    assert fields(path, 'frame.number', only='r4.expert.late') == [['4']]
    assert fields(path, 'frame.number', 'r4.copy_of', only='r4.expert.duplicate') == [['5', '3']]


def test_unconfirmed_and_refused_commands_are_marked(tmp_path):
    said = [('host', 'O:1,1,1;PNum:2147483700;T:5;'), ('board', 'CMD:2147483700;SAFE:0;PNum:1;T:6;'),
            ('host', 'O:2,1,1;PNum:2147483701;T:5;'), ('host', 'O:2,1,1;PNum:2147483701;T:5;'),
            ('host', 'O:1,1,9;PNum:2147483702;T:5;'), ('board', 'N:2147483702,CHANNEL;PNum:2;T:7;'),
            ('board', 'H:R4-ROS2;PNum:3;T:8;SAFE:2;CAUSE:9;STOP:77;')]
    path = write_pcap(tmp_path / 'said.pcap', RAW_IP, [(0.01 * index, udp(sender, datagram(text)))
                                                       for index, (sender, text) in enumerate(said)])
    shown = fields(path, 'frame.number', 'r4.response_in', 'r4.response_to', 'r4.response_by', options=['-2'])
    assert shown == [['1', '2', '', ''], ['2', '', '1', 'CMD'], ['3', '', '', ''], ['4', '', '', ''],
                     ['5', '6', '', ''], ['6', '', '5', 'CHANNEL'], ['7', '', '', '']]
    assert fields(path, 'frame.number', only='r4.expert.unanswered', options=['-2']) == [['3']]
    assert fields(path, 'frame.number', 'r4.copy_of', only='r4.expert.repeated') == [['4', '3']]
    assert fields(path, 'frame.number', 'r4.n.code', only='r4.expert.refused') == [['6', 'CHANNEL']]
    assert fields(path, 'r4.safe', 'r4.cause', 'r4.stop', only='r4.expert.safe') == [['2', '9', '77']]


def test_a_serial_recording_shows_the_confirmation_of_its_commands(tmp_path):
    log, packets = tmp_path / 'drive.r4log', tmp_path / 'drive.pcapng'
    with Board(f'pty:{tmp_path}/r4') as board, Running('record', board.host_url, '-o', str(log)) as recorder:
        wait_for(log, ' 1! up ')
        with driving(board.host_url, *(f'O:{pwm},1,1' for pwm in range(300, 320))) as host:
            host.end()
        recorder.end()
    assert run('convert', str(log), '-o', str(packets)).returncode == 0
    sent = fields(packets, 'r4.o.pwm', 'r4.response_in', only='r4.o.pwm > 0', options=['-2'])
    # The answer to the first command may be missing, because the path changes its holder.
    commands = [each for each in sent if each[1]]
    assert commands and 300 <= int(commands[0][0]) < 320
    confirmed = dict(fields(packets, 'frame.number', 'r4.response_by', only='r4.response_time', options=['-2']))
    assert confirmed[commands[0][1]].startswith('CMD')
    assert all(row[0] == '1' for row in fields(packets, 'r4.crc.status', only='r4'))


def test_datagrams_of_a_can_bus_are_reassembled_and_unpacked(tmp_path):
    state = paper()[0][1]
    command = datagram('O:358,1,1;PNum:2147483700;T:1;').decode()
    confirmed = datagram('OSMC1:358,1;SAFE:0;CMD:2147483700;PNum:7435;T:79100;').decode()
    stopped = datagram('H:R4-ROS2;PNum:7436;T:79110;SAFE:2;CAUSE:5;STOP:77;').decode()
    frames = [(0x403, data) for data in isotp(packed_form.pack(state))]
    frames += [(0x183, isotp(packed_form.pack(command))[0]), (0x203, b'\x30\0\0')]
    frames += [(0x183, data) for data in isotp(packed_form.pack(command))[1:]]
    frames += [(0x403, data) for data in isotp(confirmed.encode())]
    packets = [can(*frame) for frame in frames] + [
        can(0x010), can(0x010 << 18 | 77, extended=True), can(0x023, b'\x02'),
        *(can(0x403, data) for data in isotp(stopped.encode())), can(0x603), can(0x603, remote=True), can(0x123, b'x'),
        *(can(0x404, data, fd=True) for data in isotp(state.encode(), 64))]
    path = write_pcap(tmp_path / 'bus.pcap', SOCKETCAN, [(index / 1000, each) for index, each in enumerate(packets)])
    rows = fields(path, 'frame.number', 'r4.can.node', 'r4.type', 'r4.pnum', 'r4.crc.status', 'r4.packed',
                  only='r4.type')
    number_of = {(row[2], row[3]): row[0] for row in rows}
    assert [row[1:] for row in rows] == [
        ['3', 'state', '7434', '1', '25'], ['3', 'command', '2147483700', '1', str(len(packed_form.pack(command)))],
        ['3', 'state', '7435', '1', ''], ['', 'emergency_stop', '', '', ''], ['', 'emergency_stop', '', '', ''],
        ['3', 'went_safe', '', '', ''], ['3', 'heartbeat', '7436', '1', ''], ['3', 'watch', '', '', ''],
        ['4', 'state', '7434', '1', '']]
    assert fields(path, 'r4.ain24', 'r4.osmc1.pwm', only='r4.packed == 25') == [['24.28', '400']]
    answers = fields(path, 'r4.response_to', 'r4.response_by', only='r4.response_to')
    assert answers == [[number_of['command', '2147483700'], 'CMD'],
                       [[row[0] for row in rows if row[2] == 'emergency_stop'][1], 'STOP']]
    assert fields(path, 'r4.isotp.frame', only='r4.packed == 25') == [['1,2,3,4']]
    assert fields(path, 'r4.isotp.joined_in', only='frame.number == 1', options=['-2']) == [['4']]
    assert fields(path, 'r4.isotp.flow', only='can.id == 0x203') == [['0']]
    assert fields(path, 'r4.safe', only='can.id == 0x023') == [['2']]
    assert len(fields(path, 'frame.number', only='!r4')) == 2


def test_every_packed_value_is_unpacked_correctly(tmp_path):
    rng = random.Random(17)
    texts = []
    while len(texts) < 300:
        chosen = rng.sample(packed_form.NAMES, rng.randrange(1, 12))
        values = ['0', '1', '4095,1', '1,0,1', '-100', '24.28', '007', '-0', str(2**56 - 1), str(1 - 2**55), 'ab:c', '']
        text = ''.join(f'{name}:{rng.choice(values)};' for name in chosen if name not in ('PNum', 'T'))
        text = datagram(f'{text}PNum:{rng.getrandbits(32)};T:{rng.getrandbits(44)};').decode()
        if packed_form.pack(text):
            texts.append(text)
    path = write_pcap(tmp_path / 'packed.pcap', SOCKETCAN,
                      [(0, can(0x401, data)) for text in texts for data in isotp(packed_form.pack(text))])
    rows = fields(path, 'r4.pnum', 'r4.crc.status', only='r4.packed')
    assert [row[1] for row in rows] == ['1'] * 300
    assert [row[0] for row in rows] == [re.search(r'PNum:(\d+)', text)[1] for text in texts]


def test_missing_and_invalid_can_frames_are_marked(tmp_path):
    frames = isotp(packed_form.pack(paper()[0][1]))
    damaged = [frames[0], frames[1], frames[3], frames[0], frames[0], b'\x00', b'\x10', b'\xf0']
    path = write_pcap(tmp_path / 'bus.pcap', SOCKETCAN, [(0, can(0x401, data)) for data in damaged] +
                      [(1, can(0x401, frames[1]))])
    told = {int(row[0]): row[1] for row in fields(path, 'frame.number', '_ws.expert.message', only='r4.expert.isotp')}
    assert 'wrong sequence number' in told[3] and 'interrupted' in told[5]
    assert 'impossible length' in told[6] and 'impossible length' in told[7] and 'no kind' in told[8]
    assert 4 not in told and not fields(path, 'frame.number', only='r4.pnum')


@pytest.fixture(name='installed', scope='module')
def a_home_with_the_dissector(tmp_path_factory):
    home = tmp_path_factory.mktemp('home')
    shutil.copytree(DISSECTOR, home / '.local/lib/wireshark/plugins')
    return {**os.environ, 'HOME': str(home)}


@pytest.fixture(name='shown', scope='module')
def names_by_filter(installed):
    listed = subprocess.run([*TSHARK, '-G', 'fields'], env=installed, capture_output=True, check=True).stdout.decode()
    return {part[2]: part[1] for part in (line.split('\t') for line in listed.splitlines()) if part[0] == 'F' and part[2].startswith('r4.')}


def test_fields_and_units_match_those_of_r4_convert(shown, tmp_path):
    # If the input is a pipe, the CSV file has the columns of all known fields.
    assert run('convert', '-', '-o', str(tmp_path / 'all.csv'), stdin='# r4log 1 by r4 0.1.0\n').returncode == 0
    columns = (tmp_path / 'all.csv').read_text(encoding='ascii').strip().split(',')[5:]
    assert len(columns) > 70
    for column in columns:
        name, unit = re.fullmatch(r'(.*) \[(.*)\]', column).groups()
        assert shown.get('r4.' + name.lower().replace(' ', '.')) == f'{name} ({unit})', column


def test_commands_are_those_of_r4_send(shown, tmp_path):
    # A word, as in E:STOP, is a separate value. The values of X have no names.
    forms = re.findall(r'^  ([A-WYZ]):(?:[A-Z]{2,})?(\S*) ', run('send', '--help').stdout, re.MULTILINE)
    assert len(forms) >= 12
    for letter, form in forms:
        for value in re.findall(r'[a-z]+', form):
            words = {'n': 'on', 'ff': 'on'}  # the lower-case letters of R's On and Off in the help
            assert f'r4.{letter.lower()}.{words.get(value, value)}' in shown, (letter, form)
    text = 'O:1,0,2;D:3,1,4;S:1500,16;R:8,Off;P:-7,2;P:-7,20,3;Z:1;B:4,1,0,2;PNum:1;T:1;'
    path = write_pcap(tmp_path / 'group.pcap', RAW_IP, [(0, udp('host', datagram(each))) for each in (
        text, 'E:CLEAR,7;PNum:2;', 'C:rate,50;PNum:3;', 'F:DEFAULT,CMD;PNum:4;', 'W:50,AIN5;PNum:5;',
        'P:1,2,3,4;PNum:6;')])
    rows = fields(path, 'r4.o.ch', 'r4.p.pos', 'r4.p.speed', 'r4.p.ch', 'r4.r.on', 'r4.e.cause', 'r4.c.value',
                  'r4.f.name', 'r4.w.name')
    assert rows[:5] == [['2', '-7,-7', '20', '2,3', '0', '', '', '', ''], ['', '', '', '', '', '7', '', '', ''],
                         ['', '', '', '', '', '', '50', '', ''], ['', '', '', '', '', '', '', 'DEFAULT,CMD', ''],
                         ['', '', '', '', '', '', '', '', 'AIN5']]
    assert fields(path, 'frame.number', only='r4.expert.values') == [['6']]


def damaged(rng, data):
    data = bytearray(data)
    for _ in range(rng.randrange(1, 6)):
        if data:
            data[rng.randrange(len(data))] = rng.choice([rng.randrange(256), 0, 255, 0x3A, 0x5E, 0x2C, 0x39])
    return bytes(data[:rng.randrange(len(data) + 1)] if rng.random() < 0.3 else data)


def test_rubbish_causes_no_error_in_the_dissector(tmp_path):
    rng = random.Random(18)
    texts = [line.encode() for _, line in paper()] + [datagram(text) for text in (
        'N:5,CHANNEL;PNum:1;T:1;', 'I:R4,1,2,a+b;PNum:1;', 'E:CLEAR,99999999999;PNum:99999999999;', 'P:1;PNum:7;T:-1;',
        'A:,,;PNum:1;T:99999999999999999999;', 'W:;PNum:2;', 'OSMC1:;AIN24:-;T:18446744073709551616;',
        'O:,,,,,;PNum:1;',
        'CMD:-1;SAFE:4294967296;FAULT:1;', 'STOP:1;', ':;', 'H:;')]
    rubbish = [damaged(rng, rng.choice(texts)) for _ in range(1000)] + texts
    rubbish += [rng.randbytes(rng.randrange(0, 1500)) for _ in range(100)]
    for each in list(rubbish):  # with a valid checksum, so that only later checks can reject it
        if rng.random() < 0.3 and b'^' not in each and each:
            rubbish.append(datagram(each.decode('latin-1')))
    network = write_pcap(tmp_path / 'network.pcap', RAW_IP, [(0, udp(rng.choice(['board', 'host']), each))
                                                             for each in rubbish])
    packed = [packed_form.pack(line) for _, line in paper()]
    frames = [(rng.choice([0x010, 0x021, 0x181, 0x201, 0x401, 0x601]), data)
              for each in packed * 3 for data in isotp(damaged(rng, each))]
    frames += [(0x401, damaged(rng, data)) for each in packed for data in isotp(each)]
    frames += [(rng.randrange(0x800), rng.randbytes(rng.randrange(9))) for _ in range(500)]
    bus = write_pcap(tmp_path / 'bus.pcap', SOCKETCAN,
                     [(0, can(*each, extended=rng.random() < 0.05)) for each in frames])
    for path in (network, bus):
        assert len(tshark('-r', path, '-2', '-V')) > 5000


def test_the_dissector_is_installed_by_copying(installed, tmp_path):
    path = paper_capture(tmp_path / 'paper.pcap')
    lines = tshark('-r', path, '-Y', 'r4.osmc1.pwm == 358', plugin=False, env=installed)
    assert len(lines) == sum('OSMC1:358' in line for _, line in paper())


def test_the_time_per_packet_does_not_grow_with_the_capture(tmp_path):
    def seconds_for(count):
        texts = []
        for index in range(count):
            command = 2147483648 + index // 10
            texts.append(('host', datagram(f'O:{index % 4096},1,1;PNum:{command};T:5;')) if index % 10 == 0 else
                         ('board', datagram(paper()[0][1].split('PNum')[0] + f'SAFE:0;CMD:{command};PNum:{index};T:1;')))
        path = write_pcap(tmp_path / 'long.pcap', RAW_IP,
                          [(index / 100, udp(*each)) for index, each in enumerate(texts)])
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        assert len(fields(path, 'r4.response_time', only='r4.response_time')) == count // 10
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    few, many = seconds_for(2500), seconds_for(10000)
    print(f'{few:.2f} s for 2,500 packets, {many:.2f} s for 10,000')
    assert many < 6 * few
