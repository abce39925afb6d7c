# SPDX-License-Identifier: GPL-3.0-or-later
"""Clients of r4 web that send damaged requests and frames, send slowly or send only a part, and never read.

    python3 hostile_clients.py PORT SEED SECONDS        prints the number of clients
"""
import contextlib
import random
import socket
import sys
import threading
import time

from web_client import CLOSE, frame


def hostile_bytes(rng, port):
    """A damaged request, or damaged frames of a client."""
    handshake = (f'GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
                 'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n'
                 'Sec-WebSocket-Protocol: r4.web.v1\r\n\r\n').encode()
    frames = b''.join(frame(each, opcode) for each, opcode in (
        (b'{"type":"control","want":false}', 1), (b'x' * 200, 9), (b'{"type":"alive","now":5}', 1), (b'\x03\xe8', CLOSE)))
    data = bytearray(rng.choice([handshake, handshake + frames, handshake + frames,
                                 b'GET / HTTP/1.1\r\nHost: localhost\r\n\r\n' * 3,
                                 b'POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n',
                                 b'GET /' + b'a' * 9000, b'GET / HTTP/1.1\r\n' + b'a: b\r\n' * 2000,
                                 b'POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nffffffff\r\n',
                                 rng.randbytes(300)]))
    for _ in range(rng.randrange(4)):
        at = rng.randrange(len(data))
        data[at:at + rng.randrange(3)] = rng.randbytes(rng.randrange(3))
    return bytes(data[:rng.randrange(len(data) + 1)] if rng.random() < 0.2 else data)


def attack(port, rng, until, done):
    held = []  # half open: these clients neither send nor read
    while time.monotonic() < until:
        with contextlib.suppress(OSError):
            connection = socket.create_connection(('127.0.0.1', port), 1)
            connection.settimeout(0.05)
            held.append(connection)
            data = hostile_bytes(rng, port)
            if rng.random() < 0.1:  # send slowly
                for i in range(min(len(data), 20)):
                    connection.sendall(data[i:i + 1])
            else:
                connection.sendall(data)
            if rng.random() < 0.3:
                connection.recv(100)
            done.append(1)
        while len(held) > 8 or (held and rng.random() < 0.5):
            held.pop(rng.randrange(len(held))).close()


def main():
    port, seed, seconds = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    until = time.monotonic() + seconds
    done = []
    attackers = [threading.Thread(target=attack, args=(port, random.Random(seed * 100 + number), until, done))
                 for number in range(4)]
    for each in attackers:
        each.start()
    for each in attackers:
        each.join()
    print(len(done))


if __name__ == '__main__':
    main()
