# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.aio.Board."""
import asyncio
import os
import time

import pytest

import r4link
from machine import within
from r4link import Command, Setpoints, aio

SILENT = 'udp://127.0.0.1:9?listen=0'


def test_a_program_arms_and_drives_a_board(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            with pytest.raises(r4link.NotArmedError):
                await board.osmc(1).set_pwm(1)
            await board.arm()
            await board.send(Setpoints(Command.osmc(1, pwm=10), Command.osmc(2, pwm=20)))
            board.servo(1).calibrate(r4link.ServoCalibration(us=(1000, 2000), degrees=(-45, 45)))
            await board.servo(1).set(us=1200)
            assert board.servo(2).post(us=0)
            with pytest.raises(r4link.UsageError, match='calibrate'):
                await board.servo(2).set(degrees=0)
            await board.servo(1).set(degrees=0)
            await board.bldc(1).set_pwm(9)
            assert board.osmc(3).post_pwm(30)
            await board.relay(2).set(True)
            state = await board.next_state()
            assert (state.osmc1.pwm, state.servo1pos, state.relay(2)) == (10, 1500, True)
            assert (await board.identify()).board_id == 'sim-1'
            await board.stop()
            assert board.link.reason == 'stop'
            await board.send(Command.clear())
        with pytest.raises((r4link.ClosedError, RuntimeError)):
            await board.identify()
    asyncio.run(main())


def test_a_forgotten_await_warns_with_the_name_of_the_method(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            for name, begin in (('stop', board.stop), ('take_control', board.take_control), ('send', lambda: board.relay(2).set(True))):
                with pytest.warns(RuntimeWarning, match=rf"'Board\.{name}' was never awaited"):
                    begin()
    asyncio.run(main())


def test_commands_are_sent_in_the_order_of_their_calls(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            await board.arm()
            for last in (7, 0):
                await asyncio.gather(*(board.osmc(1).set_pwm(pwm) for pwm in [100, 5, 60, last]))
                assert (await board.next_state()).osmc1.pwm == last
    asyncio.run(main())


def test_iterates_over_states_and_calls_callbacks_on_the_loop(sim):
    async def main():
        loop_of = []
        async with aio.Board(sim.url) as board:
            board.on_state(lambda state: loop_of.append(asyncio.get_running_loop()))
            numbers = []
            async for state in board.states(most=100):
                numbers.append(state.pnum)
                if len(numbers) == 10:
                    break
            assert numbers == sorted(set(numbers))
            rest = asyncio.create_task(count(board.states()))
            await board.next_state()
            await board.close()
            assert await asyncio.wait_for(rest, 5) >= 0
        assert set(loop_of) == {asyncio.get_running_loop()}
    asyncio.run(main())


def test_loses_no_state_while_the_loop_is_busy(sim, tmp_path):
    path = tmp_path / 'all.r4log'

    async def main():
        async with aio.Board(sim.url) as board:
            board.record(path)
            await board.wait_active()
            states = board.states(lossless=True)
            time.sleep(0.3)  # blocks the whole event loop
            async for state in board.states():
                newest = state.pnum
                break
            numbers = []
            async for state in states:
                numbers.append(state.pnum)
                if numbers[-1] > newest:
                    break
            assert states.dropped == 0
        return numbers

    numbers = asyncio.run(main())
    [robot] = r4link.read(path).boards
    all_of_them = robot.states['pnum'].tolist()
    first = all_of_them.index(numbers[0])
    assert len(numbers) > 10 and numbers == all_of_them[first:first + len(numbers)]


def test_a_loop_over_queued_states_lets_other_tasks_run(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            states = board.states(lossless=True)
            await asyncio.sleep(0.1)
            turns = []
            other = asyncio.create_task(tick(turns))
            for _ in range(5):
                await anext(states)
            assert len(turns) >= 4
            other.cancel()
    asyncio.run(main())


async def tick(turns):
    while True:
        turns.append(True)
        await asyncio.sleep(0)


def test_a_program_records_watches_and_uses_the_watchdog(sim, tmp_path):
    async def main():
        async with aio.Board(sim.url) as board:
            board.record(tmp_path / 'drive.r4log', rotate_bytes=1 << 20)
            await board.wait_active()
            await board.arm()
            await board.osmc(1).set_pwm(100)
            board.watchdog(0.03)
            board.feed()
            async for _ in board.states():
                if board.link.gated:
                    break
            board.watchdog(0)
        async with aio.Board(sim.url, role='watch') as board:
            await board.wait_active()
            with pytest.raises(r4link.UsageError):
                await board.arm()
            await board.stop()
        with pytest.raises(r4link.OpenError):
            aio.Board(sim.url, key='/no/where')
    asyncio.run(main())
    assert r4link.read(tmp_path / 'drive-00001.r4log').boards[0].states['osmc1_pwm'].max() == 100


def test_takes_control_and_releases_it(sim):
    async def main():
        async with aio.Board(sim.url, role='watch') as board:
            await board.wait_active()
            await board.take_control()
            await board.wait_active()
            await board.arm()
            await board.osmc(1).set_pwm(100)
            assert board.role == 'control'
            await board.release_control()
            assert board.role == 'watch'
            with pytest.raises(r4link.UsageError):
                await board.arm()
            async for state in board.states():
                if state.safe == 'link' and state.osmc1.pwm == 0:
                    break
    asyncio.run(main())


def test_a_board_with_a_key_is_driven_only_with_its_key(tmp_path):
    right, wrong = tmp_path / 'right', tmp_path / 'wrong'
    for path, digits in (right, '5a'), (wrong, '5b'):
        path.write_text(f'1:{digits * 32}\n')
        path.chmod(0o600)

    async def main():
        with r4link.SimBoard('udp://127.0.0.1:0', settings={'key': '1:' + '5a' * 32}) as sim:
            for key, told in (None, 'key needed'), (wrong, 'key not taken'):
                async with aio.Board(sim.url, key=key) as stranger:
                    deadline = time.monotonic() + 10
                    while stranger.link.cause != told:
                        assert time.monotonic() < deadline, stranger.link
                        await asyncio.sleep(0.005)
                    with pytest.raises(r4link.RefusedError, match='key'):
                        await stranger.wait_active(0.01)
                    assert sim.look().is_safe
            async with aio.Board(sim.url, key=right) as board:
                await board.wait_active()
                await board.arm()
                await board.osmc(1).set_pwm(358)
                assert (await board.next_state()).osmc1.pwm == 358
                assert sim.look().osmc[0].pwm == 358
    asyncio.run(main())


async def count(states):
    number = 0
    async for _ in states:
        number += 1
    return number


def test_a_cancelled_task_keeps_the_order_of_other_commands(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            await board.arm()
            first = asyncio.create_task(board.osmc(1).set_pwm(1))
            given_up = asyncio.create_task(board.osmc(2).set_pwm(999))
            last = asyncio.create_task(board.osmc(1).set_pwm(3))
            await asyncio.sleep(0)
            given_up.cancel()
            await asyncio.gather(first, last)
            with pytest.raises(asyncio.CancelledError):
                await given_up
            assert (await board.next_state()).osmc1.pwm == 3
    asyncio.run(main())


def test_a_cancelled_wait_ends_at_once_and_can_be_repeated():
    async def main():
        async with aio.Board(SILENT) as board:
            for _ in range(3):
                begin = time.monotonic()
                with pytest.raises(asyncio.TimeoutError):
                    await asyncio.wait_for(board.wait_active(60), 0.02)
                assert time.monotonic() - begin < within(1)
            with pytest.raises(r4link.RefusedError):
                await board.wait_active(0.05)
    asyncio.run(main())


def test_no_call_needs_a_thread():
    async def main():
        async with aio.Board(SILENT) as board:
            threads = len(os.listdir('/proc/self/task'))
            waiting = [asyncio.create_task(board.wait_active(60)) for _ in range(100)]
            await asyncio.sleep(0.05)
            assert len(os.listdir('/proc/self/task')) <= threads
            for task in waiting:
                task.cancel()
            assert {type(each) for each in await asyncio.gather(*waiting, return_exceptions=True)} == {asyncio.CancelledError}
    asyncio.run(main())


def test_closing_a_board_ends_its_waiting_calls():
    async def main():
        board = aio.Board(SILENT)
        waiting = [asyncio.create_task(each) for each in (board.wait_active(60), board.identify(60), board.next_state(60))]
        await asyncio.sleep(0.05)
        await board.close()
        for task in waiting:
            with pytest.raises(r4link.ClosedError):
                await asyncio.wait_for(task, 5)
    asyncio.run(main())


@pytest.mark.parametrize('begun', [False, True])
def test_a_stop_goes_on_when_its_task_is_cancelled(sim, begun):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            stop = asyncio.create_task(board.stop())
            if begun:
                await asyncio.sleep(0)
            stop.cancel()
            with pytest.raises(asyncio.CancelledError):
                await stop
            async for _ in board.states():
                if board.link.reason == 'stop':
                    break
    asyncio.run(main())


def test_a_board_works_after_a_loop_that_ends_with_open_calls(sim, wait):
    board = aio.Board(sim.url)

    async def leave():
        await board.wait_active()
        board.on_state(lambda state: None)
        waiting = asyncio.create_task(board.next_state(60))
        unheard = asyncio.create_task(board.identify(60))
        await asyncio.sleep(0)
        del waiting, unheard

    async def go_on():
        assert (await board.identify()).board_id == 'sim-1'
        await board.close()

    asyncio.run(leave())
    received = board.statistics.received
    wait(lambda: board.statistics.received > received + 5)  # states arrive while the event loop is closed
    asyncio.run(go_on())


def test_a_program_reads_devices_on_the_i2c_bus(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            assert await board.i2c.scan() == [0x40, 0x68]
            assert await board.i2c.read(0x68, 0x75, 1) == b'h'
            with pytest.raises(r4link.RefusedError, match='no acknowledge'):
                await board.i2c.read(0x50, 0, 1)
            with pytest.raises(r4link.UsageError, match='outside its range'):
                await board.i2c.read(3, 0, 1)
            assert (await board.uart[1].read(0.02)).data == b''
    asyncio.run(main())
