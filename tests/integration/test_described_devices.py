# SPDX-License-Identifier: GPL-3.0-or-later
"""Described devices: r4 devices, monitor and convert with --device, as docs/how-to/described-devices.md shows them."""
import csv
import time

import pytest

from r4_process import PATIENCE_S, Board, Running, objects, run
from web_client import Page, Web

MINE = """device mine
title A divider behind an INA219
address 0x40
poll bus x02 2 20
value volts bus 0 u16be bits 3..15 scale 0.004 unit V
"""


@pytest.fixture(name='board')
def a_simulated_board():
    with Board('udp://127.0.0.1:0', options=('--device', 'bno055', '--device', 'as5600')) as board:
        yield board


def is_reading(device, value):
    def looks_right(line):
        return line['type'] == 'reading' and line['device'] == device and line['fields'].get(value) is not None
    return looks_right


def test_r4_devices_lists_the_shipped_devices():
    listed = run('devices').stdout.splitlines()
    assert [line.split()[0] for line in listed] == ['as5600', 'bno055', 'icm20948', 'ina219', 'mpu6050', 'vl53l0x']
    assert objects(run('devices', 'ina219', '--json').stdout)[0]['values']['current'] == 'A'
    assert 'gyro_z           rad/s    every 20 ms' in run('devices', 'bno055').stdout


def test_a_wrong_description_is_reported_with_its_line(tmp_path):
    path = tmp_path / 'mine.device'
    path.write_text(MINE.replace('bus 0', 'bus 1'))
    result = run('devices', str(path))
    assert result.returncode == 1
    assert f'{path}, line 5: the value ends after the 2 bytes of its poll' in result.stderr
    for command in (('devices', 'bno056'), ('monitor', 'udp://127.0.0.1', '--device', 'bno056'),
                    ('monitor', 'udp://127.0.0.1', '--device', 'bno055@0x30'),
                    ('monitor', 'udp://127.0.0.{1-2}', '--device', 'bno055'),
                    ('convert', 'x.r4log', '-o', 'x.csv', '--device', 'bno055@0x28:8'),
                    ('sim', '--device', 'bmp280')):
        assert run(*command).returncode == 2, command


def test_monitor_sets_up_devices_and_shows_their_values(board, tmp_path):
    path = tmp_path / 'mine.device'
    path.write_text(MINE)
    devices = ['--device', 'bno055@0x28', '--device', 'as5600', '--device', f'{path}@0x40:7']
    with Running('monitor', board.host_url, *devices, '--json') as monitor:
        assert monitor.next(is_reading('bno055@0x28', 'accel_z'))['fields']['accel_z'] == pytest.approx(9.81)
        assert monitor.next(is_reading('as5600@0x36', 'angle'))['fields']['angle'] == pytest.approx(1.5708, abs=1e-4)
        assert monitor.next(is_reading('mine@0x40', 'volts'))['fields']['volts'] == pytest.approx(12.16)
        # A second monitor has no control, and shows the devices that the first monitor has set up.
        with Running('monitor', board.host_url, *devices, '--json') as beside:
            assert beside.next(is_reading('bno055@0x28', 'heading'))['fields']['heading'] == 270
    wrong = run('monitor', board.host_url, '--device', 'icm20948@0x68', '--duration', '2')
    assert 'icm20948@0x68: this is another device: its register x00 has x00, not xea' in wrong.stdout


def test_a_reset_device_is_reported_and_set_up_again(tmp_path):
    scenario = tmp_path / 'reset.txt'
    scenario.write_text('2.5 device mpu6050 reset\n')
    with Board('udp://127.0.0.1:0', options=('--script', str(scenario))) as board:
        with Running('monitor', board.host_url, '--device', 'mpu6050', '--json') as monitor:
            monitor.next(is_reading('mpu6050@0x68', 'accel_z'))
            monitor.next(lambda each: is_reading('mpu6050@0x68', 'power_mode')(each)
                         and each['fields']['power_mode'] == 0x40)
            meanwhile = []
            again = monitor.next(lambda each: meanwhile.append(each) or is_reading('mpu6050@0x68', 'accel_z')(each))
            assert again['fields']['accel_z'] == pytest.approx(9.80665)
            measured = [each['fields'] for each in meanwhile[:-1] if each['type'] == 'reading']
            assert any('accel_z' in each for each in measured)
            [told] = [each['fields'] for each in meanwhile if each['type'] == 'error']
            assert told['thing'] == 'mpu6050@0x68' and told['reason'].startswith('it is not set up, as after a reset')


def test_convert_writes_device_values_as_columns_with_units(board, tmp_path):
    log, table = tmp_path / 'drive.r4log', tmp_path / 'drive.csv'
    with Running('monitor', board.host_url, '--device', 'bno055', '--json') as monitor:
        monitor.next(is_reading('bno055@0x28', 'accel_z'))
        assert run('record', board.host_url, '-o', str(log), '--duration', '0.5').returncode == 0
    assert run('convert', str(log), '-o', str(table), '--device', 'bno055@0x28:1').returncode == 0
    with open(table, encoding='ascii') as file:
        rows = list(csv.DictReader(file))
    assert {row['bno055@0x28 heading [deg]'] for row in rows} == {'270'}
    assert {row['bno055@0x28 accel_z [m/s2]'] for row in rows} == {'9.81'}
    assert run('convert', str(log), '-o', str(tmp_path / 'drive.pcapng'), '--device', 'bno055').returncode == 2


def test_a_recording_includes_the_descriptions_of_its_devices(board, tmp_path):
    """The file of a user's own description is deleted before the recording is read."""
    mine, log, table = tmp_path / 'mine.device', tmp_path / 'drive.r4log', tmp_path / 'drive.csv'
    mine.write_text(MINE)
    devices = ['--device', 'bno055@0x28:1', '--device', f'{mine}@0x40:7']
    with Running('monitor', board.host_url, *devices, '--json') as monitor:
        monitor.next(is_reading('mine@0x40', 'volts'))
        assert run('record', board.host_url, '-o', str(log), '--duration', '0.5', *devices).returncode == 0
    mine.unlink()
    assert objects(run('info', str(log), '--json').stdout)[0]['paths'][0]['devices'] == ['bno055@0x28:1', 'mine@0x40:7']
    assert run('convert', str(log), '-o', str(table)).returncode == 0
    with open(table, encoding='ascii') as file:
        rows = list(csv.DictReader(file))
    assert {row['bno055@0x28 accel_z [m/s2]'] for row in rows} == {'9.81'}
    assert all(float(row['mine@0x40 volts [V]']) == pytest.approx(12.16) for row in rows)


def test_a_controlling_page_sets_up_devices_and_shows_their_values(board):
    with Web(board.host_url, options=('--device', 'bno055')) as web, Page(web) as page:
        place = page.hello['fields'].index('bno055@0x28.gyro_z')
        assert page.hello['units'][place] == 'rad/s'
        assert page.states(1)[0]['bno055@0x28.accel_z'] is None
        page.drive()
        deadline = time.monotonic() + PATIENCE_S
        while page.states(1)[-1]['bno055@0x28.accel_z'] != 9.81:
            assert time.monotonic() < deadline
