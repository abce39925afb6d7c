# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of test_usb_serial.py that runs inside the guest. A failure is an exception.

The USB serial port is real for the kernel's driver, sysfs and libserialport. Our standard input and output are
another path to the same board, so messages go to standard error.
"""
import json
import os
import pathlib
import pty
import queue
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tty

from machine import account
from r4_process import PATIENCE_S, Running, driving, free_port, is_link, is_state, monitor, objects, run, send, stop_takes_ms, watch
from test_upload import write_fake_dfu_util
from test_usb_serial import carry
from host_on_paths import HostOnPaths

NETLINK_KOBJECT_UEVENT = 15
PORT = '/dev/ttyUSB0'


def kernel_reports():
    """A queue of (time, action) of the port, as the kernel reports them."""
    reports = queue.Queue()
    events = socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, NETLINK_KOBJECT_UEVENT)
    events.bind((0, 1))

    def read():
        while True:
            event = events.recv(65536)
            now = time.monotonic()
            if b'\0DEVNAME=ttyUSB0\0' in event + b'\0':
                reports.put((now, event.split(b'@')[0].decode()))
    threading.Thread(target=read, daemon=True).start()
    return reports


def other_path():
    """A terminal that reaches the board by our standard input and output, which have no other use from now on."""
    near, far = pty.openpty()
    tty.setraw(far)
    carry(0, near)
    carry(near, os.dup(1))
    os.dup2(2, 1)
    return os.ttyname(far)


def is_down(each):
    return each['type'] == 'link' and not each['fields']['up']


def listed(*options):
    """The port in r4 list. With `--serial`, r4 queries the board, although the port's USB id is not a board's."""
    ports = [each for each in objects(run('list', '--json', *options).stdout) if each['type'] == 'port']
    port = next(each for each in ports if each['path'] == PORT)
    assert (port['usb'], port['serial_number']) == ('0403:6001', 'R4-0001'), port
    return port


def listed_with_who_controls_it():
    assert 'board_id' not in listed(), 'r4 list asked an unknown device'
    free = listed('--serial', PORT)
    assert free['board_id'] == 'sim-1' and free['firmware'] and free['busy'] is False, free
    with driving(f'serial://{PORT}', 'O:358,1,1') as host:
        held = listed()
        assert held['board_id'] == 'sim-1' and held['busy'], held
        assert held['held_by'] == {'program': 'r4', 'pid': host.process.pid, 'controls': True}, held
        host.end()


def streams_at_the_boards_rate():
    with monitor(f'serial://{PORT}') as host:
        host.next(is_state)
        rate = subprocess.run(['stty', '-F', PORT, 'speed'], capture_output=True, text=True,
                              check=False)
        # While r4 has the port, only root can open the port.
        assert rate.stdout == '1000000\n' if os.geteuid() == 0 else 'busy' in rate.stderr, rate
        states = [host.next(is_state) for _ in range(50)]
        assert host.end() == 0
    steps = [later['t'] - earlier['t'] for earlier, later in zip(states, states[1:])]
    assert statistics.median(steps) == 10, steps


def unplugged_and_plugged_in_again():
    reports = kernel_reports()
    with monitor('serial:?sn=R4-0001') as host:
        host.next(is_link('active'))
        host.next(is_state)
        subprocess.run(['r4-usb', 'unplug'], check=True)
        removed = reports.get(timeout=PATIENCE_S)
        assert removed[1] == 'remove'
        down = host.next(is_down)
        subprocess.run(['r4-usb', 'plug'], check=True)
        added = reports.get(timeout=PATIENCE_S)
        assert added[1] == 'add'
        active = host.next(is_link('active'))
        host.next(is_state)
        print(f"down {(down['came'] - removed[0]) * 1000:.1f} ms after the kernel's report, "
              f"in control again {(active['came'] - added[0]) * 1000:.0f} ms after it")
        assert host.end() == 0, host.errors


def shared_by_programs():
    by_path, by_number = f'serial://{PORT}', 'serial:?sn=R4-0001'

    def drives(each):
        return is_state(each) and each['fields'].get('OSMC1') == [358, 1]

    with watch(by_path) as early:
        early.next(is_state)
        with driving(by_number, 'O:358,1,1') as host, watch(by_number) as late:
            for watcher in (early, late):
                watcher.next(drives)
            refused = run('send', by_path, 'O:1,1,1')
            assert refused.returncode == 3, refused
            assert f'controlled by r4 (pid {host.process.pid})' in refused.stderr, refused
            stop_takes_ms(by_path)
            host.process.kill()
            early.skip_past()
            early.next(lambda each: is_state(each) and each['fields'].get('SAFE') == 2)
        cleared = send(by_path, '--timeout', '20', 'E:CLEAR')
        assert cleared.returncode == 0, cleared


def one_of_two_paths(terminal, commands):
    """Drives over two paths, the port and UDP by a gateway. `commands`: the file for the result of each command."""
    reports = kernel_reports()
    port = free_port()

    def by_usb(order, action):
        def act():
            subprocess.run(['r4-usb', order], check=True)
            at, what = reports.get(timeout=PATIENCE_S)
            assert what == action
            return at
        return act

    with Running('bridge', f'udp://127.0.0.2:{port}', f'serial://{terminal}', '--json'), \
            HostOnPaths([f'serial://{PORT}', f'udp://127.0.0.2:{port}?listen=0'], [PORT, '127.0.0.2']) as host:
        def both():
            host.goes_on(50)  # until the board has also joined both paths

        both()
        host.loses(PORT, by_usb('unplug', 'remove'))
        host.goes_on()
        host.has_again(PORT, by_usb('plug', 'add'))
        both()
        commands.write_text(json.dumps(host.commands_at_its_end()))


def uploads_to_the_board_that_it_stopped():
    """Another board also waits in its boot loader. r4 identifies a board by its place at USB."""
    place = re.search(r'/(\d+-[\d.]+)/\1:', os.path.realpath('/sys/class/tty/ttyUSB0'))[1]
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder)
        (path / 'link').symlink_to(PORT)
        write_fake_dfu_util(path, f'9-9 {place}')
        os.environ.update(PATH=f'{path}/bin:{os.environ["PATH"]}', R4_TEST_DFU=folder)
        done = run('upload', f'{folder}/sketch.bin', f'serial://{folder}/link', '--json')
        assert done.returncode == 0, done
        assert [each['type'] for each in objects(done.stdout)][::len(objects(done.stdout)) - 1] == ['stopped', 'identity']
        assert f' -p {place} ' in (path / 'calls').read_text().splitlines()[-1]
    assert send(f'serial://{PORT}', '--timeout', '20', 'E:CLEAR').returncode == 0


account.begin()
TERMINAL = other_path()
listed_with_who_controls_it()
streams_at_the_boards_rate()
shared_by_programs()
uploads_to_the_board_that_it_stopped()
unplugged_and_plugged_in_again()
one_of_two_paths(TERMINAL, pathlib.Path(sys.argv[1]))
