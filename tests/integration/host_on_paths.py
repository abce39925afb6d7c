# SPDX-License-Identifier: GPL-3.0-or-later
"""A session over several paths (host_on_paths.cpp), which drives while paths are lost and return."""
import collections
import pathlib
import subprocess
import sys
import time

from machine import within
from r4_process import R4, Running

PROGRAM = pathlib.Path(R4).parent / 'tests' / 'host_on_paths'
RELAY = pathlib.Path(__file__).resolve().parents[1] / 'support' / 'relay.py'
REPORTED_WITHIN_S = 0.05  # if the system reports the loss of a path
TIMEOUT_S = 1  # if only silence shows the loss
BACK_WITHIN_S = 1
LONGEST_GAP_S = 0.1  # the board sends a state every 10 ms


class Relay:
    """One path to a board. `url` is the host's end."""

    def __init__(self, kind, *where):
        self.kind, self.where = kind, where
        self.process = self.url = None
        self.plug_in()

    def plug_in(self):
        self.process = subprocess.Popen([sys.executable, '-S', RELAY, self.kind, *self.where], stdout=subprocess.PIPE,
                                        text=True)
        self.url = self.process.stdout.readline().strip()

    def pull(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def signal(self, number):
        self.process.send_signal(number)


class HostOnPaths(Running):
    """`places`: a part of the name of each path, in the order of the URLs."""

    def __init__(self, urls, places, **process):
        super().__init__(*urls, program=PROGRAM, stdin=subprocess.PIPE, **process)
        for place in places:
            if not any(is_path(place)(each) for each in self.log):
                self.next(is_path(place))
        self.next(is_command)
        self.began = time.monotonic()
        self.told = []
        self.ended = None

    def loses(self, place, take_away, within_s=REPORTED_WITHIN_S):
        """Asserts a timely report of the loss. The time counts from the value of `take_away`, else from its call."""
        self._tells(place, False, take_away, within_s)

    def loses_by_silence(self, place, take_away):
        self.loses(place, take_away, TIMEOUT_S + REPORTED_WITHIN_S)

    def has_again(self, place, give_back):
        self._tells(place, True, give_back, BACK_WITHIN_S)

    def _tells(self, place, carries, action, within_s):
        began = time.monotonic()
        at = action() or began
        took = self.next(is_path(place, carries))['at'] - at
        assert took <= within(within_s), f'{place}: reported after {took:.3f} s'
        self.told.append(f'{place} {"used again" if carries else "told of"} after {took * 1e3:.0f} ms')

    def goes_on(self, commands=10):
        for _ in range(commands):
            self.next(is_command)

    def ends(self, board):
        """Asserts that no state or command was lost, no command was executed twice, and the board never went safe."""
        commands = self.commands_at_its_end()
        log = board.rest()
        require_executed_as_told(commands, log)
        safe = [each for each in log if each.get('state') == 'SAFE' and self.began < each['came'] < self.ended]
        assert not safe, safe

    def commands_at_its_end(self):
        """Checks the log of the host alone, and returns the commands and their results."""
        self.goes_on()
        self.ended = time.monotonic()
        self.process.stdin.close()
        assert self.wait() == 0, self.errors
        log = self.left()
        states = [each for each in log if each['type'] == 'state']
        came = [each['at'] for each in states if self.began <= each['at'] <= self.ended]
        gap = max(later - earlier for earlier, later in zip(came, came[1:]))
        commands = [each for each in log if each['type'] == 'command']
        rate = (len(came) - 1) / (came[-1] - came[0])
        print(f'{"; ".join(self.told)}; {len(commands)} commands, {rate:.0f} states a second, '
              f'the longest gap between them {gap * 1e3:.0f} ms')
        times = [each['t'] for each in states]
        assert times == sorted(set(times)), 'a state was reported twice, or after a newer one'
        missed = [each for each in log if self.began < each.get('at', 0) < self.ended and each.get('active') is False]
        # A busy machine may delay a command until it is too old.
        missed += [each for each in commands if not each['confirmed'] and 'STALE' not in each['error']]
        assert not missed, (missed, self.began, self.ended)
        assert gap <= within(LONGEST_GAP_S)
        return commands


def require_executed_as_told(commands, log):
    """Asserts that the board has executed each command at most once and in order, each confirmed command once, and no
    refused command. `log` is the log of the board."""
    executed = [each['executed']['command'] for each in log if 'executed' in each]
    executed = collections.deque(each for each in executed if each.startswith('S:'))
    for each in commands:
        if executed and executed[0] == each['command']:
            assert each['confirmed'] or each['outcome'] != 'refused', each
            executed.popleft()
        else:
            assert not each['confirmed'], each
    assert not executed, executed


def is_command(each):
    return each['type'] == 'command'


def is_path(place, carries=True):
    return lambda each: each['type'] == 'path' and place in each['name'] and each['carries'] == carries


def has_joined(paths, event='joined'):
    """Matches the board's event that a path joined, after which it has `paths` paths to its host."""
    return lambda each: each.get('path', {}).get('event') == event and each['path']['paths'] == paths


def has_left(paths):
    """Matches the board's event that a path left, after which it has `paths` paths."""
    return has_joined(paths, 'left')
