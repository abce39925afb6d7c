# SPDX-License-Identifier: GPL-3.0-or-later
"""The wall clock of a host is set forward by an hour while a link runs."""
import os
import subprocess

from machine import within_ms
from r4_process import Board, is_link, is_state, monitor

HOUR_S = 3600
# Preloaded between r4 and the C library: the wall clock is an hour later as soon as the file exists.
ANOTHER_CLOCK = r'''
#include <stdlib.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t id, struct timespec* now) {
  const long result = syscall(SYS_clock_gettime, id, now);
  if (id == CLOCK_REALTIME && access(getenv("CLOCK_IS_SET"), F_OK) == 0) now->tv_sec += 3600;
  return (int)result;
}
'''


def test_a_step_of_the_wall_clock_does_not_affect_the_link(tmp_path):
    source, library, is_set = tmp_path / 'clock.c', tmp_path / 'clock.so', tmp_path / 'set'
    source.write_text(ANOTHER_CLOCK)
    subprocess.run(['gcc', '-shared', '-fPIC', '-o', library, source], check=True)
    env = {**os.environ, 'LD_PRELOAD': str(library), 'CLOCK_IS_SET': str(is_set),
           'ASAN_OPTIONS': 'verify_asan_link_order=0'}
    with Board('udp://127.0.0.1:0') as board, monitor(board.host_url, env=env) as host:
        host.next(is_link('active'))
        before = host.next(lambda each: is_state(each) and each['sampled_error_ms'] is not None
                           and each['sampled_error_ms'] < 1.5)
        is_set.touch()
        after = [host.next(is_state) for _ in range(150)]
        assert host.end() == 0
        since = host.log[host.log.index(before):]
    assert all(each['fields']['up'] and each['fields']['state'] == 'active' and not each['fields']['causes']
               for each in since if each['type'] == 'link'), 'the link has changed'
    steps = [later['t'] - earlier['t'] for earlier, later in zip(after, after[1:])]
    assert max(steps) < within_ms(500), 'the states were interrupted'
    last = after[-1]
    passed = (last['t'] - before['t']) / 1000
    error = (before['sampled_error_ms'] + last['sampled_error_ms']) / 1000 + 100e-6 * passed
    assert abs(last['sampled'] - before['sampled'] - HOUR_S - passed) <= error + 5e-3, 'not by the new wall clock'
    assert all(each['sampled_error_ms'] < 2 for each in after), 'the host has lost its estimate of the board\'s clock'
