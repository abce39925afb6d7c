# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 ros2 with messages of ROS that are lost or overtaken, or whose effect could not be undone."""
import signal
import struct
import time

import pytest

from machine import within
from r4_process import Board, again, run
from ros2_peer import (BOOL, DIAGNOSTICS, FLOAT32, INT32, LOG, STRING, TWIST, TWIST_STAMPED, Peer, Ros2, arm,
                       armed, drive, float32, health_of, join, own_domain, pwm, stamped, text, twist)

ON, OFF = b'\x01', b'\x00'


def newest_outputs(board):
    return [each for each in board.log if 'outputs' in each][-1]['outputs']


def test_a_zero_published_once_arrives_over_a_link_with_loss():
    # Without a deadline only the command can end the drive. Without repetition, a third of the commands would be lost.
    with armed('--deadline', '0', options=('--link', 'loss=30%,seed=7')) as (board, ros2, peer):
        join(ros2, peer, 'osmc1/command', FLOAT32)
        for _ in range(10):
            drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
            peer.write('rt/osmc1/command', float32(0))
            board.outputs(lambda each: pwm(each, 1) == 0)


def test_a_transfer_and_a_setpoint_can_share_a_command_text():
    with armed() as (board, ros2, peer):
        join(ros2, peer, 'R4_Command', STRING)
        for first in ('X:UART,1,x41', 'X:WRITE,0x68,x6b00'):
            drive(board, peer, 'rt/R4_Command', text(f'{first};O:358,1,1'), lambda each: pwm(each, 1) == 358)
            drive(board, peer, 'rt/R4_Command', text('O:0,1,1'), lambda each: pwm(each, 1) == 0)


@pytest.mark.parametrize('_', range(3))  # several runs, because the node takes both samples in one turn only by chance
def test_an_arm_published_before_a_stop_does_not_undo_the_stop(_):
    with armed() as (board, ros2, peer):
        join(ros2, peer, 'arm', BOOL)
        join(ros2, peer, 'stop', BOOL)
        join(ros2, peer, 'osmc1/command', FLOAT32)
        drive(board, peer, 'rt/osmc1/command', float32(0.25), lambda each: pwm(each, 1) == 1024)
        peer.write('rt/arm', OFF)
        peer.write('rt/arm', ON)
        peer.write('rt/stop', ON)  # if both samples arrive in the same turn, the node takes the stop first
        ros2.logged('E:STOP: confirmed')
        again(lambda: peer.write('rt/osmc1/command', float32(0.5)),
              lambda timeout: ros2.logged('not armed (stop)', timeout=timeout))
        board.state('SAFE', 'stop')
        arm(ros2, peer)


def test_an_arm_during_an_outage_has_no_effect_afterwards():
    with armed() as (board, ros2, peer):
        join(ros2, peer, 'arm', BOOL)
        join(ros2, peer, 'R4_Command', STRING)

        def arm():
            peer.write('rt/arm', OFF)
            peer.write('rt/arm', ON)
        again(lambda: peer.write('rt/R4_Command', text('E:STOP')),
              lambda timeout: ros2.logged('E:STOP: confirmed', timeout=timeout))
        board.signal(signal.SIGSTOP)
        again(arm, lambda timeout: ros2.logged('silent', timeout=timeout))
        ros2.logged('arm: ')
        arm()
        again(lambda: peer.write('rt/R4_Command', text('E:CLEAR')),
              lambda timeout: ros2.logged('E:CLEAR: ', timeout=timeout))
        board.signal(signal.SIGCONT)
        ros2.logged('the board accepts commands')
        again(lambda: peer.write('rt/R4_Command', text('O:358,1,1')),
              lambda timeout: ros2.logged('not armed (stop)', timeout=timeout))
        arm()
        ros2.armed()


def test_a_stop_during_an_outage_is_executed_afterwards():
    with armed() as (board, ros2, peer):
        join(ros2, peer, 'osmc1/command', FLOAT32)
        join(ros2, peer, 'stop', BOOL)
        drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
        board.signal(signal.SIGSTOP)
        ros2.logged('silent')
        peer.write('rt/stop', ON)
        ros2.logged('CUT THE POWER')  # the request for the stop has timed out
        board.signal(signal.SIGCONT)
        board.state('SAFE', 'stop')
        assert pwm(newest_outputs(board), 1) == 0


def test_a_best_effort_stop_is_obeyed_and_a_qos_mismatch_is_reported():
    with armed() as (board, ros2, peer):
        peer.writer('rt/stop', BOOL, reliability='best_effort')
        ros2.logged('stop: 1 publishers')
        again(lambda: peer.write('rt/stop', ON), lambda timeout: ros2.logged('E:STOP: confirmed', timeout=timeout))
        board.state('SAFE', 'stop')
        peer.writer('rt/osmc1/command', FLOAT32, reliability='best_effort', matched=False)
        ros2.logged('osmc1/command: a publisher does not offer the required reliability')
        peer.read('rt/R4', STRING, durability='transient_local')
        ros2.logged('R4: a subscriber requires more durability than this publisher offers')


def test_a_publisher_of_another_type_is_reported_while_it_exists():
    with armed() as (_, ros2, peer):
        peer.read('rt/diagnostics', DIAGNOSTICS)
        peer.read('rt/rosout', LOG)
        peer.sample('rt/diagnostics', lambda payload: health_of(payload)[0] == 0)
        # Another node may receive cmd_vel, so its publisher does not change the level.
        for topic, of, words, raised in (
                ('osmc1/command', 'std_msgs::msg::dds_::Float64_', b'std_msgs/msg/Float64, so its messages are ignored', 1),
                ('arm', STRING, b'std_msgs/msg/String, so its messages are ignored', 1),
                ('stop', STRING, b'std_msgs/msg/String, so its messages are ignored', 1),
                ('cmd_vel', TWIST, b'--drive', 0), ('relay1/command', BOOL, b'supply', 1)):
            peer.writer(f'rt/{topic}', of, matched=False)
            told = ros2.logged(words.decode())
            assert told['level'] == 'warning' and told['text'].startswith(f'{topic}: ')
            peer.sample('rt/rosout', lambda payload, words=words: words in payload)

            def is_told(payload, words=words, raised=raised):
                level, _, message, _, values = health_of(payload)
                return (level, words.decode() in message) == (raised, raised == 1) and \
                    words.decode() in values.get('mismatch 1', '')
            peer.sample('rt/diagnostics', is_told)
            peer.say('remove', f'rt/{topic}')
            peer.sample('rt/diagnostics', lambda payload: health_of(payload)[0] == 0 and
                        'mismatch 1' not in health_of(payload)[-1])


def test_a_stamped_cmd_vel_is_obeyed_unless_its_stamp_is_too_old():
    with armed('--drive', 'osmc1,osmc2', '--wheel-separation', '0.5', '--full-speed', '2') as (board, ros2, peer):
        peer.writer('rt/cmd_vel', TWIST_STAMPED)
        ros2.logged('geometry_msgs/msg/TwistStamped, which is also accepted')
        again(lambda: peer.write('rt/cmd_vel', stamped(time.time() - 5, twist(2, 0))),
              lambda timeout: ros2.logged('the stamp of the header is more than 1000 ms old', timeout=timeout))
        for stamp, speed in ((time.time() + 60, 0.5), (0, 1.0)):
            _, outputs = drive(board, peer, 'rt/cmd_vel', stamped(stamp, twist(speed, 0)),
                               lambda each, speed=speed: pwm(each, 1) == round(speed / 2 * 4095))
            assert pwm(outputs, 2) == pwm(outputs, 1)
        peer.say('remove', 'rt/cmd_vel')
        board.outputs(lambda each: pwm(each, 1) == 0)
        assert not any(pwm(each['outputs'], 1) == 4095 for each in board.log if 'outputs' in each)


def test_a_zero_during_an_outage_stops_the_drive_afterwards():
    with armed('--deadline', '0') as (board, ros2, peer):
        join(ros2, peer, 'osmc1/command', FLOAT32)
        drive(board, peer, 'rt/osmc1/command', float32(0.5), lambda each: pwm(each, 1) == 2048)
        board.signal(signal.SIGSTOP)
        ros2.logged('silent')
        again(lambda: peer.write('rt/osmc1/command', float32(0)),
              lambda timeout: ros2.logged('a command was dropped', timeout=timeout))
        board.signal(signal.SIGCONT)
        board.outputs(lambda each: pwm(each, 1) == 0)  # the board has no host
        board.outputs(lambda each: pwm(each, 1) == 2048)  # the node resumes
        board.outputs(lambda each: pwm(each, 1) == 0)


def test_the_option_arm_does_not_arm_after_an_earlier_stop():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board:
        url, host_url = board.url, board.host_url
    with Peer(domain) as peer, Ros2(domain, host_url, '--arm') as ros2:
        join(ros2, peer, 'stop', BOOL)
        again(lambda: peer.write('rt/stop', ON), lambda timeout: ros2.logged('CUT THE POWER', timeout=timeout))
        with Board(url) as board:
            ros2.logged('--arm: a stop came first; arm the board when the danger is over')
            board.state('SAFE', 'stop')


def test_a_restarted_node_does_not_clear_an_earlier_stop():
    domain = own_domain()
    with Board('udp://127.0.0.1:0') as board, Peer(domain) as peer:
        assert run('stop', board.host_url).returncode == 0
        board.state('CONNECTING', 'stop')
        with Ros2(domain, board.host_url, '--arm') as ros2:
            told = ros2.logged('not armed: an emergency stop came before this program began')['text']
            assert told.endswith('clear the cause on purpose: send E:CLEAR to R4_Command, or call ~/clear; then arm'), told
            assert not any(each.get('supply') for each in board.log)
            join(ros2, peer, 'R4_Command', STRING)
            join(ros2, peer, 'arm', BOOL)
            again(lambda: peer.write('rt/R4_Command', text('E:CLEAR')),
                  lambda timeout: board.state('ACTIVE', timeout=timeout))
            arm(ros2, peer)


def test_opening_relay_1_switches_every_output_off():
    with armed() as (board, ros2, peer):
        join(ros2, peer, 'relay3/command', BOOL)
        join(ros2, peer, 'R4_Command', STRING)
        drive(board, peer, 'rt/relay3/command', ON, lambda each: each['relays'] & 4)
        drive(board, peer, 'rt/R4_Command', text('R:1,Off'), lambda each: not each['relays'] & 1)
        board.state('SAFE', 'stop')
        assert newest_outputs(board)['relays'] == 0


def test_a_stepper_without_a_reported_position_is_not_driven():
    with armed('--fields', 'DEFAULT') as (_, ros2, peer):
        join(ros2, peer, 'stepper2/command', INT32)
        again(lambda: peer.write('rt/stepper2/command', (1000).to_bytes(4, 'little')),
              lambda timeout: ros2.logged('could not stop the stepper; add STEP2POS to --fields', timeout=timeout))


def test_a_topic_cannot_change_the_reported_fields():
    with armed('--fields', 'DEFAULT,STEP2POS') as (board, ros2, peer):
        join(ros2, peer, 'stepper2/command', INT32)
        join(ros2, peer, 'R4_Command', STRING)
        drive(board, peer, 'rt/stepper2/command', (100_000).to_bytes(4, 'little'), lambda each: each['stepper'][1][1])
        again(lambda: peer.write('rt/R4_Command', text('F:AIN24')),
              lambda timeout: ros2.logged('a topic cannot choose state fields', timeout=timeout))
        peer.say('remove', 'rt/stepper2/command')
        board.outputs(lambda each: not each['stepper'][1][1])


def test_a_text_with_one_refused_command_is_not_executed():
    with armed('--fields', 'DEFAULT') as (board, ros2, peer):
        join(ros2, peer, 'R4_Command', STRING)
        again(lambda: peer.write('rt/R4_Command', text('O:358,1,1;P:1,1000,2')),
              lambda timeout: ros2.logged('could not stop the stepper', timeout=timeout))
        drive(board, peer, 'rt/R4_Command', text('O:77,1,2'), lambda each: pwm(each, 2) == 77)
        assert not any(pwm(each['outputs'], 1) for each in board.log if 'outputs' in each)


def test_too_many_commands_in_one_text_are_reported():
    with armed() as (_, ros2, peer):
        join(ros2, peer, 'R4_Command', STRING)
        again(lambda: peer.write('rt/R4_Command', text('Q:ID;' * 4 + 'X:SCAN')),
              lambda timeout: ros2.logged('more than 4 commands without an output arrived at once (X:SCAN)', timeout=timeout))


def test_a_client_that_reads_no_answers_does_not_delay_topics():
    with armed() as (board, ros2, peer):
        peer.read('rt/R4', STRING)
        peer.writer('rq/r4/sendRequest', 'diagnostic_msgs::srv::dds_::AddDiagnostics_Request_')
        ros2.logged('~/send: 1 publishers')
        request = struct.pack('<Qq', 1, 1) + text('C:timeout,1000')  # the node answers at once
        peer.sample('rt/R4')
        came = [peer.sample('rt/R4').came]
        for _ in range(20):
            peer.write('rq/r4/sendRequest', request)
            came += [peer.sample('rt/R4').came for _ in range(5)]
        assert sorted(b - a for a, b in zip(came, came[1:]))[-10] < within(0.05)


def test_a_voltage_goes_off_when_its_publisher_is_removed():
    with armed('--fields', 'DEFAULT,DAC1') as (_, ros2, peer):
        peer.read('rt/R4', STRING)
        join(ros2, peer, 'R4_Command', STRING)
        again(lambda: peer.write('rt/R4_Command', text('X:DAC,1,3300')),
              lambda timeout: peer.sample('rt/R4', lambda payload: b'DAC1:3300;' in payload, timeout))
        peer.say('remove', 'rt/R4_Command')
        peer.sample('rt/R4', lambda payload: b'DAC1:0;' in payload)


def test_a_stepper_stops_although_its_state_needs_two_datagrams():
    with armed('--fields', 'ALL,I2C1,I2C2,I2C3,I2C4,UART1,UART2,I2CX,I2CBUS') as (board, ros2, peer):
        peer.read('rt/R4', STRING)
        join(ros2, peer, 'R4_Command', STRING)
        polls = text(';'.join(f'X:POLL,0x68,x3B,32,10,{slot}' for slot in range(1, 5)))
        again(lambda: peer.write('rt/R4_Command', polls),
              lambda timeout: peer.sample('rt/R4', lambda line: b'I2C4:' in line and b'STEP2POS:' not in line, timeout))
        join(ros2, peer, 'stepper2/command', INT32)
        drive(board, peer, 'rt/stepper2/command', (100_000).to_bytes(4, 'little'), lambda each: each['stepper'][1][1])
        peer.say('remove', 'rt/stepper2/command')
        removed = peer.next(lambda each: each['type'] == 'removed')['came']
        off = board.outputs(lambda each: not each['stepper'][1][1])
        assert off['came'] - removed < within(0.3)
