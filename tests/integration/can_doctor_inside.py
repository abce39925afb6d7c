# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: r4 doctor reports and mends interfaces that are set up wrongly."""
import pathlib
import subprocess

import pytest

from r4_process import Board, objects, run

REFUSED, OPEN, UNSUPPORTED = 3, 4, 6


def ip(*arguments):
    subprocess.run(['ip', 'link', *arguments], check=True)


def doctor(*arguments, listen='0.01'):
    """Returns the exit code, and the findings by their checks."""
    result = run('doctor', *arguments, '--duration', listen, '--json', timeout=60)
    return result.returncode, {each['check']: each for each in objects(result.stdout) if each['type'] == 'finding'}


def doctor_that_finds(check, words, url):
    """As doctor(), but listens longer and longer until the check reports the words."""
    for listen in (2, 4, 8, 16):
        code, found = doctor(url, listen=str(listen))
        if words in found.get(check, {}).get('reason', ''):
            return code, found
    raise AssertionError(found)


def queue(name):
    return int(pathlib.Path(f'/sys/class/net/{name}/tx_queue_len').read_text(encoding='ascii'))


@pytest.fixture(name='controller')
def can0():
    """Yields can0, and restores the guest's setup at the end."""
    yield 'can0'
    ip('set', 'can0', 'down')
    ip('set', 'can0', 'up', 'txqueuelen', '1000', 'type', 'can', 'bitrate', '1000000', 'restart-ms', '100')


def test_doctor_warns_about_a_missing_restart_and_a_short_queue(controller):
    ip('set', controller, 'down')
    ip('set', controller, 'up', 'txqueuelen', '10', 'type', 'can', 'bitrate', '500000', 'restart-ms', '0')
    _, found = doctor(f'can://{controller}?node=1')
    assert found['can.restart']['severity'] == found['can.queue']['severity'] == 'warning'
    assert 'txqueuelen is 10' in found['can.queue']['reason'] and not found['can.restart']['automatic']
    _, found = doctor(f'can://{controller}?node=1', '--fix')
    assert queue(controller) == 1000
    assert subprocess.run(found['can.restart']['fix'], shell=True, check=False).returncode == 0
    _, found = doctor(f'can://{controller}?node=1')
    assert 'can.restart' not in found and 'can.queue' not in found
    assert found['can.interface']['reason'] == 'up, error-active, 500 kbit/s'


def test_doctor_fix_brings_a_controller_up(controller):
    ip('set', controller, 'down')
    code, found = doctor(f'can://{controller}?node=1')
    assert code == OPEN and 'its bit rate is' in found['can.down']['reason'], found
    _, found = doctor(f'can://{controller}?node=1', '--fix')
    assert 'can.down' not in found and found['can.interface']['severity'] == 'ok'


def test_doctor_reports_a_missing_interface():
    code, found = doctor('can://can7?node=1')
    assert code == UNSUPPORTED and found['can.missing']['severity'] == 'error'


def test_doctor_fix_brings_a_virtual_bus_up():
    ip('set', 'vcan0', 'down')
    code, found = doctor('can://vcan0?node=1')
    assert code == OPEN and found['can.down']['automatic']
    run('doctor', 'can://vcan0?node=1', '--fix', '--duration', '0.01', timeout=60)
    with Board('can://vcan0?node=1'):
        _, found = doctor_that_finds('link', 'the board answers in', 'can://vcan0?node=1')
    assert found['link']['severity'] == 'ok', found
    assert found['can.load']['severity'] == 'ok' and found['can.interface']['reason'] == 'up, virtual'


def test_doctor_names_another_protocol_on_an_id_of_the_board():
    words = 'are not R4 datagrams'
    with Board('can://vcan0?node=5'):
        with subprocess.Popen(['cangen', 'vcan0', '-I', '185', '-L', '8', '-D', 'i', '-g', '10']) as other:
            sent = run('send', 'can://vcan0?node=5', 'R:1,On')
            code, found = doctor_that_finds('link.answer', words, 'can://vcan0?node=5')
            other.terminate()
    assert sent.returncode == REFUSED and words in sent.stderr and 'another host' not in sent.stderr, sent
    assert code == REFUSED, found
    assert 'CANopen TPDO1 of node 5' in found['can.foreign']['reason'], found


def test_doctor_reports_a_bus_that_delays_frames():
    with Board('can://vxcan1?node=1'):
        for name in ('vxcan0', 'vxcan1'):
            subprocess.run(f'tc qdisc replace dev {name} root netem delay 30ms limit 2000', shell=True, check=True)
        try:
            code, found = doctor_that_finds('link.answer', 'does not come within 20 ms', 'can://vxcan0?node=1')
        finally:
            for name in ('vxcan0', 'vxcan1'):
                subprocess.run(f'tc qdisc del dev {name} root', shell=True, check=True)
    assert code == REFUSED, found
