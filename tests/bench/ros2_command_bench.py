#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of r4 ros2 with one simulated board at 100 Hz and a client of Fast DDS: the share of a core, and the time
from a command through ~/send to the board's confirmation at the client. The client sends each command immediately
after the previous confirmation. At that time a state has just been sent, so the wait for the next state is the longest.

    R4=build/r4 PYTHONPATH=tests/integration /usr/bin/python3 tests/bench/ros2_command_bench.py [COMMANDS, 500]

Exit code 1 if a limit is exceeded: 3 % of a core, or one period and 2 ms for half of the confirmations.
"""
import os
import statistics
import struct
import sys
import time

from ros2_peer import STRING, Cdr, armed, text

COMMANDS = int(sys.argv[1]) if len(sys.argv) > 1 else 500
PERIOD_MS, MOST_MS, MOST_SHARE = 10, 12, 3
SERVICE = 'diagnostic_msgs::srv::dds_::AddDiagnostics'
CLIENT = 0x1122334455667788


def processor_s(pid):
    with open(f'/proc/{pid}/stat', encoding='ascii') as file:
        fields = file.read().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def share_of_a_core(ros2, seconds=5):
    """The share of a core, in percent."""
    before, began = processor_s(ros2.process.pid), time.monotonic()
    time.sleep(seconds)
    return 100 * (processor_s(ros2.process.pid) - before) / (time.monotonic() - began)


def to_confirmation(ros2, peer):
    """The milliseconds from each command to its confirmation."""
    peer.read('rr/r4/sendReply', SERVICE + '_Response_', user_data='clientid=1;')
    peer.writer('rq/r4/sendRequest', SERVICE + '_Request_', user_data='clientid=1;')
    ros2.logged('~/send: 1 publishers')
    took = []
    for number in range(COMMANDS):
        command = f'O:{1 + number % 4000},1,2'
        peer.write('rq/r4/sendRequest', struct.pack('<Qq', CLIENT, number) + text(command))
        began = time.monotonic()
        reply = peer.sample('rr/r4/sendReply')
        cdr = Cdr(reply)
        assert (cdr.take('Q'), cdr.take('q'), cdr.take('B')) == (CLIENT, number, 1), cdr.text()
        took.append(1e3 * (reply.came - began))
    return took


def shown(took):
    return f'p50 {statistics.median(took):.1f} ms, p99 {statistics.quantiles(took, n=100)[98]:.1f} ms'


def main():
    with armed('--deadline', '0') as (_, ros2, peer):
        peer.read('rt/R4', STRING)
        share = share_of_a_core(ros2)
        confirmed = to_confirmation(ros2, peer)
    met = share <= MOST_SHARE and statistics.median(confirmed) <= MOST_MS
    print(f'r4 ros2, a board at {1000 // PERIOD_MS} Hz and one subscriber: {share:.1f} % of a core (bar {MOST_SHARE})')
    print(f'~/send to the confirmation, at the client: {shown(confirmed)} (bar {MOST_MS} ms)')
    print('met' if met else 'MISSED')
    return 0 if met else 1


sys.exit(main())
