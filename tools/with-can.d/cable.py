# SPDX-License-Identifier: GPL-3.0-or-later
"""The USB cable between the guest's serial port and a tty or a Unix socket here.

The port is a USB device of QEMU, which is plugged in while its socket has a connection. So this module connects and
disconnects, and copies the bytes. While the socket has no connection, bytes from the far end are lost, as with an
unplugged cable.
"""
import os
import secrets
import socket
import stat
import threading
import tty

from trouble import Trouble

FIX = 'give a tty (r4 sim pty:PATH serves one) or a Unix socket on which somebody listens'
SERIAL_NUMBER = 'R4-0001'


def far_end(path):
    """Opens the far end; returns its descriptor."""
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISCHR(mode):
            terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
            if os.isatty(terminal):
                tty.setraw(terminal)
                return terminal
            os.close(terminal)
        if stat.S_ISSOCK(mode):
            connected = socket.socket(socket.AF_UNIX)
            connected.connect(path)
            return connected.detach()
    except OSError as error:
        raise Trouble(path, error.strerror, FIX) from error
    raise Trouble(path, 'it is neither a tty nor a socket', FIX)


class Cable:
    """The cable, which is unplugged at first."""

    def __init__(self, path):
        self._far = far_end(path)
        self._name = f'\0r4-usb-{secrets.token_hex(16)}'
        self.listener = socket.socket(socket.AF_UNIX)  # QEMU connects to it
        self.listener.bind(self._name)
        self.listener.listen(1)
        self._near = None
        self._lock = threading.Lock()
        threading.Thread(target=self._from_far_end, daemon=True).start()

    def arguments(self):
        """The arguments of QEMU for its end."""
        return ['-device', 'qemu-xhci', '-chardev', f'socket,id=usb,fd={self.listener.fileno()},server=on,wait=off',
                '-device', f'usb-serial,chardev=usb,serial={SERIAL_NUMBER}']

    def plug(self):
        near = socket.socket(socket.AF_UNIX)
        near.connect(self._name)
        with self._lock:
            self._near = near
        threading.Thread(target=self._to_far_end, args=(near,), daemon=True).start()

    def unplug(self):
        with self._lock:
            near, self._near = self._near, None
        if near:
            near.shutdown(socket.SHUT_RDWR)

    def _from_far_end(self):
        try:
            while read := os.read(self._far, 65536):
                with self._lock:
                    near = self._near
                try:
                    if near:
                        near.sendall(read)
                except OSError:
                    pass  # unplugged meanwhile
        except OSError:
            pass  # the far end has ended

    def _to_far_end(self, near):
        try:
            while read := near.recv(65536):
                while read:
                    read = read[os.write(self._far, read):]
        except OSError:
            pass  # an end is closed
        near.close()
