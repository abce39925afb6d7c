#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cost of recording eight boards at 100 Hz: the share of one processor that all of r4 record uses.

    R4=build/r4 tests/bench/recording_bench.py [SECONDS] [ROUNDS]

In each round three programs receive the same eight boards over UDP loopback, one after the other. The programs are
r4 record into text, r4 record into zst, and a reference in C. The reference waits in epoll, reads the datagrams, and
does nothing else. The kernel's account of the threads gives the processor time of each program, without the program's
start. Prints medians over the rounds.
"""
import glob
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import zlib

R4 = os.environ.get('R4', 'r4')
BOARDS, PORT = 8, 28610
START_S = 1.5
FLOOR = r'''
#include <arpa/inet.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

static void end(int number) { (void)number; }

// floor HEARTBEAT PORT...: hears boards that take it for a host of the paper's. Prints how many states came.
int main(int argc, char** argv) {
  const struct sigaction action = {.sa_handler = end};
  sigaction(SIGINT, &action, NULL);
  const struct itimerspec often = {{0, 400000000}, {0, 1}};
  const int all = epoll_create1(0), timer = timerfd_create(CLOCK_MONOTONIC, 0), count = argc - 2;
  struct epoll_event event = {.events = EPOLLIN, .data.fd = timer}, events[64];
  timerfd_settime(timer, 0, &often, NULL);
  epoll_ctl(all, EPOLL_CTL_ADD, timer, &event);
  int sockets[64];
  for (int i = 0; i < count; ++i) {
    const struct sockaddr_in board = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(argv[i + 2])),
                                      .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    event.data.fd = sockets[i] = socket(AF_INET, SOCK_DGRAM, 0);
    if (connect(sockets[i], (const struct sockaddr*)&board, sizeof board) != 0) return 1;
    epoll_ctl(all, EPOLL_CTL_ADD, sockets[i], &event);
  }
  long states = 0;
  for (char bytes[2048];;) {
    const int ready = epoll_wait(all, events, 64, -1);
    if (ready < 0) break;
    for (int i = 0; i < ready; ++i) {
      if (events[i].data.fd != timer) {
        states += recv(events[i].data.fd, bytes, sizeof bytes, MSG_DONTWAIT) > 0 && bytes[0] == 'A';
      } else if (read(timer, bytes, sizeof bytes) > 0) {
        for (int j = 0; j < count; ++j) send(sockets[j], argv[1], strlen(argv[1]), MSG_DONTWAIT);
      }
    }
  }
  printf("%ld\n", states);
}
'''


def used_ns(pid):
    """The processor time of all threads of a process so far."""
    return sum(int(pathlib.Path(task).read_text(encoding='ascii').split()[0])
               for task in glob.glob(f'/proc/{pid}/task/*/schedstat'))


def share_of(command, seconds):
    """The share of a core that a program uses after its start, and all output of the program."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        time.sleep(START_S)
        began, before = time.monotonic(), used_ns(process.pid)
        time.sleep(seconds)
        share = (used_ns(process.pid) - before) / 1e9 / (time.monotonic() - began)
        process.send_signal(2)
        return share, process.communicate()[0]


def recorded(path, url, seconds):
    """The processor share of r4 record, states a second, and bytes a state."""
    share, _ = share_of([R4, 'record', url, '-o', path], seconds)
    told = json.loads(subprocess.run([R4, 'info', '--json', path], check=True, capture_output=True, text=True).stdout)
    assert len(told['paths']) == BOARDS and not told['damage'] and told['dropped'] == 0, told
    states = sum(path['states'] for path in told['paths'])
    size = os.path.getsize(path)
    os.remove(path)
    return share, states / told['seconds'], size / states


def main():
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 15
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    heartbeat = 'H:ROS2-R4;T:1;^'
    heartbeat += f'0x{zlib.crc32(heartbeat.encode()):x}^'
    where = f'udp://127.0.0.1:{PORT}-{PORT + BOARDS - 1}'
    measured = {'floor': [], 'text': [], 'zst': []}
    with tempfile.TemporaryDirectory() as folder, \
            subprocess.Popen([R4, 'sim', '--json', where], stdout=subprocess.PIPE, text=True) as sim:
        for _ in range(BOARDS):
            assert json.loads(sim.stdout.readline())['type'] == 'listening'
        threading.Thread(target=sim.stdout.read, daemon=True).start()
        floor = os.path.join(folder, 'floor')
        subprocess.run(['cc', '-O2', '-Wall', '-x', 'c', '-o', floor, '-'], input=FLOOR, text=True, check=True)
        for _ in range(rounds):
            share, states = share_of([floor, heartbeat, *(str(PORT + i) for i in range(BOARDS))], seconds)
            measured['floor'].append((share, int(states) / (seconds + START_S), 0))
            for form, name in (('text', 'x.r4log'), ('zst', 'x.r4log.zst')):
                measured[form].append(recorded(os.path.join(folder, name), where + '?listen=0', seconds))
        sim.kill()
    least = statistics.median(share for share, _, _ in measured['floor'])
    for form, each in measured.items():
        share, rate, size = (statistics.median(one) for one in zip(*each))
        bytes_each = f', {size:.1f} bytes each' if size else ''
        print(f'{form:6} {100 * share:5.2f} % of a core, {share / least:.2f} times the floor; '
              f'{rate:.0f} states a second{bytes_each}')


main()
