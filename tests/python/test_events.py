# SPDX-License-Identifier: GPL-3.0-or-later
"""The logger 'r4link'."""
import asyncio
import logging
import subprocess
import sys

import pytest

import r4link
from r4link import aio, events


@pytest.fixture(name='logged')
def what_is_logged(caplog):
    caplog.set_level(logging.INFO, 'r4link')
    return lambda: [(each.levelname, each.getMessage()) for each in caplog.records if each.name == 'r4link']


def has(logged, level, text):
    return any(each == level and text in message for each, message in logged())


def test_link_events_are_logged_by_severity(sim, wait, logged):
    with r4link.Board(sim.url) as board:
        board.wait_active()
        board.arm()
        wait(lambda: has(logged, 'INFO', 'link active') and has(logged, 'INFO', ': armed'))
        board.stop()
        wait(lambda: has(logged, 'WARNING', 'link safe, stop') and has(logged, 'INFO', 'not armed: stop'))
        board.send(r4link.Command.clear())
        board.arm()
        sim.reboot()
        wait(lambda: has(logged, 'WARNING', 'the board has restarted'))
        name = board.name
    assert all(text.startswith(f'{name}: ') for _, text in logged())


def test_an_asyncio_board_logs_link_events(sim, wait, logged):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            # A board that is closed reports no more events.
            await asyncio.to_thread(wait, lambda: has(logged, 'INFO', 'link active'))
    asyncio.run(main())


def test_control_characters_are_replaced_in_log_texts():
    assert events._printable('a\nERROR b\x1b[2J') == 'a?ERROR b?[2J'


def test_the_package_prints_nothing_by_default():
    program = 'import r4link\nwith r4link.Board("sim:") as board:\n board.wait_active(); board.stop()'
    ended = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, check=True)
    assert (ended.stdout, ended.stderr) == ('', '')
