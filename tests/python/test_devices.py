# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices on the user's I2C bus (docs/how-to/devices.md)."""
import asyncio
import itertools

import pytest

import r4link
from r4link import Command, Setpoints, aio


def test_reads_writes_and_scans_the_i2c_bus(board):
    assert board.i2c.scan() == [0x40, 0x68]
    assert board.i2c.read(0x68, 0x75, 1) == b'\x68'
    with pytest.raises(r4link.NotArmedError):
        board.i2c.write(0x68, b'\x6b\x00')
    board.arm()
    assert board.i2c.write(0x68, b'\x6b\x00') == b''
    assert board.i2c.write(0x40, bytes([0x05]), count=2) == b'\0\0'
    with pytest.raises(r4link.RefusedError, match='no acknowledge'):
        board.i2c.read(0x50, 0, 1)
    with pytest.raises(r4link.UsageError, match='outside its range'):
        board.i2c.read(3, 0, 1)


def test_states_contain_the_readings_of_a_poll(board, wait):
    board.i2c.poll(1, 0x68, 0x75, 1, period=0.02)
    board.fields('DEFAULT,I2C1,I2CBUS')
    wait(lambda: board.state.i2c1.data == b'\x68')
    state = board.next_state()
    # A board that is late reads the device after the T of its state.
    assert state.i2c1.errors == 0 and abs(state.t_ms - state.i2c1.t_ms) <= 40
    assert state.i2cbus == ('done', 0, 0)
    board.i2c.poll_off(1)
    wait(lambda: board.state.i2c1.data == b'')


def test_a_stuck_bus_fails_the_transfer_but_not_the_link(sim, board):
    sim.happen('userbus held')
    with pytest.raises(r4link.RefusedError, match='bus stuck'):
        board.i2c.read(0x68, 0x75, 1)
    assert board.link.state == 'active'


def test_asyncio_reads_and_polls_the_i2c_bus(sim):
    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            assert await board.i2c.read(0x68, 0x75, 1) == b'\x68'
            assert await board.i2c.scan() == [0x40, 0x68]
            await board.i2c.poll(2, 0x40, b'\x00', 2, 0.01)
            await board.fields('I2C2')
            while (await board.next_state()).i2c2.data != b'\x39\x9f':
                pass
            await board.i2c.poll_off(2)
    asyncio.run(main())


def test_a_uart_read_returns_each_byte_once(board):
    board.setting('uart1', '115200:8N1')
    board.fields('DEFAULT,UART1,DAC1,GPIO')
    text = b''
    while len(text) < 800:
        text += board.uart[1].read(timeout=5).data
    assert b'$GPRMC,' in text and b'$GPGGA,' in text
    assert board.next_state().uart1.position > 0
    with pytest.raises(r4link.NotArmedError):
        board.uart[1].write(b'$')
    with pytest.raises(r4link.UsageError, match='uart'):
        board.uart[3].read()


# A UART whose ends are joined returns all written bytes. A receiver would send all the time: if a busy machine delayed
# the board, the board would lose bytes and report this.
SAID = bytes(range(256)) * 2
PIECES = [SAID[at:at + 32] for at in range(0, len(SAID), 32)]


def test_a_uart_callback_receives_each_byte_once(sim, board, wait):
    sim.happen('uart 1 loop')
    board.arm()
    board.setting('uart1', '115200:8N1')
    told = []
    subscription = board.uart[1].on_bytes(told.append)
    board.fields('DEFAULT,UART1')
    for number, piece in enumerate(PIECES, 1):
        board.uart[1].write(piece)
        wait(lambda number=number: sum(len(each.data) for each in told) >= 32 * number)
    subscription.cancel()
    count = len(told)
    assert all(isinstance(each, r4link.UartData) and isinstance(each.data, bytes) for each in told)
    assert b''.join(each.data for each in told) == SAID and sum(each.lost for each in told) == 0
    board.uart[1].write(b'more')
    for received in board.uart[1]:
        assert received.data
        break
    assert len(told) == count
    with pytest.raises(r4link.UsageError, match='uart'):
        board.uart[3].on_bytes(told.append)


def test_a_uart_reports_damaged_bytes(sim, board):
    board.setting('uart1', '115200:8N1')
    sim.happen('uart 1 noise')
    board.fields('DEFAULT,UART1')
    seen = 0
    for data, lost in board.uart[1]:
        seen += len(data)
        if lost:
            break
    assert seen > 0


def test_a_uart_reports_a_gap_when_states_are_lost(sim):
    with r4link.Board(r4link.with_link(sim.url, 'loss=50%,seed=7')) as board:
        board.wait_active(10)
        board.setting('uart2', '115200:8N1', timeout=10)
        board.fields('DEFAULT,UART2', timeout=10)
        assert any(lost for _, lost in itertools.islice(board.uart[2], 500))


def test_uart_iteration_ends_when_the_board_is_closed(board):
    board.setting('uart2', '115200:8N1')
    board.fields('DEFAULT,UART2')
    for data, _ in board.uart[2]:
        assert data
        board.close()
    assert list(board.uart[2]) == []


def test_asyncio_reads_and_writes_a_uart(sim):
    sim.happen('uart 1 loop')

    async def main():
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            loops = set()
            board.uart[1].on_bytes(lambda received: loops.add((asyncio.get_running_loop(), type(received.data))))
            await board.setting('uart1', '115200:8N1')
            await board.fields('DEFAULT,UART1')
            await board.arm()
            pieces = iter(PIECES)
            came = b''
            await board.uart[1].write(next(pieces))
            async for data, lost in board.uart[1]:
                assert lost == 0
                came += data
                if came == SAID:
                    break
                if len(came) % 32 == 0:
                    await board.uart[1].write(next(pieces))
            assert loops == {(asyncio.get_running_loop(), bytes)}
            rest = asyncio.create_task(count(board.uart[1]))
            await board.next_state()
            await board.close()
            assert await asyncio.wait_for(rest, 5) >= 0
    asyncio.run(main())


async def count(received):
    return len([each async for each in received])


def test_a_group_may_contain_voltages(sim, board, wait):
    group = Setpoints(Command.osmc(1, pwm=100), Command.dac(1, millivolts=1650), Command.dac(2, millivolts=3300))
    with pytest.raises(r4link.NotArmedError):
        board.send(group)
    board.fields('DEFAULT,DAC1,DAC2')
    board.arm()
    board.send(group)
    wait(lambda: (board.state.osmc1.pwm, board.state.dac1, board.state.dac2) == (100, 1650, 3300))
    assert board.post(Command.dac(1, millivolts=5))
    wait(lambda: board.state.dac1 == 5)
    with pytest.raises(r4link.UsageError, match='range'):
        Setpoints(Command.dac(1, millivolts=3301))
    with pytest.raises(r4link.UsageError, match='its channel'):
        Setpoints(Command.dac(1, millivolts=1), Command.dac(1, millivolts=2))
    board.stop()
    with pytest.raises(r4link.RefusedError):
        board.send(group)
    wait(lambda: (board.state.osmc1.pwm, board.state.dac1, board.state.dac2) == (0, 0, 0))


def test_states_report_a_voltage_and_spare_inputs(board, sim, wait):
    board.fields('DEFAULT,DAC1,GPIO')
    with pytest.raises(r4link.NotArmedError):
        board.dac(1, millivolts=1650)
    board.arm()
    board.dac(1, millivolts=1650)
    board.setting('uart2', '9600:8N1')
    board.uart[2].write(b'ab')
    sim.happen('gpio 3 low')
    wait(lambda: board.state.dac1 == 1650 and board.state.gpio == 0xFB)
    board.stop()
    wait(lambda: board.state.dac1 == 0)
