# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 web as a program, and its clients: HTTP requests, byte for byte, and WebSockets by RFC 6455."""
import base64
import hashlib
import json
import os
import socket
import struct
import threading
import time

from r4_process import PATIENCE_S, Running

TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10


class Web(Running):
    def __init__(self, *urls, options=(), listen='127.0.0.1:0', **process):
        super().__init__('web', '--json', '--listen', listen, *options, *urls, **process)
        self.url = self.next(lambda each: each['type'] == 'listening')['url']
        self.port = int(self.url.split('/')[2].rsplit(':', 1)[1])

    def request(self, data):
        """Returns all bytes of the answer, until the server closes the connection."""
        with socket.create_connection(('127.0.0.1', self.port), PATIENCE_S) as connection:
            connection.sendall(data)
            answer = b''
            while part := connection.recv(65536):
                answer += part
            return answer

    def get(self, path, headers=''):
        """Returns the status, and the whole answer."""
        answer = self.request(f'GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nConnection: close\r\n{headers}\r\n'
                              .encode())
        return int(answer.split()[1]), answer

    def cpu_s(self):
        with open(f'/proc/{self.process.pid}/stat', encoding='ascii') as stat:
            return sum(map(int, stat.read().rpartition(')')[2].split()[11:13])) / os.sysconf('SC_CLK_TCK')

    def resident_kib(self):
        with open(f'/proc/{self.process.pid}/status', encoding='ascii') as status:
            return next(int(line.split()[1]) for line in status if line.startswith('VmRSS'))


class Refused(Exception):
    """The server refused the handshake. `status` is the status of the answer."""

    def __init__(self, status):
        super().__init__(f'the handshake was refused: {status}')
        self.status = status


def frame(data, opcode=TEXT):
    size = len(data)
    mask = os.urandom(4)
    head = bytes([0x80 | opcode])
    if size < 126:
        head += bytes([0x80 | size])
    elif size < 65536:
        head += struct.pack('>BH', 0x80 | 126, size)
    else:
        head += struct.pack('>BQ', 0x80 | 127, size)
    return head + mask + bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))


class WebSocket:
    def __init__(self, port, path='/live', protocols=('r4.web.v1',), buffer=None, **headers):
        self.socket = socket.socket()
        if buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(('127.0.0.1', port))
        key = base64.b64encode(os.urandom(16)).decode()
        sent = {'Host': f'127.0.0.1:{port}', 'Upgrade': 'websocket', 'Connection': 'Upgrade',
                'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': key,
                'Sec-WebSocket-Protocol': ', '.join(protocols), **headers}
        lines = ''.join(f'{name}: {value}\r\n' for name, value in sent.items())
        self.socket.sendall(f'GET {path} HTTP/1.1\r\n{lines}\r\n'.encode())
        self.file = self.socket.makefile('rb')
        status = int(self.file.readline().split()[1])
        answer = dict(line.decode().strip().lower().split(': ', 1) for line in iter(self.file.readline, b'\r\n'))
        if status != 101:
            self.socket.close()
            raise Refused(status)
        digest = hashlib.sha1(key.encode() + b'258EAFA5-E914-47DA-95CA-C5AB0DC85B11').digest()
        assert answer['sec-websocket-accept'] == base64.b64encode(digest).decode().lower()
        self.protocol = answer['sec-websocket-protocol']

    def send(self, data, opcode=TEXT):
        self.socket.sendall(frame(data, opcode))

    def receive(self):
        """Returns the opcode and bytes of the next message. Answers a ping, as browsers do."""
        while True:
            head = self.file.read(2)
            if len(head) < 2:
                raise ConnectionResetError('the server has closed the connection')
            assert head[0] & 0x80, 'the message is fragmented'
            size = head[1] & 127
            if size == 126:
                size, = struct.unpack('>H', self.file.read(2))
            elif size == 127:
                size, = struct.unpack('>Q', self.file.read(8))
            data = self.file.read(size)
            if head[0] & 15 == PING:
                self.send(data, PONG)
                continue
            return head[0] & 15, data

    def close(self):
        """Closes the connection without a farewell, as a killed browser does."""
        self.file.close()
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Page(WebSocket):
    """Acts as the page of r4 web: the page reads all the time. `newest`: the newest time that the page has received."""

    def __init__(self, web, **options):
        super().__init__(web.port, **options)
        self.messages = []
        self.newest = 0
        self.closed = None  # the reason, after the connection has closed
        self._news = threading.Condition()
        self._alive = None
        self._write = threading.Lock()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.hello = self.next('hello')

    def send(self, data, opcode=TEXT):
        with self._write:
            super().send(data, opcode)

    def say(self, **message):
        self.send(json.dumps(message).encode())

    def _read(self):
        try:
            while True:
                opcode, data = self.receive()
                if opcode == CLOSE:
                    raise ConnectionResetError(data[2:].decode())
                message = json.loads(data)
                message['came'] = time.monotonic()
                with self._news:
                    self.newest = message.get('now', self.newest)
                    self.messages.append(message)
                    self._news.notify_all()
        except (OSError, ValueError) as error:
            with self._news:
                self.closed = str(error)
                self._news.notify_all()

    def next(self, kind, is_it=lambda each: True, timeout=PATIENCE_S):
        """Returns the next message of that type for which `is_it` is true. Drops the earlier messages."""
        deadline = time.monotonic() + timeout
        with self._news:
            while True:
                for i, each in enumerate(self.messages):
                    if each['type'] == kind and is_it(each):
                        del self.messages[:i + 1]
                        return each
                assert self.closed is None, self.closed
                left = deadline - time.monotonic()
                assert left > 0, f'no {kind} of that kind within {timeout} s: {self.messages[-5:]}'
                self._news.wait(left)

    def until_closed(self):
        with self._news:
            assert self._news.wait_for(lambda: self.closed is not None, PATIENCE_S)
            return self.closed

    def states(self, count):
        """Returns `count` states of the first board, as dictionaries by field."""
        all_of_them = []
        while len(all_of_them) < count:
            for board in self.next('states')['boards']:
                if board['board'] == 0:
                    all_of_them += [dict(zip(['time', *self.hello['fields']], row)) for row in board['states']]
        return all_of_them

    def live(self):
        """Reports from now on that the page is alive, until freeze()."""
        if self._alive:
            self._alive.set()
        self._alive = threading.Event()
        ended = self._alive

        def repeat():
            while not ended.wait(0.1):
                try:
                    self.say(type='alive', now=self.newest)
                except OSError:
                    return
        threading.Thread(target=repeat, daemon=True).start()

    def freeze(self):
        """Stops reporting that the page is alive."""
        self._alive.set()

    def control(self):
        with self._news:  # drop the messages about an earlier time in control
            self.messages = [each for each in self.messages if each['type'] != 'control']
        self.say(type='control', want=True)
        self.live()
        return self.next('control', lambda each: each['you'] or each['why'])

    def ask(self, **message):
        number = time.monotonic_ns()
        self.say(request=number, **message)
        return self.next('result', lambda each: each['request'] == number)

    def drive(self):
        """Takes control, arms and drives the first board's first motor."""
        assert self.control()['you']
        self.next('board', lambda each: each['controlled'])
        assert self.ask(type='arm', board=0)['ok']
        result = self.ask(type='command', board=0, command='O:358,1,1')
        assert result['ok'], result

    def close(self):
        if self._alive:
            self._alive.set()
        self.socket.shutdown(socket.SHUT_RDWR)
        self._reader.join()
        super().close()

    def __exit__(self, *_):
        if self.closed is None:
            self.close()
