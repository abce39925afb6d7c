#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost for a program that drives a board when other programs watch the board over the same path.

    PYTHONPATH=build/python R4=build/r4 tests/bench/sharing_bench.py udp|pty|can|usb|URL [SECONDS] [ROUNDS] [--trouble]

udp and pty are on this machine, with a simulated board. can and usb are in a guest of tools/with-can, whose processor
is emulated. can is the bus vcan0, and usb is a USB serial port, each with a simulated board. URL is a bus of this
machine, on which this program simulates a board, or a serial port with a board at its other end.

In each round the program drives alone, then beside five watching programs (r4 monitor, r4 record, and three other
programs), then alone again. The difference between the two times alone is the noise of the machine. The
benchmark measures the processor time of the program. The program's own recording gives the age of states at their
arrival (relative to the fastest), the intervals of heartbeats, and the number of missing packet numbers. With --trouble
one watching program is stopped (SIGSTOP) all the time, and another is killed half way. Then the driving program is
killed beside five watching programs, which shows the number of states that r4 record loses. Then r4 stop runs beside
all programs, and three r4 send in a row.
Prints medians over the rounds, and the sum of all missing packet numbers.
"""
import argparse
import contextlib
import json
import os
import pathlib
import queue
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import zlib

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
        board.osmc(1).post_pwm(300)
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


class SimulatedBoard:
    """r4 sim on a transport, and the lines that r4 sim prints, with the times."""

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
        """The time at which the outputs were off because of a stop."""
        while True:
            at, line = self.kept.get(timeout=30)
            if line.get('state') == 'SAFE' and line['reason'] == 'stop' and at > since:
                return at

    def close(self):
        self.process.kill()
        self.process.wait()


class OtherBoard:
    """A board that exists already."""

    def __init__(self, url):
        self.url = url

    def when_stopped(self, _):
        return None

    def close(self):
        pass


@contextlib.contextmanager
def beside(*arguments):
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def datagrams_of(path):
    """The time, the direction and the text of each datagram that a reader accepts."""
    for line in pathlib.Path(path).read_text('ascii', 'replace').splitlines():
        at, what, datagram = (line.split(' ', 2) + ['', ''])[:3]
        body, _, check = datagram.partition('^0x')
        if not line.startswith('#') and re.fullmatch('[0-9a-f]{1,8}\\^', check) and \
                int(check[:-1], 16) == zlib.crc32(body.encode() + b'^'):
            yield float(at), what, datagram


def of_recording(path):
    """The ages of the states and intervals of the heartbeats, in seconds, and the number of missing packet numbers."""
    states, beats, numbers = [], [], []
    for at, what, datagram in datagrams_of(path):
        fields = dict(part.split(':', 1) for part in datagram.split('^')[0].split(';') if ':' in part)
        if what[-1] == '<' and 'PNum' in fields:
            numbers.append(int(fields['PNum']))
        if what[-1] == '<' and 'AIN24' in fields:
            states.append((at, int(fields['T']) / 1000))
        elif what[-1] == '>' and fields.get('H') == 'ROS2-R4':
            beats.append(at)
    offset = min(at - t for at, t in states)
    missing = max(numbers) - min(numbers) + 1 - len(set(numbers))
    return [at - t - offset for at, t in states], [b - a for a, b in zip(beats, beats[1:])], missing


@contextlib.contextmanager
def five_watchers(url, folder, recording=None):
    record = (R4, 'record', url, '-o', recording or os.path.join(folder, f'{time.monotonic_ns()}.w.r4log'))
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(beside(*each)) for each in
               [(R4, 'monitor', url, '--json'), record] + 3 * [(sys.executable, '-c', WATCHER, url)]]


def killed_holder(board, folder):
    """The loss of r4 record when the driving program is killed: missing packet numbers, and the longest silence."""
    watched = os.path.join(folder, f'{time.monotonic_ns()}.w.r4log')
    with five_watchers(board.url, folder, watched) as watchers, \
            subprocess.Popen([sys.executable, '-c', DRIVER, board.url, watched + '.driver', '1', 'wait'],
                             stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as driver:
        driver.stdout.readline()
        time.sleep(2)
        watchers[0].send_signal(signal.SIGSTOP)
        watchers[2].kill()
        time.sleep(1)
        driver.kill()
        killed = time.time()
        time.sleep(2)
        watchers[1].send_signal(signal.SIGINT)
        watchers[1].wait()
    came = [(at, int(re.search('PNum:([0-9]+);', datagram)[1])) for at, what, datagram in datagrams_of(watched)
            if what[-1] == '<' and at > killed - 0.5]
    pairs = list(zip(came, came[1:]))
    # The packet numbers restart while the board has no host.
    return sum(max(0, b[1] - a[1] - 1) for a, b in pairs), max(b[0] - a[0] for a, b in pairs)


def drive(board, seconds, folder, others=False, trouble=False):
    path = os.path.join(folder, f'{time.monotonic_ns()}.r4log')
    with contextlib.ExitStack() as stack:
        watchers = stack.enter_context(five_watchers(board.url, folder)) if others else []
        if others:
            time.sleep(2)  # so that all programs run when the measurement starts
        if trouble:
            watchers[0].send_signal(signal.SIGSTOP)
            killer = threading.Timer(seconds / 2, watchers[2].kill)
            killer.start()
            stack.callback(killer.cancel)
        driver = subprocess.Popen([sys.executable, '-c', DRIVER, board.url, path, str(seconds)],
                                  stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(driver.pid, 0)
        driver.returncode = os.waitstatus_to_exitcode(status)
        assert driver.returncode == 0
    return *of_recording(path), usage.ru_utime + usage.ru_stime


def stop_beside_all(board, folder):
    """The time that r4 stop reports, and the time from the start of r4 stop to safe outputs, while another program
    drives and five programs watch."""
    path = os.path.join(folder, f'{time.monotonic_ns()}.r4log')
    with five_watchers(board.url, folder), \
            subprocess.Popen([sys.executable, '-c', DRIVER, board.url, path, '1', 'wait'], stdin=subprocess.PIPE,
                             stdout=subprocess.PIPE, text=True) as driver:
        driver.stdout.readline()
        time.sleep(2)
        began = time.monotonic()
        stop = subprocess.run([R4, 'stop', board.url], check=True, capture_output=True, text=True)
        safe = board.when_stopped(began)
        driver.stdin.close()
        driver.kill()
    said = float(re.search(r'after ([0-9.]+) ms', stop.stdout).group(1)) / 1000
    return said, None if safe is None else safe - began


def run_in_guest(where):
    """Runs this benchmark in the guest of tools/with-can."""
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        options, url = [], 'can://vcan0'
        if where == 'usb':
            far = os.path.join(folder, 'far')
            stack.enter_context(beside(R4, 'sim', f'pty:{far}'))
            while not os.path.exists(far):
                time.sleep(0.01)
            options, url = ['--usb-serial', far], 'serial:///dev/ttyUSB0'
        guest = os.path.join(os.path.dirname(__file__), '..', '..', 'tools', 'with-can')
        arguments = [url if each == where else each for each in sys.argv]
        return subprocess.run([guest, '--guest', *options, sys.executable, *arguments], check=False).returncode


def time_of(*arguments):
    began = time.monotonic()
    subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('where')
    parser.add_argument('seconds', nargs='?', type=float, default=10)
    parser.add_argument('rounds', nargs='?', type=int, default=3)
    parser.add_argument('--trouble', action='store_true')
    chosen = parser.parse_args()
    if chosen.where in ('can', 'usb'):
        return run_in_guest(chosen.where)
    board = (OtherBoard if chosen.where.startswith('serial:') else SimulatedBoard)(chosen.where)
    try:
        with tempfile.TemporaryDirectory() as folder:
            runs = [[drive(board, chosen.seconds, folder),
                     drive(board, chosen.seconds, folder, others=True, trouble=chosen.trouble),
                     drive(board, chosen.seconds, folder)] for _ in range(chosen.rounds)]
            for name, which, index in (('age of states, p50', statistics.median, 0), ('age of states, p99', p99, 0),
                                       ('heartbeats apart, p50', statistics.median, 1),
                                       ('heartbeats apart, p99', p99, 1)):
                alone, five, again = (statistics.median(which(each[nth][index]) for each in runs) for nth in range(3))
                print(f'{name:22} alone {ms(alone):>7} ms, beside five {ms(five):>7} ms ({five / alone:.3f} times), '
                      f'alone again {ms(again):>7} ms ({again / alone:.3f} times)')
            print('processor time of who drives: alone {:.3f} s, beside five {:.3f} s, alone again {:.3f} s'.format(
                *(statistics.median(each[nth][3] for each in runs) for nth in range(3))))
            print('packet numbers missing: alone {}, beside five {}, alone again {}'.format(
                *(sum(each[nth][2] for each in runs) for nth in range(3))))
            if chosen.trouble:
                killed = [killed_holder(board, folder) for _ in range(chosen.rounds)]
                print('who drives is killed, what a recorder beside it misses:',
                      ', '.join(f'{missing} in {ms(silence)} ms' for missing, silence in killed))
            stops = []
            for _ in range(chosen.rounds):
                stops.append(stop_beside_all(board, folder))
                subprocess.run([R4, 'send', board.url, 'E:CLEAR'], check=True, stdout=subprocess.DEVNULL)
            version = statistics.median(time_of(R4, '--version') for _ in range(5))
            print(f'r4 stop beside all: the board reports it {ms(statistics.median(each[0] for each in stops))} ms after '
                  f'the path was opened, at most {ms(max(each[0] for each in stops))} ms')
            if stops[0][1] is not None:
                print(f'                    outputs safe {ms(statistics.median(each[1] for each in stops))} ms after it '
                      f'was started; r4 --version takes {ms(version)} ms')
            print('three r4 send in a row:',
                  ', '.join(f'{ms(time_of(R4, "send", board.url, "S:1500,3"))} ms' for _ in range(3)))
    finally:
        board.close()
    return 0


sys.exit(main())
