# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 ros2 --device: the values of described devices, in the messages of ROS."""
import math
import time

import pytest

from r4_process import Board
from ros2_peer import Cdr, Peer, Ros2, own_domain

IMU, BATTERY, RANGE, JOINTS = (f'sensor_msgs::msg::dds_::{name}_' for name in
                               ('Imu', 'BatteryState', 'Range', 'JointState'))


def doubles(cdr, count):
    return [cdr.take('d') for _ in range(count)]


def test_each_device_role_is_published_in_its_ros_message():
    domain = own_domain()
    connected = ('--device', 'bno055', '--device', 'vl53l0x', '--device', 'as5600')
    devices = [word for name in ('bno055', 'ina219', 'vl53l0x', 'as5600') for word in ('--device', name)]
    with Board('udp://127.0.0.1:0', options=connected) as board, Peer(domain) as peer:
        with Ros2(domain, board.host_url, '--arm', *devices) as ros2:
            ros2.armed()
            peer.read('rt/bno055/imu', IMU)
            cdr = Cdr(peer.sample('rt/bno055/imu'))
            stamp, frame = cdr.header()
            assert abs(time.time() - stamp) < 2 and frame == 'bno055'
            assert doubles(cdr, 4) == pytest.approx([0, 0, math.sqrt(0.5), math.sqrt(0.5)], abs=1e-4)
            assert doubles(cdr, 9) == [0] * 9
            assert doubles(cdr, 3) == [0, 0, 0]
            doubles(cdr, 9)
            assert doubles(cdr, 3) == pytest.approx([0, 0, 9.81])
            peer.read('rt/ina219/battery', BATTERY)
            cdr = Cdr(peer.sample('rt/ina219/battery'))
            cdr.header()
            voltage, temperature, current = (cdr.take('f') for _ in range(3))
            assert (voltage, current) == pytest.approx((12.16, -1.25)) and math.isnan(temperature)
            peer.read('rt/vl53l0x/range', RANGE)
            cdr = Cdr(peer.sample('rt/vl53l0x/range'))
            assert cdr.header()[1] == 'vl53l0x' and cdr.take('B') == 1
            assert [cdr.take('f') for _ in range(4)] == pytest.approx([0, 0.03, 2, 0.5])
            peer.read('rt/as5600/joint_states', JOINTS)
            cdr = Cdr(peer.sample('rt/as5600/joint_states'))
            cdr.header()
            assert cdr.list(cdr.text) == ['as5600']
            assert cdr.list(lambda: cdr.take('d')) == pytest.approx([math.pi / 2])
            assert ros2.end() == 0, ros2.errors
            peer.end()


@pytest.mark.parametrize(('reach', 'told'), [('5 6', -math.inf), ('0.03 2', math.inf), ('0.03 5', 3.04)])
def test_a_range_distinguishes_too_near_from_nothing_in_range(reach, told, tmp_path):
    mine, domain = tmp_path / 'mine.device', own_domain()
    mine.write_text('device mine\nrole range\naddress 0x40\npoll bus x02 2 20\n'
                    f'value distance bus 0 u16be bits 3..15 scale 0.001 unit m range {reach}\n')
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer:
        with Ros2(domain, board.host_url, '--device', str(mine)) as ros2:
            peer.read('rt/mine/range', RANGE)
            cdr = Cdr(peer.sample('rt/mine/range'))
            assert cdr.header()[1] == 'mine' and cdr.take('B') == 1
            assert [cdr.take('f') for _ in range(4)][3] == pytest.approx(told)
            assert ros2.end() == 0, ros2.errors
            peer.end()


def test_a_device_is_not_set_up_before_the_board_is_armed():
    domain = own_domain()
    with Board('udp://127.0.0.1:0', options=('--device', 'bno055')) as board:
        with Ros2(domain, board.host_url, '--device', 'bno055') as ros2:
            ros2.logged('bno055@0x28: it is not set up before the board is armed')
            assert ros2.end() == 0, ros2.errors
