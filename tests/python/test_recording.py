# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.read: recordings as arrays."""
import os
import pathlib
import threading
import zlib

import numpy as np
import pytest

import r4link

DESCRIPTIONS = pathlib.Path(__file__).parents[2] / 'host' / 'devices'
HEADER = '# r4log 1 by r4 0.1.0\n# path 1 udp://192.168.0.125 left-arm\n'


def line(at, fields, path=1, direction='<'):
    body = f'{fields}^'
    return f'{1795468293 + at:.6f} {path}{direction} {body}0x{zlib.crc32(body.encode()):x}^\n'


def test_a_removed_file_is_reported_and_replaced(sim, tmp_path, wait):
    path = tmp_path / 'drive.r4log'
    with r4link.Recording(path) as recording, r4link.Board(sim.url, arming=False) as board:
        board.record(recording)
        board.wait_active()
        assert recording.problem is None
        path.unlink()
        wait(lambda: recording.problem)
        board.next_state()
    assert 'was removed' in recording.problem
    assert len(r4link.read(path).boards[0].states) > 0


def test_a_recording_contains_every_received_state(sim, tmp_path):
    path = tmp_path / 'drive.r4log.zst'
    with r4link.Board(sim.url, arming=False, fields='DEFAULT,ENC1,BLDC1,US1') as board:
        board.record(path)
        board.wait_active()
        board.osmc(1).set_pwm(358, direction=r4link.REVERSE)
        board.bldc(1).set_pwm(100)
        live = [board.next_state() for _ in range(20)]
        board.stop()
        board.next_state()
    log = r4link.read(path, datagrams=True)
    assert log.damage == [] and log.events[-1].words == 'end'
    [robot] = log.boards
    assert log[robot.name] is robot and log[robot.url] is robot and robot.damaged == 0
    assert robot.events[-2].words.startswith('down') or any(each.words == 'link safe stop' for each in robot.events)
    rows = {row['pnum']: row for row in robot.states}
    for state in live:
        row = rows[state.pnum]
        assert (row['t_ms'], row['ain24'], row['enc1'], row['us1']) == (state.t_ms, state.ain24, state.enc1, state.us1)
        assert (row['osmc1_pwm'], row['osmc1_dir'], row['bldc1_speed'], row['bldc1_brake']) == (358, 0, 100, False)
        assert row['dmhsta'] == state.dmhsta and row['cmd'] == state.cmd
    assert (np.diff(robot.states['time']) > np.timedelta64(0)).all()
    assert sum(each.direction == '<' and b'OSMC1:' in each.data for each in robot.datagrams) == len(robot.states)
    assert any(each.data.startswith(b'O:358,0,1') for each in robot.datagrams)
    frame = robot.to_pandas()
    assert frame.index.tz is not None and frame.osmc1_pwm.dtype == np.uint16 and frame.ain24.dtype == np.float64
    assert frame.osmc1_pwm.iloc[-1] == 0  # stopped


def test_reads_late_fields_two_boards_and_damage(tmp_path):
    path = tmp_path / 'two.r4log'
    path.write_text(HEADER + '# path 2 serial:auto\n' + line(0.5, 'AIN24:24.10;PNum:1;T:10;')
                    + line(0.6, 'AIN24:24.20;STEP1POS:-7;SAFE:2;PNum:4294967295;T:4294967295;')
                    + line(0.7, 'AIN24:1.00;PNum:1;T:5;', path=2) + 'no line of a recording\n'
                    + line(0.8, 'AIN24:24.30;PNum:3;T:30;').replace('24.30', '24.31'))
    log = r4link.read(path)
    left, other = log.boards
    assert left.name == 'left-arm' and log['serial:auto'] is other and other.name == ''
    assert left.states['ain24'].tolist() == [24.10, 24.20] and left.states['step1pos'].tolist() == [0, -7]
    assert left.states['safe'].tolist() == [0, 2] and left.states['pnum'].tolist() == [1, 2**32 - 1]
    assert left.states['time'][0] == np.datetime64('2026-11-23T21:11:33.500000')
    assert other.states.dtype.names == ('time', 't_ms', 'pnum', 'ain24')
    assert left.damaged == 1 and len(log.damage) == 1 and log.damage[0].startswith('line 7, byte ')
    with pytest.raises(KeyError, match='left-arm'):
        log['right-arm']  # pylint: disable=pointless-statement


def test_an_error_escapes_bytes_that_are_not_text(tmp_path):
    path = tmp_path / 'later.r4log'
    path.write_bytes(b'# r4log 9 by r4 \xff\x1b]0;owned\x07 \xe2\x80\xae\n')
    with pytest.raises(r4link.DataError) as error:
        r4link.read(path)
    assert str(error.value).isprintable() and error.value.reason.isprintable()
    assert r'by r4 \xff\x1b]0;owned\x07 \xe2\x80\xae' in str(error.value)


def test_names_and_events_escape_bytes_that_are_not_text(tmp_path):
    path = tmp_path / 'others.r4log'
    path.write_text('# r4log 1 by r4 0.1.0\n# path 1 udp://\\xff\\x1b]0;owned arm\\xff\n'
                    '1795468293.000000 1! down \\xff\\x1b]0;owned\n')
    [board] = r4link.read(path).boards
    assert (board.url, board.name) == (r'udp://\xff\x1b]0;owned', '')
    assert [each.words for each in board.events] == [r'down \xff\x1b]0;owned']


def device(place, text, path=1):
    escaped = text.replace('\\', '\\x5c').replace('\n', '\\x0a')
    return f'# device {path} {place} {escaped}\n'


def test_a_replaced_device_has_no_more_values(tmp_path):
    path = tmp_path / 'replaced.r4log'
    angle, power = ((DESCRIPTIONS / f'{name}.device').read_text() for name in ('as5600', 'ina219'))
    both = 'I2C1:5,0,x0400;I2C2:5,0,x20;'
    path.write_text(HEADER + device('as5600@0x36:1', angle) + line(0.1, both + 'PNum:1;T:10;')
                    + device('ina219@0x40:1', power) + line(0.2, 'I2C1:15,0,x07d0;I2C2:15,0,x5d98;PNum:2;T:20;')
                    + HEADER + line(0.3, both + 'PNum:1;T:10;'))
    [board] = r4link.read(path).boards
    assert board.states['as5600_angle'][0] == pytest.approx(np.pi / 2)
    assert np.isnan(board.states['as5600_angle'][1:]).all()
    assert board.states['ina219_current'][1] == pytest.approx(0.2)
    assert np.isnan(board.states['ina219_current'][[0, 2]]).all(), 'a value of another recording was used'


def test_each_number_of_a_field_has_a_column(tmp_path):
    path = tmp_path / 'numbers.r4log'
    path.write_text(HEADER + line(0.1, 'AIN24:-0.05;OSMC1:400,1;BLDC1:7,0,1;RELAYS:129;SAFE:2;CMD:4294967295;ENC1:-5;'
                                       'I2C1:5,1,x07;I2CX:5,3,x;I2CBUS:1,2,3;UART1:9,2,x41;FAULT:64,1;PNum:1;T:10;'))
    [board] = r4link.read(path).boards
    assert {name: board.states[name][0].item() for name in board.states.dtype.names[3:]} == {
        'ain24': -0.05, 'osmc1_pwm': 400, 'osmc1_dir': 1, 'bldc1_speed': 7, 'bldc1_dir': 0, 'bldc1_brake': True,
        'relays': 129, 'safe': 2, 'cmd': 4294967295, 'enc1': -5, 'i2c1_t_ms': 5, 'i2c1_errors': 1, 'i2cx_pnum': 5,
        'i2cx_outcome': 3, 'i2cbus_outcome': 1, 'i2cbus_errors': 2, 'i2cbus_recoveries': 3, 'uart1_position': 9,
        'uart1_lost': 2, 'fault_chip': 64, 'fault_trouble': 1}


def test_device_values_may_have_the_names_of_other_columns(tmp_path):
    path = tmp_path / 'names.r4log'
    mine = 'device t\ntitle t\naddress 0x40\npoll all x00 1 100\nvalue ms all 0 u8\n'
    path.write_text(HEADER + device('t@0x40:1', mine) + line(0.1, 'I2C1:5,0,x07;PNum:1;T:10;'))
    [board] = r4link.read(path).boards
    assert board.states['t_ms'].tolist() == [10] and board.states['t_ms_'].tolist() == [7]


def test_too_many_device_values_are_reported(tmp_path):
    path = tmp_path / 'many.r4log'
    values = ''.join(f'value v{i} all 0 u8\n' for i in range(250))
    path.write_text(HEADER + ''.join(
        device('t%d@0x40:1' % n, f'device t{n}\ntitle t\naddress 0x40\npoll all x00 1 100\n{values}')
        for n in range(6)) + line(0.1, 'I2C1:5,0,x07;PNum:1;T:10;'))
    log = r4link.read(path)
    assert len(log.boards[0].states.dtype.names) < 1010
    assert any('so many values' in each for each in log.damage), log.damage


@pytest.mark.parametrize('written, states, damaged', [
    (HEADER + line(0.5, 'AIN24:24.10;PNum:1;T:10;') + line(0.6, 'AIN24:24.20;PNum:2;T:20;')[:-9], 1, 1), ('', None, 0)])
def test_a_fifo_is_read_until_its_writer_ends(tmp_path, written, states, damaged):
    path = tmp_path / 'fifo.r4log'
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=(written,))
    writer.start()
    if states is None:
        with pytest.raises(r4link.DataError, match='fifo.r4log'):
            r4link.read(path)
    else:
        log = r4link.read(path)
        assert len(log.boards[0].states) == states and len(log.damage) == damaged
    writer.join()


@pytest.mark.parametrize('content, error', [(b'\0' * 100_000, r4link.DataError), (b'', r4link.DataError),
                                            (b'# r4log 2 by r4 9\n', r4link.DataError), (None, r4link.OpenError)])
def test_an_invalid_recording_is_reported(tmp_path, content, error):
    path = tmp_path / 'x.r4log'
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(error) as raised:
        r4link.read(path)
    assert str(path) in raised.value.thing
    with pytest.raises(r4link.OpenError, match='directory'):
        r4link.read(tmp_path)


def test_a_recording_of_a_later_version_is_refused(tmp_path):
    path = tmp_path / 'x.r4log'
    path.write_text(HEADER.replace('r4log 1', 'r4log 2'))
    with pytest.raises(r4link.DataError, match='version') as raised:
        r4link.read(path)
    assert raised.value.fix
