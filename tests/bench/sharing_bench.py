#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What it costs a program that drives a board when others watch it by the same wire.

    PYTHONPATH=build/python R4=build/r4 tests/bench/sharing_bench.py udp|pty|URL [SECONDS] [ROUNDS]

In each round the program drives alone, and then with five others beside it: r4 monitor, r4 record, two programs
that watch, and at the end r4 stop. Of the program's own recording: how old its states are when they come (against
the fastest of them), and how far apart its heartbeats went out. Then three r4 send in a row, which hold the wire
by turns. A bus of the kernel is a URL: tools/with-can --guest … can://vcan0. Prints medians over the rounds.
"""
import contextlib
import json
import os
import pathlib
import queue
import statistics
import subprocess
import sys
import tempfile
import threading
import time

R4 = os.environ.get('R4', 'r4')
DRIVER = '''
import sys, time, r4link
url, path, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
with r4link.Board(url) as board:
    board.wait_active(timeout=10)
    board.arm(timeout=10)
    board.record(path)
    print('driving', flush=True)
    until = time.monotonic() + seconds
    step = time.monotonic()
    while time.monotonic() < until:
        board.osmc(1).post(300)
        step += 0.01
        time.sleep(max(0, step - time.monotonic()))
    if len(sys.argv) > 4:
        sys.stdin.readline()
'''
WATCHER = '''
import sys, r4link
with r4link.Board(sys.argv[1], role='watch') as board:
    for state in board.states(most=100):
        pass
'''


def p99(numbers):
    return sorted(numbers)[int(len(numbers) * 0.99)]


def ms(seconds):
    return f'{seconds * 1e3:.2f}'


class Board:
    """r4 sim on a transport; the lines that it prints, with their times."""

    def __init__(self, where):
        url = {'udp': 'udp://127.0.0.1:0', 'pty': 'pty:'}.get(where, where)
        self.process = subprocess.Popen([R4, 'sim', url, '--json'], stdout=subprocess.PIPE, text=True)
        self.url = next(line['host_url'] for line in self.lines() if line['type'] == 'listening')
        self.kept = queue.Queue()
        threading.Thread(target=self.keep_lines, daemon=True).start()

    def lines(self):
        for line in self.process.stdout:
            yield json.loads(line)

    def keep_lines(self):
        for line in self.lines():
            self.kept.put((time.monotonic(), line))

    def when_stopped(self, since):
        """When its outputs were off, for somebody has pressed the stop."""
        while True:
            at, line = self.kept.get(timeout=30)
            if line.get('state') == 'SAFE' and line['reason'] == 'stop' and at > since:
                return at

    def close(self):
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def beside(*arguments):
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def of_recording(path):
    """Ages of the states, spacings of the heartbeats; seconds."""
    states, beats = [], []
    for line in pathlib.Path(path).read_text().splitlines():
        if line.startswith('#') or len(line) < 20:
            continue
        at, what, datagram = line.split(' ', 2)
        fields = dict(part.split(':', 1) for part in datagram.split('^')[0].split(';') if ':' in part)
        if what[-1] == '<' and 'AIN24' in fields:
            states.append((float(at), int(fields['T']) / 1000))
        elif what[-1] == '>' and fields.get('H') == 'ROS2-R4':
            beats.append(float(at))
    offset = min(at - t for at, t in states)
    return [at - t - offset for at, t in states], [b - a for a, b in zip(beats, beats[1:])]


def drive(board, seconds, folder, others=()):
    path = os.path.join(folder, f'{time.monotonic_ns()}.r4log')
    with contextlib.ExitStack() as stack:
        for each in others:
            stack.enter_context(beside(*each))
        if others:
            time.sleep(1)  # they are there before what is measured
        subprocess.run([sys.executable, '-c', DRIVER, board.url, path, str(seconds)], check=True,
                       stdout=subprocess.DEVNULL)
    return of_recording(path)


def watchers(url, folder):
    return [(R4, 'monitor', url, '--json'), (R4, 'record', url, '-o', os.path.join(folder, f'{time.monotonic_ns()}.w.r4log')),
            (sys.executable, '-c', WATCHER, url), (sys.executable, '-c', WATCHER, url)]


def stop_beside(board, folder):
    """From the start of r4 stop to safe outputs, while another program drives."""
    path = os.path.join(folder, f'{time.monotonic_ns()}.r4log')
    with subprocess.Popen([sys.executable, '-c', DRIVER, board.url, path, '1', 'wait'], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as driver:
        driver.stdout.readline()
        time.sleep(0.3)
        began = time.monotonic()
        with beside(R4, 'stop', board.url) as process:
            safe = board.when_stopped(began)
            process.wait()
        driver.stdin.close()
        driver.kill()
    return safe - began


def main():
    where = sys.argv[1]
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    board = Board(where)
    try:
        with tempfile.TemporaryDirectory() as folder:
            alone, beside_others = [], []
            for _ in range(rounds):
                alone.append(drive(board, seconds, folder))
                beside_others.append(drive(board, seconds, folder, watchers(board.url, folder)))
            for name, index in (('age of states, p50', 0), ('age of states, p99', 0), ('heartbeats apart, p50', 1),
                                ('heartbeats apart, p99', 1)):
                which = p99 if 'p99' in name else statistics.median
                before, after = (statistics.median(which(each[index]) for each in runs) for runs in (alone, beside_others))
                print(f'{name:24} {ms(before):>8} ms alone {ms(after):>8} ms with four others, {after / before:.3f} times')
            version = []
            for _ in range(5):
                began = time.monotonic()
                subprocess.run([R4, '--version'], check=True, stdout=subprocess.DEVNULL)
                version.append(time.monotonic() - began)
            stops = []
            for _ in range(rounds):
                stops.append(stop_beside(board, folder))
                subprocess.run([R4, 'send', board.url, 'E:CLEAR'], check=True, stdout=subprocess.DEVNULL)
            print(f'r4 stop: outputs safe {ms(statistics.median(stops))} ms after it was started; '
                  f'r4 --version takes {ms(statistics.median(version))} ms')
            sends = []
            for _ in range(3):
                began = time.monotonic()
                subprocess.run([R4, 'send', board.url, 'S:1500,3'], check=True,
                               stdout=subprocess.DEVNULL)
                sends.append(time.monotonic() - began)
            print('three r4 send in a row:', ', '.join(f'{ms(each)} ms' for each in sends))
    finally:
        board.close()


main()
