# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's Python client, as the paper's section 8.6 describes it. The client uses only plain text."""
import time
import zlib


class PaperClient:
    """As printed: T precedes PNum, from the client's clock in whole seconds. hex() formats the checksum.
    The client answers each heartbeat, and sends seven commands for each received datagram. It sends from
    one socket and listens on another. For the heartbeat, the paper calls a function appendMsg that the
    paper does not define. Here sendMsg replaces appendMsg. `send` takes the bytes of a datagram."""

    def __init__(self, send):
        self.send = send
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
        self.send(message.encode())

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
