# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's Python client, as the paper's section 8.6 describes it, drives the simulated board."""
import errno
import socket
import time

from paper_client import PaperClient
from r4_process import PATIENCE_S, Board

STATES, HEARTBEATS = 300, 5  # the numbers within three seconds


def test_the_papers_python_client_drives_the_board_without_a_safe_state():
    server_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    server_socket.bind(('127.0.0.1', 0))
    server_socket.setblocking(False)
    listens_at = server_socket.getsockname()[1]
    with Board(f'udp://127.0.0.1:0?peer=127.0.0.1:{listens_at}') as board:
        # In the board's URL, the options follow the port.
        address = ('127.0.0.1', int(board.url.split('?')[0].rsplit(':', 1)[1]))
        client = PaperClient(lambda data: client_socket.sendto(data, address))
        deadline = time.monotonic() + 2 * PATIENCE_S
        while len(client.states) < STATES or client.heartbeats < HEARTBEATS:
            assert time.monotonic() < deadline, (len(client.states), client.heartbeats)
            try:
                data = server_socket.recv(256)
            except OSError as error:
                assert error.errno == errno.EWOULDBLOCK
                continue
            client.take(data)
        log = board.rest()
    server_socket.close()
    client_socket.close()

    went_safe = [each for each in log if each.get('state') == 'SAFE']
    active = [each for each in log if each.get('state') == 'ACTIVE']
    print(f'{len(client.states)} states, {client.heartbeats} heartbeats, {client.pnum_sent} datagrams sent')
    assert not went_safe, went_safe[:3]
    assert active and any('outputs' in each for each in active)
    for state in client.states[-100:]:
        assert ';DHB1A:1000,1;' in state and ';SERVO1POS:300;' in state
        assert len(state) <= 256 - len('0x12345678^'), 'a state is longer than the 256 bytes that the client reads'
    outputs = [each['outputs'] for each in active if 'outputs' in each][-1]
    assert outputs['dhb'] == [[1000, 1], [1000, 0], [1000, 1], [1000, 0]]
    assert outputs['servo'][:3] == [298, 98, 1000]  # the nearest values that the chip can produce
