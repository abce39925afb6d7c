# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices on the user's I2C bus (docs/devices.md)."""
import asyncio

import pytest

import r4link
from r4link import aio


def test_reads_writes_and_scans(board):
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


def test_the_state_brings_what_the_board_reads_by_itself(board, wait):
    board.i2c.poll(1, 0x68, 0x75, 1, period=0.02)
    board.fields('DEFAULT,I2C1,I2CBUS')
    wait(lambda: board.state.i2c1.data == b'\x68')
    state = board.next_state()
    assert state.i2c1.errors == 0 and 0 <= state.t_ms - state.i2c1.t_ms <= 40
    assert state.i2cbus == ('done', 0, 0)
    board.i2c.poll_off(1)
    wait(lambda: board.state.i2c1.data == b'')


def test_a_held_bus_is_an_error_of_the_transfer_alone(sim, board):
    sim.happen('userbus held')
    with pytest.raises(r4link.RefusedError, match='bus stuck'):
        board.i2c.read(0x68, 0x75, 1)
    assert board.link.state == 'active'


def test_for_asyncio(sim):
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


def test_a_uart_brings_each_byte_once(board):
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


def test_a_voltage_is_an_output_and_spare_inputs_are_bits(board, sim, wait):
    board.fields('DEFAULT,DAC1,GPIO')
    with pytest.raises(r4link.NotArmedError):
        board.dac(1, 1650)
    board.arm()
    board.dac(1, 1650)
    board.setting('uart2', '9600:8N1')
    board.uart[2].write(b'ab')
    sim.happen('gpio 3 low')
    wait(lambda: board.state.dac1 == 1650 and board.state.gpio == 0xFB)
    board.stop()
    wait(lambda: board.state.dac1 == 0)
