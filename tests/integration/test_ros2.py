# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 ros2 in a graph with a Fast DDS peer, which uses the bytes of ROS 2's messages."""
import math
import os
import pathlib
import resource
import runpy
import signal
import struct
import subprocess
import sys
import time
import types

import pytest

from lan import Lan
from machine import within
from r4_process import ERROR, PATIENCE_S, R4, Board, again, lasts, run
from ros2_peer import (BOOL, DIAGNOSTICS, FLOAT32, INT32, LOG, NODES, NODES_HASH, STRING, TWIST, UINT32, Cdr, Peer, Ros2,
                       arm, drive, float32, health_of, join, nodes_of, own_domain, pwm, text, texts, twist)

USAGE = 2
ON, OFF = b'\x01', b'\x00'


@pytest.fixture(scope='module', name='graph')
def make_graph():
    """A board, its armed node, and a peer."""
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer:
        with Ros2(domain, board.host_url, '--arm', '--counts-per-turn', '4096', '--drive', 'osmc1,-osmc2',
                  '--wheel-separation', '0.5', '--full-speed', '2') as ros2:
            ros2.armed()
            yield board, ros2, peer
            assert ros2.end() == 0, ros2.errors
            peer.end()


@pytest.mark.parametrize('reach', ['LOCALHOST', 'SUBNET'])
def test_ros_on_this_computer_finds_the_node_and_other_computers_do_not(reach):
    with Lan() as lan:
        # More networks than Cyclone DDS can use at the same time.
        here = lan.computer('10.77.0.1', *(f'10.{n}.0.1' for n in range(78, 81))).inside
        there = lan.computer('10.77.0.2').inside
        domain = own_domain()
        ros = {**domain, 'ROS_AUTOMATIC_DISCOVERY_RANGE': reach}
        other = {**domain, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'ROS_STATIC_PEERS': '10.77.0.1'}
        with Board('udp://127.0.0.1:0', **here) as board, Peer(ros, **here) as peer, Peer(other, **there) as stranger:
            with Ros2(domain, board.host_url, '--arm', **here) as ros2:
                ros2.armed()
                join(ros2, peer, 'osmc1/command', FLOAT32)
                drive(board, peer, 'rt/osmc1/command', float32(0.1), lambda each: pwm(each, 1) != 0)
                peer.read('rt/R4', STRING)
                peer.sample('rt/R4')
                stranger.endpoint('reader', 'rt/R4')  # the stranger finds ROS on this computer
                with pytest.raises(AssertionError, match='nothing of that kind'):
                    stranger.endpoint('writer', 'rt/R4', timeout=1)  # without the filter, it is found within 0.2 s
                assert ros2.end() == 0, ros2.errors


def test_the_node_publishes_the_topics_of_the_paper(graph):
    _, _, peer = graph
    for topic in ('R4', 'R4_Heart_Beat', 'R4_Active'):
        peer.read(f'rt/{topic}', STRING)
    assert texts(peer.sample('rt/R4_Active')) == 'True'
    beats = [texts(peer.sample('rt/R4_Heart_Beat')) for _ in range(3)]
    assert beats in (['True', 'False', 'True'], ['False', 'True', 'False'])
    line = texts(peer.sample('rt/R4', lambda payload: b'AIN24:' in payload))
    assert 'PNum:' in line and line.count('^') == 2
    heartbeat = texts(peer.sample('rt/R4', lambda payload: b'H:R4-ROS2' in payload))
    assert 'PNum:' in heartbeat
    first, second = (peer.sample('rt/R4', lambda payload: b'AIN24:' in payload) for _ in range(2))
    assert second.came - first.came < 0.5


def test_endpoints_announce_the_type_hashes_of_newer_releases(graph):
    _, _, peer = graph
    for kind, topic, of, hashed in (
            ('writer', 'R4', STRING, 'df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'),
            ('reader', 'R4_Command', STRING, 'df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'),
            ('reader', 'cmd_vel', TWIST, '9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a'),
            ('writer', 'osmc1/state', FLOAT32, '7170d3d8f841f7be3172ce5f4f59f3a4d7f63b0447e8b33327601ad64d83d6e2')):
        endpoint = peer.endpoint(kind, f'rt/{topic}')
        assert endpoint['of'] == of and endpoint['user_data'] == f'typehash=RIHS01_{hashed};'


def test_commands_in_one_text_are_executed_as_a_group(graph):
    board, ros2, peer = graph
    join(ros2, peer, 'R4_Command', STRING)
    _, outputs = drive(board, peer, 'rt/R4_Command', text('O:358,1,3; S:1500,2 ;'), lambda each: pwm(each, 3) == 358)
    assert outputs['servo'][1] == pytest.approx(1500, abs=5)
    peer.write('rt/R4_Command', text('O:100,1,3;O:5000,1,4'))  # one of two is invalid, so neither command is executed
    _, outputs = drive(board, peer, 'rt/R4_Command', text('O:200,0,3'), lambda each: pwm(each, 3) != 358)
    assert pwm(outputs, 3) == -200
    peer.say('remove', 'rt/R4_Command')  # the outputs that the publisher drove go off
    outputs = board.outputs(lambda each: pwm(each, 3) == 0)['outputs']
    assert outputs['servo'][1] == 0


def test_outputs_are_commanded_and_reported_in_the_units_of_ros(graph):
    board, ros2, peer = graph
    peer.read('rt/osmc1/state', FLOAT32)
    join(ros2, peer, 'osmc1/command', FLOAT32)
    written, outputs = drive(board, peer, 'rt/osmc1/command', float32(-0.5), lambda each: pwm(each, 1) != 0)
    assert pwm(outputs, 1) == -2048
    told = peer.sample('rt/osmc1/state', lambda payload: struct.unpack('<f', payload)[0] < -0.4)
    assert struct.unpack('<f', told)[0] == pytest.approx(-2048 / 4095, abs=1e-6)
    # After the deadline of 1 s, the output of a publisher that is silent but exists goes off.
    off = board.outputs(lambda each: pwm(each, 1) == 0)
    assert 0.9 < off['came'] - written < within(1.4)
    for wrong in (math.nan, math.inf, 1.5):
        peer.write('rt/osmc1/command', float32(wrong))
    _, outputs = drive(board, peer, 'rt/osmc1/command', float32(0.25), lambda each: pwm(each, 1) != 0)
    assert pwm(outputs, 1) == 1024
    peer.say('remove', 'rt/osmc1/command')
    board.outputs(lambda each: pwm(each, 1) == 0)

    join(ros2, peer, 'servo4/command', FLOAT32)
    _, outputs = drive(board, peer, 'rt/servo4/command', float32(math.pi / 4), lambda each: each['servo'][3] != 0)
    assert outputs['servo'][3] == pytest.approx(2000, abs=5)
    peer.say('remove', 'rt/servo4/command')
    board.outputs(lambda each: each['servo'][3] == 0)


def test_cmd_vel_drives_two_wheels_and_an_invalid_speed_stops_them(graph):
    board, ros2, peer = graph
    join(ros2, peer, 'cmd_vel', TWIST)
    # The wheels have 0.5 and 1.5 m/s of at most 2 m/s. The right wheel is reversed.
    _, outputs = drive(board, peer, 'rt/cmd_vel', twist(1.0, 2.0), lambda each: pwm(each, 2) != 0)
    assert pwm(outputs, 1) == 1024 and pwm(outputs, 2) == -3071
    peer.write('rt/cmd_vel', twist(math.nan, 0))
    outputs = board.outputs()['outputs']
    assert pwm(outputs, 1) == 0 and pwm(outputs, 2) == 0  # both wheels go off at once
    peer.say('remove', 'rt/cmd_vel')


def test_sensors_are_published_in_the_messages_of_ros(graph):
    _, _, peer = graph
    peer.read('rt/battery', 'sensor_msgs::msg::dds_::BatteryState_', 'best_effort')
    cdr = Cdr(peer.sample('rt/battery'))
    stamp, _ = cdr.header()
    assert abs(time.time() - stamp) < 2
    assert 23 < cdr.take('f') < 26 and math.isnan(cdr.take('f'))
    peer.read('rt/range/us1', 'sensor_msgs::msg::dds_::Range_')
    cdr = Cdr(peer.sample('rt/range/us1'))
    assert cdr.header()[1] == 'us1' and cdr.take('B') == 0
    assert [round(cdr.take('f'), 3) for _ in range(3)] == [0.26, 0.02, 4.0]
    assert cdr.take('f') > 0 and cdr.take('f') == 0
    peer.read('rt/joint_states', 'sensor_msgs::msg::dds_::JointState_')
    cdr = Cdr(peer.sample('rt/joint_states'))
    assert abs(time.time() - cdr.header()[0]) < 2
    assert cdr.list(cdr.text) == [f'encoder{n}' for n in range(1, 5)]
    assert all(math.isfinite(value) for value in cdr.list(lambda: cdr.take('d')))
    assert all(math.isfinite(value) for value in cdr.list(lambda: cdr.take('d')))
    peer.read('rt/encoder1', INT32)
    peer.read('rt/relays', UINT32)
    peer.read('rt/handle', BOOL)
    assert len(peer.sample('rt/encoder1')) == 4
    assert struct.unpack('<I', peer.sample('rt/relays'))[0] & 1 == 1
    assert peer.sample('rt/handle')[:1] == ON  # padding up to four bytes follows


def test_diagnostics_report_the_health_of_the_board(graph):
    _, _, peer = graph
    peer.read('rt/diagnostics', DIAGNOSTICS)
    level, name, message, hardware, values = health_of(peer.sample('rt/diagnostics'))
    assert (level, name, message, hardware) == (0, '/r4: board', 'armed', 'sim-1')
    assert values['link'] == 'active' and float(values['state rate (Hz)']) > 0 and values['firmware']


def test_malformed_samples_change_nothing(graph):
    """Sends to each subscription a sample that would drive or stop if it were not damaged."""
    board, ros2, peer = graph
    valid = {'String': text('O:900,1,1'), 'Bool': ON, 'Float32': float32(0.5), 'Int32': struct.pack('<i', 1000),
             'Twist': twist(1, 2), 'Trigger': struct.pack('<QqB', 1, 1, 0),
             'AddDiagnostics': struct.pack('<Qq', 1, 1) + text('O:900,1,1')}
    no_strings = [b'\x01\0\0\0', bytes(4), b'\xff\xff\xff\xffO:1,1,1\0', struct.pack('<I', 10) + b'O:900,1,1\x01',
                  struct.pack('<I', 10) + b'O:900,1,\0\0', struct.pack('<I', 9) + b'O:900,1,1', bytes(range(256))]
    foreign = [bytes((0, 2, 0, 0)), bytes((0, 3, 0, 0)), bytes((0, 8, 0, 0)), bytes((0, 11, 0, 0)), b'\xff\xff\0\0']
    topics = []
    for each in ros2.ready['subscriptions'] + ros2.ready['services']:
        package, kind, name = each['type'].split('/')
        before, after = ('rt', '') if kind == 'msg' else ('rq', 'Request')
        topics.append((before + each['name'] + after, name))
        peer.writer(topics[-1][0], f'{package}::{kind}::dds_::{name}_{after and "Request_"}')
        ros2.logged(f"{'~' + each['name'][3:] if after else each['name'][1:]}: 1 publishers")
    assert {name for _, name in topics} == set(valid)
    board.skip_past()
    mark = len(board.log)
    for topic, name in topics:
        good = valid[name]
        # Multiples of 4, because shorter samples are padded on the wire.
        bad = [good[:size] for size in range(0, len(good), 4)]
        bad += [good[:-len(text('O:900,1,1'))] + each for each in no_strings if name in ('String', 'AddDiagnostics')]
        if name == 'AddDiagnostics':  # the requests of rmw_fastrtps have no identity in the payload
            bad += [text('O:900,1,1'), text('O:900,1,1;' * 9)]
        for payload in bad:
            peer.write(topic, payload)
        for head in foreign:
            peer.write_raw(topic, head + good)
    peer.write('rt/relay2/command', b'\x02\0')
    for payload in (math.nan, math.inf, -1e30):
        peer.write('rt/osmc1/command', float32(payload))
    for topic, _ in topics:  # this data is not a sample, and blocks later samples of its writer only
        peer.write_raw(topic, b'\0\x01')
        peer.say('remove', topic)
    join(ros2, peer, 'R4_Command', STRING)
    _, outputs = drive(board, peer, 'rt/R4_Command', text('O:77,1,4'), lambda each: pwm(each, 4) == 77)
    assert [pwm(outputs, n) for n in range(1, 4)] == [0, 0, 0]
    at_rest = [each['outputs'] for each in board.log[mark:-1] if 'outputs' in each]
    assert all(each == {**outputs, 'osmc': each['osmc'], 'relays': each['relays']} and each['relays'] in (0, 1) and
               not any(pwm(each, n) for n in range(1, 5)) for each in at_rest), at_rest
    assert not any(map(any, outputs['dhb'])) and not any(outputs['servo']), outputs
    assert not any(each.get('state') == 'SAFE' for each in board.log[mark:])
    peer.say('remove', 'rt/R4_Command')
    board.outputs(lambda each: pwm(each, 4) == 0)
    assert ros2.process.poll() is None


def test_a_hundred_subscribers_do_not_slow_the_states(graph):
    board, _, peer = graph
    peer.say('crowd', 'rt/R4', STRING, '100')

    def until(fewest):
        deadline = time.monotonic() + PATIENCE_S
        while peer.counted('rt/R4') < fewest:
            assert time.monotonic() < deadline
            lasts(0.02)
        return time.monotonic()
    begun = until(1)
    board.skip_past()
    before = peer.counted('rt/R4')
    took = until(before + 100) - begun  # by then each reader has received the states of one second
    assert took < within(1.2)
    board.never('SAFE', 0.1)


def test_a_flood_of_commands_does_not_make_the_board_safe(graph):
    board, ros2, peer = graph
    join(ros2, peer, 'R4_Command', STRING)
    for value in range(2000):
        peer.write('rt/R4_Command', text(f'O:{value + 1},1,1'))
    drive(board, peer, 'rt/R4_Command', text('O:2000,1,1'), lambda each: pwm(each, 1) == 2000)
    peer.say('remove', 'rt/R4_Command')
    board.outputs(lambda each: pwm(each, 1) == 0)
    assert not any(each.get('state') == 'SAFE' for each in board.log)
    assert ros2.process.poll() is None


def test_after_a_stop_a_repeated_arm_does_not_arm(graph):
    board, ros2, peer = graph
    join(ros2, peer, 'arm', BOOL)
    join(ros2, peer, 'stop', BOOL)
    join(ros2, peer, 'osmc1/command', FLOAT32)
    peer.write('rt/arm', ON)
    drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
    peer.write('rt/stop', OFF)
    peer.write('rt/stop', ON)
    assert pwm(board.outputs(lambda each: pwm(each, 1) != 2048)['outputs'], 1) == 0
    board.state('SAFE', 'stop')
    ros2.logged('E:STOP: confirmed')
    peer.write('rt/arm', ON)  # the same publisher repeats the value true
    again(lambda: peer.write('rt/osmc1/command', float32(0.5)),
          lambda timeout: ros2.logged('not armed (stop)', timeout=timeout))
    arm(ros2, peer)
    drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
    for topic in ('arm', 'stop', 'osmc1/command'):
        peer.say('remove', f'rt/{topic}')
    board.outputs(lambda each: pwm(each, 1) == 0)


@pytest.mark.parametrize('user_data, gid_size', ((NODES_HASH, 16), ('-', 24)))
def test_the_node_is_listed_for_every_release_of_ros(user_data, gid_size):
    """`user_data`: the user data of the peer's writer of the list of nodes, as in one release of ROS."""
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer, \
            Ros2(domain, board.host_url, '--namespace', 'robot') as ros2:
        assert ros2.ready['nodes'][0]['name'] == '/robot/r4'
        peer.read('ros_discovery_info', NODES, 'reliable', 'transient_local', user_data)
        peer.writer('ros_discovery_info', NODES, 'reliable', 'transient_local', user_data, matched=False)
        listed = peer.sample('ros_discovery_info', lambda data: b'/robot\0' in data)
        nodes = nodes_of(listed, gid_size)
        readers, writers = nodes.pop('/robot/r4')
        assert not nodes
        raw = bytes.fromhex(peer.endpoint('writer', 'rt/robot/R4')['gid'])
        assert raw.ljust(gid_size, b'\0') in writers
        services = 4
        assert len(readers) == len(ros2.ready['subscriptions']) + services + 1  # `stop` has two subscriptions
        assert len(writers) == len(ros2.ready['publishers']) + services
        left = ros2.signal(signal.SIGINT)
        gone = peer.sample('ros_discovery_info', lambda data: data[:16] == listed[:16])
        assert nodes_of(gone, gid_size) == {}
        assert gone.came - left < within(0.2)

        def topics_are_gone():
            return not any('/robot/' in topic for _, topic in peer.endpoints)
        if not topics_are_gone():
            went = peer.next(lambda _: topics_are_gone(), timeout=8)  # the lease lasts 10 s
            assert went['came'] - left < within(0.2)
        peer.next(lambda each: each['type'] == 'participant' and each['gone'], timeout=8)
        assert ros2.wait() == 0
        assert time.monotonic() - left < within(1)
        # A second node, as after a restart.
        with Ros2(domain, board.host_url):
            assert '/r4' in nodes_of(peer.sample('ros_discovery_info', lambda data: b'r4\0' in data), gid_size)


def test_no_output_is_driven_before_arming():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer, \
            Ros2(domain, board.host_url, '--deadline', '0.3') as ros2:
        ros2.logged('the board accepts commands')
        join(ros2, peer, 'R4_Command', STRING)
        again(lambda: peer.write('rt/R4_Command', text('O:358,1,1')),
              lambda timeout: ros2.logged('not armed (not yet)', timeout=timeout))
        join(ros2, peer, 'arm', BOOL)
        arm(ros2, peer)
        written, _ = drive(board, peer, 'rt/R4_Command', text('O:358,1,1'), lambda each: pwm(each, 1) == 358)
        off = board.outputs(lambda each: pwm(each, 1) == 0)
        assert 0.25 < off['came'] - written < within(0.8)
        peer.write('rt/R4_Command', text('E:STOP'))
        board.state('SAFE', 'stop')


def test_each_board_has_a_namespace_and_a_lost_board_is_reported():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as left, Board('udp://127.0.0.1:0') as right, Peer(domain) as peer:
        with Ros2(domain, left.host_url, right.host_url) as ros2:
            assert [node['name'] for node in ros2.ready['nodes']] == ['/board1/r4', '/board2/r4']
            for topic in ('board1', 'board2'):
                peer.read(f'rt/{topic}/R4_Active', STRING)
                peer.sample(f'rt/{topic}/R4_Active', lambda payload: texts(payload) == 'True')
            peer.read('rt/rosout', LOG, 'reliable', 'transient_local')
            peer.writer('rt/stop', BOOL, matched=False)
            told = ros2.logged('/stop: a publisher (')
            assert 'uses a topic that r4 ros2 does not receive; publish /board1/stop, and so on for each board' in told['text']
            right.signal(signal.SIGKILL)
            peer.sample('rt/board2/R4_Active', lambda payload: texts(payload) == 'False')
            peer.sample('rt/rosout', lambda payload: b'board2.r4\0' in payload and b'\0' in payload)


def test_two_nodes_with_one_name_warn_about_each_other():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as one, Board('udp://127.0.0.1:0') as other, Peer(domain) as peer, \
            Ros2(domain, one.host_url) as first:
        peer.read('rt/rosout', LOG, 'reliable', 'transient_local')
        with Ros2(domain, other.host_url) as second:
            for here, there in ((first, second), (second, first)):
                told = here.logged(f'process {there.process.pid} on ')
                assert told['level'] == 'warning' and 'also has a node /r4' in told['text']
                assert '--namespace' in told['text']
            for _ in range(2):  # the two messages arrive in either order
                assert peer.sample('rt/rosout', lambda data: b'also has a node /r4' in data)[8] == 30
        with Ros2(domain, other.host_url, '--namespace', 'other') as third:
            third.logged('the board is connected')
            assert not any(' too: ' in each.get('text', '') for each in third.log)


def test_r4_ros2_prints_its_node_domain_and_topics():
    domain = own_domain()
    result = run('ros2', 'sim:', '--namespace', 'robot', '--duration', '0.2', env=domain)
    lines = result.stdout.splitlines()
    assert result.returncode == 0 and lines[0] == f'/robot/r4 in domain {domain["ROS_DOMAIN_ID"]}, reach: this computer'
    for line in ('  /robot/R4  std_msgs/msg/String', '  /robot/osmc1/command  std_msgs/msg/Float32',
                 '  /diagnostics  diagnostic_msgs/msg/DiagnosticArray', '  /robot/r4/stop  std_srvs/srv/Trigger'):
        assert line in lines


def example(name):
    return runpy.run_path(str(pathlib.Path(__file__).parents[2] / 'docs' / 'examples' / 'ros2' / name))


def test_the_launch_example_starts_r4_ros2(monkeypatch):
    actions = types.SimpleNamespace(ExecuteProcess=lambda cmd, **options: (cmd, options))
    monkeypatch.setitem(sys.modules, 'launch', types.SimpleNamespace(LaunchDescription=list, actions=actions))
    monkeypatch.setitem(sys.modules, 'launch.actions', actions)
    [(command, options)] = example('robot.launch.py')['generate_launch_description']()
    assert command[:3] == ['r4', 'ros2', 'serial:auto'] and '--arm' not in command and options['respawn']
    result = run('ros2', 'sim:', *command[3:], '--duration', '0.1', env=own_domain())
    assert result.returncode == 0 and '  /robot/cmd_vel  geometry_msgs/msg/Twist' in result.stdout.splitlines()


def test_the_wheel_speeds_example_keeps_the_commanded_speeds():
    base = example('wheel_speeds.py')['Base']()
    base.supply = True
    speeds, now = [0.0, 0.0], 0.0

    def drive(seconds, *command):
        """Simulates motors that reach three quarters of the speed of their duty, and the encoders of both wheels."""
        nonlocal now
        for _ in range(int(seconds * 100)):
            now += 0.01
            if command:
                base.command(*command, now)
            for i, duty in enumerate(base.update(speeds, now)):
                assert abs(duty) <= 1
                speeds[i] += (duty * 30 * 0.75 - speeds[i]) * 0.1
        return speeds
    assert drive(5, 0.5, 1.0) == pytest.approx([(0.5 - 0.21) / 0.05, (0.5 + 0.21) / 0.05], rel=0.02)
    drive(0.1, math.nan, 0)  # NaN is not a command
    drive(0.6)
    assert base.update(speeds, now) == [0, 0]  # without a new command the wheels are off
    assert drive(10, 9.0, 0.0)[0] == pytest.approx(22.5, rel=0.02)  # the highest speed
    assert drive(5, 0.5, 0.0) == pytest.approx([10, 10], rel=0.05)  # the controller recovers from saturation
    base.command(1, 0, now)
    assert base.update((math.nan, 0), now) == [0, 0]
    base.supply = False
    for _ in range(500):  # not armed while cmd_vel continues: the wheels stand, and the error must not add up
        now += 0.01
        base.command(0.1, 0, now)
        assert base.update((0, 0), now) == [0, 0]
    base.supply = True
    base.command(0.1, 0, now)
    assert base.update((0, 0), now)[0] == pytest.approx(2 / 30 + 0.02 * 2, abs=0.01)


def test_too_many_open_files_are_reported():
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    files = []
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(2048, hard), hard))
        files = [os.open(os.devnull, os.O_RDONLY) for _ in range(1024)]
        result = subprocess.run([R4, 'ros2', 'sim:', '--duration', '0.1'], pass_fds=files, env=own_domain(), check=False,
                                capture_output=True, text=True, timeout=PATIENCE_S)
    finally:
        for each in files:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert result.returncode == 4 and ERROR.search(result.stderr) and 'open files' in result.stderr, result


def test_wrong_uses_are_refused():
    for arguments, environment in ((('--name', '1x'), {}), (('--namespace', 'a//b'), {}), (('--servo', '1,2'), {}),
                                   (('--drive', 'osmc1,osmc1'), {}), (('--drive', 'osmc1,osmc2'), {}),
                                   (('--full-speed', '1'), {}), (('--counts-per-turn', 'nan'), {}),
                                   ((), {'ROS_DOMAIN_ID': '233'}), ((), {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'FAR'})):
        result = run('ros2', 'sim:', *arguments, env={**os.environ, **environment})
        assert result.returncode == USAGE and ERROR.search(result.stderr), (arguments, environment, result)
