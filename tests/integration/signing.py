# SPDX-License-Identifier: GPL-3.0-or-later
"""A second implementation of authentication, written from docs/reference/protocol.md: Python's hashlib and a socket.

This implementation shares no code with r4.
"""
import base64
import hashlib
import re
import secrets
import socket
import time
import zlib


def closed(fields):
    """Appends the checksum to fields, each of which ends with a semicolon."""
    body = fields.encode() + b'^'
    return body + f'0x{zlib.crc32(body):x}^'.encode()


def tag_of(key, nonce, before):
    """The tag of a datagram. `before`: the bytes before the tag, including the comma."""
    host_to_board = hashlib.blake2s(b'R4 host to board', key=key).digest()
    digest = hashlib.blake2s(b'R4A1' + nonce.encode() + before.encode(), key=host_to_board,
                             digest_size=8).digest()
    return base64.urlsafe_b64encode(digest).decode().rstrip('=')


class SigningHost:
    """A host that signs its datagrams, on UDP."""

    def __init__(self, board_url, key_id, key):
        port = int(re.search(r':(\d+)', board_url.removeprefix('udp://')).group(1))
        self.address = ('127.0.0.1', port)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.key_id = key_id
        self.key = key
        self.session = secrets.token_hex(8)
        self.pnum = 4711
        self.counter = time.time_ns() // 1000
        self.nonce = None
        self.board_t = 0   # T of the newest datagram
        self.echo = 0      # T of the newest heartbeat; 0 while the board is connecting
        self.state = {}
        self.refused = []  # (PNum, code)
        self.reasons = []  # the reasons in the heartbeats, in the order of their arrival
        self.cause = 0  # the cause in the newest heartbeat

    def close(self):
        self.socket.close()

    def send(self, bytes_, other=None):
        (other or self.socket).sendto(bytes_, self.address)

    def fields(self, command, more=''):
        self.pnum += 1
        t = self.echo if command.startswith('H:') else time.time_ns() // 1000000
        return f'{command};{more}SID:{self.session};PNum:{self.pnum};T:{t};'

    def signed(self, fields, *, board_t=None, counter=None, key_id=None, key=None):
        self.counter = max(self.counter + 1, time.time_ns() // 1000)
        t = self.board_t if board_t is None else board_t
        before = f'{fields}A:{key_id or self.key_id},{counter or self.counter},{t},'
        return closed(before + tag_of(key or self.key, self.nonce, before) + ';')

    def command(self, command, more=''):
        """Sends a signed command, and returns the command's number and bytes."""
        bytes_ = self.signed(self.fields(command, more))
        self.send(bytes_)
        return self.pnum, bytes_

    def heartbeat(self):
        if self.nonce is None:  # an unsigned heartbeat requests the nonce
            bytes_ = closed(self.fields('H:ROS2-R4'))
        else:
            bytes_ = self.signed(self.fields('H:ROS2-R4'))
        self.send(bytes_)
        return bytes_

    def echo_of(self, heartbeat):
        """The T to echo in our next heartbeat. A heartbeat that reports CONNECTING has no T to echo (section 4.2)."""
        connecting = heartbeat['PNum'] == '0' and (heartbeat['T'] == '0' or 'AN' in heartbeat)
        return 0 if connecting else int(heartbeat['T'])

    def take(self, datagram):
        body, checksum = datagram.split(b'^')[:2]
        assert int(checksum, 16) == zlib.crc32(body + b'^'), datagram
        fields = dict(field.split(':', 1) for field in body.decode().split(';') if field)
        self.board_t = int(fields['T'])
        if 'H' in fields:
            self.nonce = fields.get('AN')
            self.echo = self.echo_of(fields)
            self.reasons.append(int(fields.get('SAFE', 0)))
            self.cause = int(fields.get('CAUSE', 0))
            self.heartbeat()
        elif 'N' in fields:
            number, code = fields['N'].split(',')
            self.refused.append((int(number), code))
        else:
            self.state.update(fields)

    def run(self, until=lambda: False, seconds=10.0, beats=True):
        """Keeps the link until `until()` is true. After `seconds`, returns False."""
        deadline = time.monotonic() + seconds
        next_beat = 0
        while not until():
            now = time.monotonic()
            if now >= deadline:
                return False
            if beats and now >= next_beat:
                self.heartbeat()
                next_beat = now + 0.1
            self.socket.settimeout(0.02)
            try:
                self.take(self.socket.recv(2048))
            except TimeoutError:
                pass
        return True

    def executed(self, number, seconds=10.0):
        """True if the board's state reports the command as executed."""
        return self.run(lambda: self.state.get('CMD') == str(number), seconds)

    def connect(self):
        assert self.run(lambda: self.nonce is not None and self.echo != 0 and self.state)
        number, _ = self.command('F:DEFAULT,SAFE,CMD')
        assert self.executed(number), 'the first command was not executed'
