# SPDX-License-Identifier: GPL-3.0-or-later
"""Transports of your own: a subclass of Transport moves datagrams, and CanTransport takes any bus
of python-can.

open(), send() and close() run on a thread of their own, and may wait, because the link continues meanwhile.

The heartbeats on such a transport need the interpreter. If a program keeps the interpreter busy for
a second, the link is lost, and the board goes safe.

If a method raises, the transport is down, and on_event() reports the exception. If the transport
was open, close() is called. Then open() is called five times a second until it returns.
"""
from __future__ import annotations

import importlib
import threading
import time
from typing import Any, Callable

from .errors import UsageError

_BUS_PATIENCE = 0.1  # seconds that a frame may wait for the bus


class Transport:
    """Moves whole datagrams, of at most 1024 bytes of any content, to one board and back.

        class Radio(r4link.Transport):
            def open(self):
                self.modem = Modem()                     # it calls back on its own thread
                self.modem.on_packet = self.received
            def send(self, datagram):
                self.modem.transmit(datagram)
            def close(self):
                self.modem.close()

        with r4link.Board(Radio()) as board:
            ...

    An object serves one board at a time. Datagrams may be lost and reordered, as on UDP.
    """

    _receive: Callable[..., None] | None = None  # while the transport is open

    @property
    def name(self) -> str:
        """The name for people: board.name, and in errors."""
        return type(self).__name__

    def open(self) -> None:
        """Begins to receive. Opening a Board waits for the first call, without limit. If open() raises, the Board
        raises OpenError."""

    def send(self, datagram: bytes) -> None:
        """Sends one datagram. A later datagram waits for 100 ms at most, a stop without a limit."""
        raise NotImplementedError(f'{type(self).__name__} has no send()')

    def close(self) -> None:
        """Undoes open(). Not called after an open() that raised. Board.close() waits 1 s for this close()."""

    def received(self, datagram: bytes) -> None:
        """Call received() with each received datagram, from any thread. Does not wait. Does nothing while the transport
        is closed. Raises UsageError for more than 1024 bytes."""
        receive = self._receive
        if receive is not None:
            receive(memoryview(datagram).tobytes())

    def _open(self, receive: Callable[..., None]) -> None:
        if self._receive is not None:
            raise UsageError(self.name, 'the transport already carries another board',
                             'give each board a separate transport')
        self._receive = receive
        try:
            self.open()
        except BaseException:
            self._receive = None
            raise

    def _close(self) -> None:
        self._receive = None
        self.close()


class CanTransport(Transport):
    """A board on a CAN bus of python-can, on any of its interfaces (docs/reference/can.md):

        with can.Bus(interface='slcan', channel='/dev/ttyACM0', bitrate=1000000) as bus:
            with r4link.Board(r4link.CanTransport(bus, node=3)) as board:
                ...

    `bus`: a can.BusABC. `node`: the board's number on the bus, 0 to 31. `fd`: sends CAN FD frames.
    `pack`: sends and requests the packed form; False: text. The bus stays open when the board is
    closed. While the board is open, no other code may call bus.recv(). For an interface of Linux
    prefer its URL, can://can0, which does not need the interpreter.
    """

    def __init__(self, bus: Any, *, node: int = 1, fd: bool = False, pack: bool = True) -> None:
        self._can: Any = importlib.import_module('can')
        self.bus = bus
        self.node = node
        self.fd = fd
        self.pack = pack
        self._failure: Exception | None = None  # of the receiving thread
        self._ending = threading.Event()
        self._reader = threading.Thread()

    @property
    def name(self) -> str:
        """The name that python-can gives to the bus."""
        return str(self.bus.channel_info)

    def open(self) -> None:
        """Begins to receive from the bus."""
        self._failure = None
        self._ending.clear()
        self._reader = threading.Thread(target=self._read, name='r4link.CanTransport', daemon=True)
        self._reader.start()

    def close(self) -> None:
        """Leaves the bus."""
        self._ending.set()
        self._reader.join()

    def _read(self) -> None:
        try:
            while not self._ending.is_set():
                message = self.bus.recv(0.05)
                receive = self._receive
                if message is None or receive is None or not message.is_rx or message.is_error_frame or \
                        message.is_remote_frame:
                    continue
                receive(message.arbitration_id, bytes(message.data), message.is_extended_id, message.is_fd)
        except Exception as error:  # pylint: disable=broad-except
            self._failure = error  # raised at the next frame: a host sends about ten frames a second

    def _send_frame(self, can_id: int, data: bytes, extended: bool, fd: bool) -> None:
        if self._failure is not None:
            raise self._failure
        message = self._can.Message(arbitration_id=can_id, data=data, is_extended_id=extended, is_fd=fd,
                                    bitrate_switch=fd)
        deadline = time.monotonic() + _BUS_PATIENCE
        while True:
            try:
                self.bus.send(message, timeout=_BUS_PATIENCE)
                return
            except self._can.CanOperationError:  # the bus's queue is full
                if time.monotonic() >= deadline:
                    raise
                time.sleep(0.001)
