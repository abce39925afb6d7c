# SPDX-License-Identifier: GPL-3.0-or-later
"""Described devices (docs/how-to/described-devices.md)."""
import asyncio
import math

import numpy as np
import pytest

import r4link
from r4link import aio, devices

MINE = """device mine
address 0x40
poll bus x02 2 20
value volts bus 0 u16be bits 3..15 scale 0.004 unit V
"""


def test_a_shipped_device_is_set_up_and_decoded(sim, board, wait):
    sim.happen('device bno055 on')
    imu = r4link.Device('bno055@0x28')
    assert (str(imu), imu.role, imu.fields, imu.units['gyro_z']) == ('bno055@0x28', 'imu', 'I2C1,I2C2', 'rad/s')
    with pytest.raises(r4link.NotArmedError):
        board.attach(imu)
    board.arm()
    board.attach(imu)
    wait(lambda: imu.reading(board.state, 'accel_z').number == 9.81)
    state = board.next_state()
    readings = imu.readings(state)
    assert math.isclose(readings['quat_z'].number, math.sqrt(0.5), abs_tol=1e-4)
    assert readings['accel_z'].errors == 0 and 0 <= state.t_ms - readings['accel_z'].t_ms <= 1000
    with pytest.raises(r4link.UsageError, match='the device has no value yaw'):
        imu.reading(state, 'yaw')


def test_a_reset_device_has_no_values_until_it_is_attached_again(sim, board, wait):
    imu = r4link.Device('mpu6050')
    board.arm()
    assert imu.is_set_up(board.next_state()) is None
    board.attach(imu)
    wait(lambda: imu.reading(board.state, 'accel_z').number is not None)
    sim.happen('device mpu6050 reset')
    wait(lambda: imu.is_set_up(board.state) is False)
    assert imu.reading(board.state, 'accel_z').number is None
    board.attach(imu)
    wait(lambda: imu.is_set_up(board.state) and imu.reading(board.state, 'accel_z').number is not None)


def test_a_recording_has_columns_for_device_values(sim, board, wait, tmp_path):
    for device in ('bno055 on', 'ina219 on'):
        sim.happen(f'device {device}')
    board.arm()
    board.record(tmp_path / 'drive.r4log')
    imu, power = r4link.Device('bno055@0x28:1'), r4link.Device('ina219@0x40:5')
    board.attach(imu)
    wait(lambda: imu.reading(board.state, 'accel_z').number == 9.81)
    board.attach(power)  # attached later, so that earlier rows have no value
    wait(lambda: power.reading(board.state, 'current').number is not None)
    board.close()
    states = r4link.read(tmp_path / 'drive.r4log').boards[0].states
    assert states['bno055_accel_z'][-1] == 9.81
    assert np.isnan(states['ina219_current'][0]) and states['ina219_current'][-1] == pytest.approx(1.25)


def test_a_user_described_device_is_read_without_arming(board, wait, tmp_path):
    path = tmp_path / 'mine.device'
    path.write_text(MINE)
    for device in (r4link.Device(f'{path}@0x40:3'), r4link.Device.parse(MINE, first_slot=4)):
        board.attach(device)
        wait(lambda device=device: device.reading(board.state, 'volts').number == pytest.approx(12.16))


def test_a_slot_in_use_is_refused_until_its_poll_is_off(sim, board, wait):
    sim.happen('device as5600 on')
    power, angle = r4link.Device('ina219@0x40'), r4link.Device('as5600')
    board.attach(power)
    with pytest.raises(r4link.UsageError, match=r'as5600@0x36:1: ina219@0x40 has slot 1; use a free slot, as5600@0x36:3'):
        board.attach(angle)
    board.attach(power)
    for slot in (1, 2):
        board.i2c.poll_off(slot)
    board.attach(angle)
    wait(lambda: angle.reading(board.state, 'angle').number is not None)


def test_wrong_descriptions_and_devices_are_refused(board, tmp_path):
    with pytest.raises(r4link.DataError, match='line 4: the value ends after the 2 bytes of its poll'):
        r4link.Device.parse(MINE.replace('bus 0', 'bus 1'))
    with pytest.raises(r4link.UsageError, match='a description of this device does not exist'):
        r4link.Device('bno056')
    with pytest.raises(r4link.OpenError):
        r4link.Device(str(tmp_path / 'none.device'))
    with pytest.raises(r4link.RefusedError, match='this is another device'):
        board.attach(r4link.Device('icm20948@0x68'))
    assert devices.shipped() == ['as5600', 'bno055', 'icm20948', 'ina219', 'mpu6050', 'vl53l0x']


def test_asyncio_attaches_and_reads_a_device(sim):
    async def main():
        power = r4link.Device('ina219')
        async with aio.Board(sim.url) as board:
            await board.wait_active()
            await board.attach(power)
            with pytest.raises(r4link.UsageError, match='ina219@0x40 has slot 1'):
                await board.attach(r4link.Device('ina219@0x41'))
            while power.reading(await board.next_state(), 'current').number is None:
                pass
            assert power.reading(board.state, 'current').number == pytest.approx(1.25)
    asyncio.run(main())
