# SPDX-License-Identifier: GPL-3.0-or-later
"""The r4 command as real processes: run to the end, or kept running while the test awaits its lines.

Except for lasts(), each wait is for an event until a deadline.
"""
import contextlib
import json
import os
import queue
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time

from machine import PROMPT, within_ms

R4 = os.environ['R4']
DATA = os.environ.get('R4_TEST_DATA', os.path.join(os.path.dirname(__file__), '..', 'data'))
PATIENCE_S = 10 if PROMPT else 30

# The form of every error: thing, reason, fix.
ERROR = re.compile(r'^r4: .+: .+; .+$', re.MULTILINE)


def run(*arguments, stdin='', timeout=PATIENCE_S, **options):
    """Runs r4 to its end, with text as input and output."""
    return subprocess.run([R4, *arguments], input=stdin, capture_output=True, text=True,
                          timeout=timeout, check=False, **options)


def send(*arguments, timeout=60):
    """Runs r4 send. If the machine stood still and a command became too old for the board, runs r4 send again."""
    for _ in range(5):
        result = run('send', *arguments, timeout=timeout)
        if 'STALE' not in result.stderr:
            break
    return result


# A separate process measures, because the peak memory of a child includes the peak of its parent.
MEASURE = '''
import os, sys
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(child, 0)
sys.stderr.write(f'\\n{usage.ru_maxrss}')
sys.exit(os.waitstatus_to_exitcode(status) % 256)
'''


def run_measured(*arguments, **options):
    """As run(); `peak_mib` of the result is the peak memory of r4."""
    result = subprocess.run([sys.executable, '-S', '-c', MEASURE, R4, *arguments], capture_output=True, text=True,
                            timeout=6 * PATIENCE_S, check=False, **options)
    result.stderr, _, peak_kib = result.stderr.rpartition('\n')
    result.peak_mib = int(peak_kib) / 1024
    return result


def objects(text):
    """The JSON objects of an output, one per line."""
    return [json.loads(line) for line in text.splitlines()]


def free_port():
    """A free UDP port below 32768, where Linux begins to assign ports to sockets that request any port."""
    while True:
        port = random.randrange(30_000, 32_768)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, contextlib.suppress(OSError):
            probe.bind(('0.0.0.0', port))
            return port


def lasts(seconds):
    """Sleeps for the length of a fault in real time, and does not wait for an event."""
    time.sleep(seconds)


def text_of(path):
    """The readable part of a recording."""
    if path.suffix != '.zst':
        return path.read_bytes().decode('ascii')
    unpacked = subprocess.run(['zstd', '-dcq', path], capture_output=True, check=False).stdout
    return unpacked.decode('ascii')


def wait_for(path, pattern):
    """Waits until the recording matches `pattern`."""
    deadline = time.monotonic() + PATIENCE_S
    while not (path.exists() and re.search(pattern, text_of(path), re.MULTILINE)):
        assert time.monotonic() < deadline, f'{pattern} is not in {path}'
        lasts(0.02)


STOP_WITHIN_MS = 5


def stop_takes_ms(url):
    """The time from opening `url` to safe outputs in r4 stop: the best of three, because the machine may be busy."""
    stops = [run('stop', url, '--json') for _ in range(3)]
    assert all(stop.returncode == 0 for stop in stops), stops
    best = min(objects(stop.stdout)[0]['ms'] for stop in stops)
    print(f'stopped after {best:.1f} ms')
    assert best <= within_ms(STOP_WITHIN_MS), stops
    return best


def again(write, wait):
    """Repeats `write` until `wait` has its result, because on a busy machine a command may be too old when it arrives.
    Returns the time of the last write, and the result."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        write()
        written = time.monotonic()
        try:
            return written, wait(0.25)
        except AssertionError:
            if time.monotonic() > deadline:
                raise


class Running:
    """A running r4, or another program. Stores each line of the program's stdout with the time of arrival."""

    def __init__(self, *arguments, program=R4, **options):
        self.process = subprocess.Popen([program, *arguments], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, **options)
        self.lines = queue.Queue()
        self.log = []  # all objects taken from the queue
        self.errors = ''
        self._readers = [threading.Thread(target=self._read_lines, daemon=True),
                         threading.Thread(target=self._read_errors, daemon=True)]
        for reader in self._readers:
            reader.start()

    def _read_lines(self):
        for line in self.process.stdout:
            self.lines.put((time.monotonic(), line))
        self.lines.put((time.monotonic(), None))

    def _read_errors(self):
        self.errors = self.process.stderr.read()

    def next(self, is_it=lambda each: True, timeout=PATIENCE_S):
        """Returns the next object for which `is_it` is true. `came` in the object is the time of arrival."""
        deadline = time.monotonic() + timeout
        while True:
            try:
                came, line = self.lines.get(timeout=max(0, deadline - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f'nothing of that kind within {timeout} s; '
                                     f'the last lines: {self.log[-5:]}') from None
            if line is None:
                self.process.wait()
                self._readers[1].join()
                raise AssertionError(f'r4 has ended with {self.process.returncode}: {self.errors}; '
                                     f'the last lines: {self.log[-5:]}')
            each = json.loads(line)
            each['came'] = came
            self.log.append(each)
            if is_it(each):
                return each

    def skip_past(self):
        """Drops the objects that have arrived so far."""
        while not self.lines.empty():
            self.lines.get()

    def stall(self, seconds):
        """Stops the program for a time and drops its earlier objects. Returns the time at which the program resumed."""
        self.signal(signal.SIGSTOP)
        lasts(seconds)
        self.skip_past()
        return self.signal(signal.SIGCONT)

    def signal(self, number):
        self.process.send_signal(number)
        return time.monotonic()

    def end(self):
        """Ends the program as Ctrl-C does, and returns its exit code."""
        self.process.send_signal(signal.SIGCONT)
        self.process.send_signal(signal.SIGINT)
        return self.wait()

    def rest(self):
        """Ends the program, and returns all objects that it has printed."""
        assert self.end() == 0, self.errors
        return self.left()

    def left(self):
        """Waits for the end of the output, and returns all objects that the program has printed."""
        while True:
            came, line = self.lines.get()
            if line is None:
                return self.log
            self.log.append({**json.loads(line), 'came': came})

    def cpu_seconds(self):
        with open(f'/proc/{self.process.pid}/stat', encoding='ascii') as stat:
            fields = stat.read().rsplit(')', 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def wait(self, timeout=PATIENCE_S):
        code = self.process.wait(timeout=timeout)
        for reader in self._readers:
            reader.join(timeout)
        return code

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.wait()
        self.process.stdout.close()
        self.process.stderr.close()


class Board(Running):
    """A simulated board. The board listens at `url`. A host opens the board by `host_url`."""

    def __init__(self, *urls, options=(), listens=None, **process):
        """`listens`: the number of places at which the board listens. None: the number of URLs."""
        super().__init__('sim', '--json', *urls, *options, **process)
        listening = [self.next(lambda each: each['type'] == 'listening') for _ in range(listens or len(urls))]
        self.url = listening[0]['url']
        self.host_url = listening[0]['host_url']
        if self.host_url.startswith('udp:'):
            self.host_url += '?listen=0'  # the tests have several hosts, which cannot share the standard port of hosts

    def state(self, state, reason=None, timeout=PATIENCE_S):
        """Returns the next event that reports `state`."""
        return self.next(lambda each: each.get('state') == state and 'outputs' not in each and
                         reason in (None, each['reason']), timeout)

    def never(self, state, seconds, meanwhile=lambda: None):
        """Asserts that the board does not reach `state` within `seconds`, and calls `meanwhile` repeatedly."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            meanwhile()
            try:
                came = self.state(state, timeout=0.1)
            except AssertionError as nothing:
                assert 'nothing of that kind' in str(nothing)
            else:
                raise AssertionError(f'the board has become {state}: {came}')

    def outputs(self, is_it=lambda outputs: True, timeout=PATIENCE_S):
        return self.next(lambda each: 'outputs' in each and is_it(each['outputs']), timeout)

    def executed(self, command, timeout=PATIENCE_S):
        return self.next(lambda each: each.get('executed', {}).get('command') == command, timeout)


def driving(url, *commands, **process):
    """A host that has closed the motors' supply and driven the outputs, and stays connected."""
    host = Running('send', url, 'R:1,On', *commands, '--hold', '60', '--json', **process)
    for command in ('R:1,On', *commands):
        result = host.next()
        if result.get('code') == 'STALE':  # the command was too old, as in send()
            host.__exit__()
            return driving(url, *commands, **process)
        assert result['confirmed'] and result['command'] == command, result
    return host


def monitor(url, *options, **process):
    """A monitor that controls the board but sends no commands."""
    return Running('monitor', url, '--json', '--control', *options, **process)


def watch(url, *options, **process):
    return Running('monitor', url, '--json', *options, **process)


def is_state(each):
    return each['type'] == 'state'


def is_link(state, reason='none'):
    return lambda each: (each['type'] == 'link' and each['fields']['state'] == state and
                         each['fields']['reason'] == reason and 'busy' not in each['fields']['causes'])
