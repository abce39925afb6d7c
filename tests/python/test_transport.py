# SPDX-License-Identifier: GPL-3.0-or-later
"""Transports that a program defines: r4link.Transport and r4link.CanTransport (docs/how-to/python.md)."""
import asyncio
import gc
import os
import socket
import subprocess
import sys
import threading
import weakref

import can
import pytest

import r4link
import can_python  # from tests/integration, by conftest.py


class Forward(r4link.Transport):
    """A transport to a board on UDP."""

    def __init__(self, url):
        self.address = url.split('//')[1].split('?')[0].split(':')
        self.failure = None
        self.closings = 0

    def open(self):
        if self.failure:
            raise self.failure
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((self.address[0], int(self.address[1])))
        self.reader = threading.Thread(target=self.read)
        self.reader.start()

    def send(self, datagram):
        if self.failure:
            raise self.failure
        assert isinstance(datagram, bytes)
        self.socket.send(datagram)

    def close(self):
        self.closings += 1
        self.socket.shutdown(socket.SHUT_RDWR)
        self.reader.join()
        self.socket.close()

    def read(self):
        while datagram := self.socket.recv(1024):
            self.received(datagram)


@pytest.fixture(name='forward')
def to_a_simulated_board():
    with r4link.SimBoard('udp://127.0.0.1:0') as simulated:
        yield Forward(simulated.url)


class Silent(r4link.Transport):
    """A transport without a board at its other end."""

    def send(self, datagram):
        pass


def test_a_board_is_driven_and_stopped_over_a_user_transport(forward):
    with r4link.Board(forward) as board:
        board.wait_active()
        assert board.name == 'Forward'
        board.arm()
        board.osmc(1).set_pwm(358)
        board.stop()
        counters = board.carrier_counters
        assert counters.tx_datagrams > 2 and counters.rx_datagrams > 2 and counters.ups == 1
        assert forward.closings == 0
    assert forward.closings == 1


def test_a_user_transport_is_one_of_several_paths(forward):
    with r4link.Board([forward, Silent()]) as board:
        board.wait_active()
        assert [path.name for path in board.paths] == ['Forward', 'Silent']
    with pytest.raises(r4link.UsageError, match='transports only'):
        r4link.Board([forward, 'sim:'])


def test_opening_a_board_raises_the_error_of_the_first_open(forward):
    forward.failure = ValueError('no modem')
    with pytest.raises(r4link.OpenError) as raised:
        r4link.Board(forward)
    assert raised.value.thing == 'Forward' and raised.value.reason == 'the transport raised ValueError: no modem'
    assert forward.closings == 0
    forward.failure = None
    with r4link.Board(forward) as board:
        board.wait_active()


def test_a_transport_without_send_is_reported(wait):
    events = []
    with r4link.Board(r4link.Transport()) as board:
        board.on_event(events.append)
        wait(lambda: any('Transport has no send()' in event.reason for event in events))


def test_a_send_that_raises_is_reported_and_the_path_recovers(forward, wait):
    events = []
    with r4link.Board(forward) as board:
        board.on_event(events.append)
        board.wait_active()
        forward.failure = OSError(19, 'No such device')
        wait(lambda: any(event.kind is r4link.EventKind.DOWN for event in events))
        assert events[-1].reason == 'the transport raised OSError: [Errno 19] No such device'
        wait(lambda: board.link.state is not r4link.LinkState.ACTIVE)
        forward.failure = None
        board.wait_active(5)
    assert forward.closings == 2


def test_a_transport_receives_datagrams_from_any_thread(wait):
    transport = Silent()
    transport.received(b'nobody listens')
    with r4link.Board(transport) as board:
        threads = [threading.Thread(target=lambda: [transport.received(os.urandom(100)) for _ in range(100)])
                   for _ in range(4)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        wait(lambda: board.carrier_counters.rx_datagrams + board.carrier_counters.rx_overflows == 400)
        transport.received(bytearray(1024))
        with pytest.raises(r4link.UsageError, match='1025 bytes'):
            transport.received(bytes(1025))
        for wrong in ('text', 5, None):
            with pytest.raises(TypeError):
                transport.received(wrong)
    transport.received(b'nobody listens')


def test_a_transport_serves_one_board_at_a_time():
    transport = Silent()
    with r4link.Board(transport):
        with pytest.raises(r4link.OpenError, match='another board'):
            r4link.Board(transport)
    r4link.Board(transport).close()


def test_a_collected_board_closes_its_transport(forward):
    board = r4link.Board(forward)
    board.wait_active()
    gone = weakref.ref(board)
    del board
    gc.collect()
    assert gone() is None and forward.closings == 1


@pytest.mark.parametrize('method', ['send', 'close'])
def test_the_methods_of_a_transport_may_close_the_board(method):
    closed = threading.Event()
    opened = threading.Event()

    class Closes(Silent):
        def act(self, *_):
            opened.wait(10)
            board.close()
            closed.set()

    setattr(Closes, method, Closes.act)
    board = r4link.Board(Closes())
    opened.set()
    if method == 'close':
        board.close()
    assert closed.wait(10)


def test_a_blocked_send_does_not_block_other_calls():
    sending, released = threading.Event(), threading.Event()

    class Waits(Silent):
        def send(self, datagram):
            sending.set()
            released.wait()

    board = r4link.Board(Waits())
    board.post(r4link.Command.stop())
    assert sending.wait(10)
    assert board.link.state is r4link.LinkState.CONNECTING
    board.close()  # returns although send() waits
    released.set()


@pytest.mark.parametrize('send', ['pass', 'raise OSError("gone")', 'time.sleep(0.3)', 'board.stop_async()',
                                  'while True: time.sleep(0.0005)'])
def test_the_interpreter_may_end_with_an_open_transport(send):
    program = f"""
import sys, threading, time, r4link
sent = threading.Event()
class Own(r4link.Transport):
    def open(self):
        threading.Thread(target=self.read, daemon=True).start()
    def send(self, datagram):
        sent.set()
        {send}
    def read(self):
        while True:
            self.received(bytes(10))
board = r4link.Board(Own())
sent.wait(10)
"""
    ended = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, timeout=30, check=False)
    assert (ended.returncode, ended.stderr) == (0, '')


def test_asyncio_drives_a_board_over_a_user_transport(forward):
    async def drive():
        async with r4link.aio.Board(forward) as board:
            await board.wait_active()
            await board.arm()
            await board.osmc(1).set(0.1)

    asyncio.run(drive())


# --- CAN: a bus of python-can in this process, with the board of the integration tests at its other end


@pytest.fixture(name='bus')
def a_bus(request):
    with can.Bus(interface='virtual', channel=request.node.name) as bus:
        yield bus


@pytest.fixture(name='can_board')
def a_board_on_the_bus(request):
    with can_python.Board(can.Bus(interface='virtual', channel=request.node.name), 3) as board:
        yield board


def test_a_board_is_driven_over_a_python_can_bus(bus, can_board):
    with r4link.Board(r4link.CanTransport(bus, node=3), arming=False) as board:
        board.wait_active(5)
        assert board.name.endswith(', node 3')
        board.osmc(1).set_pwm(358)
        assert can_board.osmc == '358,1'
        board.stop()
        assert can_board.stops > 0 and can_board.heard_packed
    bus.send(can.Message())  # the bus remains open


def test_a_can_transport_waits_while_its_queue_is_full(bus, can_board, monkeypatch):
    refusals = [can.CanOperationError('Transmit buffer full')] * 3
    send = bus.send

    def refuse(message, timeout):
        assert 0 < timeout < 1
        if refusals:
            raise refusals.pop()
        send(message, timeout)

    monkeypatch.setattr(bus, 'send', refuse)
    with r4link.Board(r4link.CanTransport(bus, node=3)) as board:
        board.wait_active(5)
        assert board.carrier_counters.downs == 0 and not refusals and can_board.osmc


@pytest.mark.parametrize('method', ['send', 'recv'])
def test_a_failed_can_bus_is_reported_and_recovers(bus, wait, monkeypatch, method):
    def fail(*_, **__):
        raise OSError('adapter unplugged')

    events = []
    with r4link.Board(r4link.CanTransport(bus)) as board:
        board.on_event(events.append)
        with monkeypatch.context() as unplugged:
            unplugged.setattr(bus, method, fail)
            wait(lambda: any(event.kind is r4link.EventKind.DOWN for event in events))
            assert events[-1].reason == 'the transport raised OSError: adapter unplugged'
        wait(lambda: events[-1].kind is r4link.EventKind.UP)


@pytest.mark.parametrize('node', [-1, 32])
def test_a_node_out_of_range_is_refused(bus, node):
    with pytest.raises(r4link.UsageError, match='0 to 31'):
        r4link.Board(r4link.CanTransport(bus, node=node))
