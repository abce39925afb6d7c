# SPDX-License-Identifier: GPL-3.0-or-later
"""The monitor with hostile datagrams, and with a reader that does not read its output."""
import json
import os
import pty
import re
import select
import signal
import socket
import subprocess
import time
import zlib

from m7_board import Relay
from machine import SANITIZED
from r4_process import PATIENCE_S, R4, Board


def datagram(fields):
    text = fields.encode() + b'^'
    return text + hex(zlib.crc32(text)).encode() + b'^'


def test_noise_and_a_stalled_pipe_do_not_stall_the_heartbeats():
    with Board('udp://127.0.0.1:0', options=['--set', 'rate,500']) as board, Relay(board.url) as relay, \
            subprocess.Popen([R4, 'monitor', relay.url, '--json', '--control'], text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE) as host:
        assert host.stdout.readline()
        board.state('ACTIVE')
        # The test stops reading. The pipe of 64 kB is full after about 250 states (half a second).

        def make_noise():
            for _ in range(10):
                relay.to_host.sendto(bytes(range(128, 256)) * 8, relay.host)

        board.never('SAFE', 1.8, make_noise)
        host.send_signal(signal.SIGINT)
        host.stdout.read()
        assert 'left out' in host.stderr.read()
        assert host.wait() == 0


def test_monitor_shows_the_boards_of_a_url_pattern():
    ports = 'udp://127.0.0.1:28620-28624'
    with Board(ports, listens=5):
        shown = subprocess.run([R4, 'monitor', f'{ports}?listen=0', '--duration', '1'], text=True, capture_output=True,
                               timeout=PATIENCE_S, check=True).stdout
        last = shown[shown.rindex('5 boards'):].splitlines()
        assert last[1].split() == ['board', 'Hz', 'lost', 'damaged', 'link'], last
        rows = [row.split()[:3] for row in last[2:]]
        assert [url for url, _, _ in rows] == [f'udp://127.0.0.1:{28620 + i}?listen=0' for i in range(5)]
        assert all(float(rate) > 10 and lost == '0' for _, rate, lost in rows), rows

        told = subprocess.run([R4, 'monitor', f'{ports}?listen=0', '--json', '--count', '100'], text=True,
                              capture_output=True, timeout=PATIENCE_S, check=True).stdout
        lines = [json.loads(line) for line in told.splitlines()]
        states = [line['transport'] for line in lines if line['type'] == 'state']
        assert len(states) == 100 and len(set(states)) == 5, states
    gone = subprocess.run([R4, 'monitor', 'udp://127.0.0.1:28620-28621?listen=0', '--duration', '0.2'], text=True,
                          capture_output=True, timeout=PATIENCE_S, check=False)
    assert gone.returncode == 3 and 'udp://127.0.0.1:28620?listen=0' in gone.stderr, gone


def read_screen(master, until):
    """Reads the screen until the text `until` is drawn."""
    screen = ''
    deadline = time.monotonic() + PATIENCE_S
    while until not in screen:
        ready, _, _ = select.select([master], [], [], max(0, deadline - time.monotonic()))
        assert ready, f'{until!r} was not drawn: {screen[-1000:]!r}'
        screen += os.read(master, 65536).decode()


def resident_kib(process):
    with open(f'/proc/{process.pid}/status', encoding='ascii') as status:
        return int(re.search(r'VmRSS:\s*(\d+)', status.read()).group(1))


def test_new_field_names_do_not_grow_the_memory_of_monitor():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        board.bind(('127.0.0.1', 0))
        board.settimeout(PATIENCE_S)
        master, slave = pty.openpty()
        url = f'udp://127.0.0.1:{board.getsockname()[1]}?listen=0'
        with subprocess.Popen([R4, 'monitor', url], stdout=slave) as process:
            os.close(slave)
            _, host = board.recvfrom(2000)
            sizes = []
            for pnum in range(1, 1001):
                fields = ''.join(f'X{pnum}x{i}:1;' for i in range(60))
                board.sendto(datagram(f'{fields}PNum:{pnum};T:{pnum};'), host)
                if pnum % 50 == 0:
                    read_screen(master, f'PNum {pnum} ')  # the monitor has shown this state
                    sizes.append(resident_kib(process))
            process.kill()
        os.close(master)
    print(f'resident after 50 states {sizes[0]} KiB, after 1000 {sizes[-1]} KiB')
    assert SANITIZED or sizes[-1] < sizes[0] + 1000
