# SPDX-License-Identifier: GPL-3.0-or-later
"""The services of r4 ros2, and the error of a host that is refused because r4 ros2 has control."""
import struct

import pytest

from r4_process import Board, free_port, run
from ros2_peer import BOOL, Cdr, Ros2, arm, armed, join, own_domain, pwm, text

CLIENT = 0x1122334455667788
REQUEST, RESPONSE = 'std_srvs::srv::dds_::Trigger_Request_', 'std_srvs::srv::dds_::Trigger_Response_'
SEND, SENT = (f'diagnostic_msgs::srv::dds_::AddDiagnostics_{half}_' for half in ('Request', 'Response'))


def ask(peer, service, request):
    """Returns the answer of a service: whether the board confirmed, and a text. On a busy machine a request may be too
    old when it arrives. Then the test repeats the request, at most twice."""
    for number in range(7, 10):
        peer.write(f'rq/r4/{service}Request', struct.pack('<Qq', CLIENT, number) + request)
        cdr = Cdr(peer.sample(f'rr/r4/{service}Reply'))
        assert (cdr.take('Q'), cdr.take('q')) == (CLIENT, number)
        confirmed, told = bool(cdr.take('B')), cdr.text()
        if 'came too late' not in told and 'not confirmed within' not in told:
            return confirmed, told
    raise AssertionError(told)


def test_services_answer_with_the_boards_confirmation():
    with armed() as (board, ros2, peer):
        peer.read('rr/r4/stopReply', RESPONSE, user_data='clientid=1;')
        peer.read('rr/r4/armReply', RESPONSE, user_data='clientid=1;')
        for name in ('stop', 'arm'):
            peer.writer(f'rq/r4/{name}Request', REQUEST, user_data='clientid=1;')
            ros2.logged(f'~/{name}: 1 publishers')
            own = peer.endpoint('writer', f'rr/r4/{name}Reply')['user_data']
            assert own.startswith('serviceid=') and 'typehash=RIHS01_2d946c21' in own
        for name in ('stop', 'arm'):
            confirmed, told = ask(peer, name, b'\0')
            assert confirmed and 'confirmed by the board' in told
        board.state('SAFE', 'stop')
        ros2.armed()
        for name in ('stop', 'arm'):
            peer.say('remove', f'rq/r4/{name}Request')


def test_the_service_send_answers_with_the_boards_result():
    with armed() as (board, ros2, peer):
        peer.read('rr/r4/sendReply', SENT, user_data='clientid=1;')
        peer.writer('rq/r4/sendRequest', SEND, user_data='clientid=1;')
        ros2.logged('~/send: 1 publishers')
        assert 'typehash=RIHS01_e7070a23' in peer.endpoint('writer', 'rr/r4/sendReply')['user_data']

        def send(commands):
            return ask(peer, 'send', text(commands))

        assert send('O:900,1,3; S:1500,2') == (True, 'O:900,1,3;S:1500,2: confirmed by the board')
        outputs = board.outputs(lambda each: pwm(each, 3) == 900)['outputs']
        assert outputs['servo'][1] == pytest.approx(1500, abs=5)
        for wrong, why in (('O:100,1,3;O:5000,1,4', '5000'), ('O:100,1,3;E:CLEAR', 'E:CLEAR'), ('', ''),
                           ('C:timeout,1000', 'settings'), ('F:AIN24', '--fields'),
                           ('O:1,1,1' * 200, 'not a valid command'), ('O:1,1,ü', 'ASCII')):
            confirmed, told = send(wrong)
            assert not confirmed and why in told and told, (wrong, told)
        assert send('Q:ID')[0]
        # After a second of silence, the outputs of the client go off, as for any publisher that drives.
        outputs = board.outputs(lambda each: pwm(each, 3) != 900)['outputs']
        assert pwm(outputs, 3) == 0 and outputs['servo'][1] == 0
        assert send('O:900,1,3')[0]
        board.outputs(lambda each: pwm(each, 3) == 900)
        assert send('E:STOP')[0]
        board.state('SAFE', 'stop')
        confirmed, told = send('O:900,1,3')
        assert not confirmed and 'stop' in told
        assert send('E:CLEAR')[0]
        confirmed, told = send('O:900,1,3')
        assert not confirmed and 'arm' in told
        join(ros2, peer, 'arm', BOOL)
        arm(ros2, peer)
        assert send('O:900,1,3')[0]
        for topic in ('rt/arm', 'rq/r4/sendRequest'):
            peer.say('remove', topic)
        board.outputs(lambda each: pwm(each, 3) == 0)


def test_a_refused_host_is_told_that_r4_ros2_has_control():
    with Board('udp://127.0.0.1:0') as board:
        url = board.host_url.replace('listen=0', f'listen={free_port()}')  # programs with one URL share the transport
        with Ros2(own_domain(), url, '--arm') as ros2:
            ros2.armed()
            refused = run('send', url, 'O:358,1,1')
            assert f'controlled by r4 ros2 (pid {ros2.process.pid})' in refused.stderr, refused
            assert ros2.end() == 0, ros2.errors
