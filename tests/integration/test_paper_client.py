# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's Python client, as its section 8.6 describes it, drives the simulated board."""
import errno
import socket
import time
import zlib

from r4_process import SANITIZED, Board

LASTS_S = 10


class PaperClient:
    """As printed: T before PNum, T from its own clock in whole seconds, checksum by hex(), heartbeats
    answered when they come, seven commands for each datagram received; it sends from one socket and
    listens on another. (The print calls a function appendMsg for the heartbeat that it does not
    define; it is taken for sendMsg.)"""

    def __init__(self, board_port):
        self.address = ('127.0.0.1', board_port)
        self.client_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.pnum_sent = 0
        self.heartbeats = 0
        self.states = []

    def send_msg(self, message):
        message = message + ';T:' + str(int(time.perf_counter()))
        message = message + ';PNum:' + str(self.pnum_sent)
        self.pnum_sent += 1
        message = message + ';^'
        checksum = hex(zlib.crc32(message.encode()))
        message = message + checksum + '^'
        self.client_socket.sendto(message.encode(), self.address)

    def take(self, data):
        parts = data.split(b'^')
        checksum = parts[1]
        fields = parts[0] + b'^'
        assert hex(zlib.crc32(fields)) == checksum.decode()
        if fields[0] == 72:  # 'H': a heartbeat
            self.heartbeats += 1
            self.send_msg('H:ROS2-R4')
        else:
            self.states.append(fields.decode())
        for command in ('D:1000,1,1', 'D:1000,0,2', 'D:1000,1,3', 'D:1000,0,4', 'S:300,1', 'S:100,2',
                        'S:1000,3'):
            self.send_msg(command)

    def close(self):
        self.client_socket.close()


def test_the_papers_python_client_drives_the_board_for_ten_seconds_without_a_safe_state():
    server_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    server_socket.bind(('127.0.0.1', 0))
    server_socket.setblocking(False)
    listens_at = server_socket.getsockname()[1]
    with Board(f'udp://127.0.0.1:0?peer=127.0.0.1:{listens_at}') as board:
        # The board's port stands in front of its options.
        client = PaperClient(int(board.url.split('?')[0].rsplit(':', 1)[1]))
        end = time.monotonic() + LASTS_S
        while time.monotonic() < end:
            try:
                data = server_socket.recv(256)
            except OSError as error:
                assert error.errno == errno.EWOULDBLOCK
                continue
            client.take(data)
        log = board.rest()
    server_socket.close()
    client.close()

    went_safe = [each for each in log if each.get('state') == 'SAFE']
    active = [each for each in log if each.get('state') == 'ACTIVE']
    print(f'{len(client.states)} states, {client.heartbeats} heartbeats, {client.pnum_sent} datagrams sent')
    assert not went_safe, went_safe[:3]
    assert active and any('outputs' in each for each in active)
    assert client.heartbeats >= 2 * LASTS_S - 2
    assert len(client.states) >= 90 * LASTS_S or SANITIZED
    for state in client.states[-100:]:
        assert ';DHB1A:1000,1;' in state and ';SERVO1POS:300;' in state
        assert len(state) <= 256 - len('0x12345678^'), 'the client reads 256 bytes'
    outputs = [each['outputs'] for each in active if 'outputs' in each][-1]
    assert outputs['dhb'] == [[1000, 1], [1000, 0], [1000, 1], [1000, 0]]
    assert outputs['servo'][:3] == [298, 98, 1000]  # the nearest that the chip has
