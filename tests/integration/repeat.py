# SPDX-License-Identifier: GPL-3.0-or-later
"""If a test failed while the machine stood still, repeats the test, because links correctly time out at a standstill.

Each repeat is a line in build/results/repeats.txt, which tests/summary.py shows at the end of a run.
"""
import pathlib
import time

import pytest
from _pytest.runner import runtestprotocol

from machine import account

LONGEST_S = 80  # longer tests run in the guest, which repeats its tests one by one
STANDSTILL_S = 0.2  # machine.py allows for shorter standstills, and a link is lost after 0.5 s
REPEATS = pathlib.Path(__file__).resolve().parents[2] / 'build/results/repeats.txt'


def note_repeat(line):
    REPEATS.parent.mkdir(parents=True, exist_ok=True)
    with open(REPEATS, 'a', encoding='utf-8') as file:
        file.write(line + '\n')


def run(item, nextitem):
    account.begin()
    return runtestprotocol(item, nextitem=nextitem, log=False)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item, nextitem):
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    began = time.monotonic()
    reports = run(item, nextitem)
    failed = [each for each in reports if each.failed]
    if failed and account.standstill_s >= STANDSTILL_S and time.monotonic() - began < LONGEST_S:
        line = f'{item.nodeid}: the machine stood still for {account.standstill_s * 1000:.0f} ms'
        note_repeat(line)
        item.config.pluginmanager.get_plugin('terminalreporter').write(
            f'\n{line}: run again. It said\n{failed[0].longreprtext}\n')
        reports = run(item, nextitem)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True
