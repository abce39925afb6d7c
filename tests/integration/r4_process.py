# SPDX-License-Identifier: GPL-3.0-or-later
"""The r4 command as real processes: run to its end, or running with its lines awaited.

Nothing here sleeps to wait: everything awaits an event until a deadline.
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

# The one shape of an error: thing, reason, fix.
ERROR = re.compile(r'^r4: .+: .+; .+$', re.MULTILINE)


def run(*arguments, stdin='', timeout=PATIENCE_S, **options):
    """Runs r4 to its end; text in and out."""
    return subprocess.run([R4, *arguments], input=stdin, capture_output=True, text=True,
                          timeout=timeout, check=False, **options)


def send(*arguments, timeout=60):
    """r4 send. Again where a machine that stood still has made a command too old for the board."""
    for _ in range(5):
        result = run('send', *arguments, timeout=timeout)
        if 'STALE' not in result.stderr:
            break
    return result


# It is a process of its own: what a child has had counts the memory of whoever started it, too.
MEASURE = '''
import os, sys
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(child, 0)
sys.stderr.write(f'\\n{usage.ru_maxrss}')
sys.exit(os.waitstatus_to_exitcode(status) % 256)
'''


def run_measured(*arguments, **options):
    """As run(); `peak_mib` of the result is the most memory that r4 had."""
    result = subprocess.run([sys.executable, '-S', '-c', MEASURE, R4, *arguments], capture_output=True, text=True,
                            timeout=6 * PATIENCE_S, check=False, **options)
    result.stderr, _, peak_kib = result.stderr.rpartition('\n')
    result.peak_mib = int(peak_kib) / 1024
    return result


def objects(text):
    """The JSON objects of an output, one a line."""
    return [json.loads(line) for line in text.splitlines()]


def free_port():
    """A UDP port that is free, and none of those that Linux gives to who asks for any (from 32768)."""
    while True:
        port = random.randrange(30_000, 32_768)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, contextlib.suppress(OSError):
            probe.bind(('0.0.0.0', port))
            return port


def lasts(seconds):
    """A fault that is that long: nothing is waited for."""
    time.sleep(seconds)


def text_of(path):
    """What can be read of a recording."""
    if path.suffix != '.zst':
        return path.read_bytes().decode('ascii')
    unpacked = subprocess.run(['zstd', '-dcq', path], capture_output=True, check=False).stdout
    return unpacked.decode('ascii')


def wait_for(path, pattern):
    """Until a line of the recording has it."""
    deadline = time.monotonic() + PATIENCE_S
    while not (path.exists() and re.search(pattern, text_of(path), re.MULTILINE)):
        assert time.monotonic() < deadline, f'{pattern} is not in {path}'
        lasts(0.02)


STOP_WITHIN_MS = 5


def stop_takes_ms(url):
    """From the time at which r4 stop has opened `url` to safe outputs: the best of three, for others want the machine."""
    stops = [run('stop', url, '--json') for _ in range(3)]
    assert all(stop.returncode == 0 for stop in stops), stops
    best = min(objects(stop.stdout)[0]['ms'] for stop in stops)
    print(f'stopped after {best:.1f} ms')
    assert best <= within_ms(STOP_WITHIN_MS), stops
    return best


def again(write, wait):
    """Writes, as a host that drives does, until `wait` has its result: on a busy machine a command may be too old when it
    comes. Returns the time of the last write, and the result."""
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
    """r4 as it runs, or another program. Each line of its stdout is kept with the time at which it came."""

    def __init__(self, *arguments, program=R4, **options):
        self.process = subprocess.Popen([program, *arguments], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, **options)
        self.lines = queue.Queue()
        self.log = []  # what was taken off the queue
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
        """The next object for which `is_it` is true, with the time at which it came as `came`."""
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
        """Forgets what has come so far."""
        while not self.lines.empty():
            self.lines.get()

    def stall(self, seconds):
        """Holds it up and forgets what came before; returns the time at which it went on."""
        self.signal(signal.SIGSTOP)
        lasts(seconds)
        self.skip_past()
        return self.signal(signal.SIGCONT)

    def signal(self, number):
        self.process.send_signal(number)
        return time.monotonic()

    def end(self):
        """Ends it as Ctrl-C does; returns its exit code."""
        self.process.send_signal(signal.SIGCONT)
        self.process.send_signal(signal.SIGINT)
        return self.wait()

    def rest(self):
        """Ends it; all that it has printed."""
        assert self.end() == 0, self.errors
        return self.left()

    def left(self):
        """It has ended; all that it has printed."""
        while True:
            came, line = self.lines.get()
            if line is None:
                return self.log
            self.log.append({**json.loads(line), 'came': came})

    def cpu_seconds(self):
        """What it has used of a processor so far."""
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
    """A simulated board. `url` is where it listens, `host_url` how a host opens that."""

    def __init__(self, *urls, options=(), listens=None, **process):
        """`listens`: at how many places, if that is not the number of URLs."""
        super().__init__('sim', '--json', *urls, *options, **process)
        listening = [self.next(lambda each: each['type'] == 'listening') for _ in range(listens or len(urls))]
        self.url = listening[0]['url']
        self.host_url = listening[0]['host_url']
        if self.host_url.startswith('udp:'):
            self.host_url += '?listen=0'  # the port of hosts is one, and the tests have several

    def state(self, state, reason=None, timeout=PATIENCE_S):
        """The next event of that state."""
        return self.next(lambda each: each.get('state') == state and 'outputs' not in each and
                         reason in (None, each['reason']), timeout)

    def never(self, state, seconds, meanwhile=lambda: None):
        """For that long it does not come to that state; `meanwhile` is called all the time."""
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
    """A host that has closed the motors' supply and driven the outputs, and stays."""
    host = Running('send', url, 'R:1,On', *commands, '--hold', '60', '--json', **process)
    for command in ('R:1,On', *commands):
        result = host.next()
        if result.get('code') == 'STALE':  # as in send()
            host.__exit__()
            return driving(url, *commands, **process)
        assert result['confirmed'] and result['command'] == command, result
    return host


def monitor(url, *options, **process):
    """As a host that controls the board and commands nothing."""
    return Running('monitor', url, '--json', '--control', *options, **process)


def watch(url, *options, **process):
    return Running('monitor', url, '--json', *options, **process)


def is_state(each):
    return each['type'] == 'state'


def is_link(state, reason='none'):
    return lambda each: (each['type'] == 'link' and each['fields']['state'] == state and
                         each['fields']['reason'] == reason and 'busy' not in each['fields']['causes'])
