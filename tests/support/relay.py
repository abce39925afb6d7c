# SPDX-License-Identifier: GPL-3.0-or-later
"""A path between a host and a board, as a process. A test disturbs the path by signals to the process.

    relay.py udp PORT         from a new port on 127.0.0.2 to the port of the board on 127.0.0.1
    relay.py pty LINK DEVICE  from a new pty, to which LINK points, to the pty of the board

If the process is killed, the path is unplugged. The system reports this at once for a pty, and never for UDP.
While the process is stopped (SIGSTOP), the path delivers nothing. When the process resumes, it delivers old datagrams.
Prints the URL for a host as soon as the path works.
"""
import os
import select
import socket
import sys
import tty


def udp(port):
    hosts = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    hosts.bind(('127.0.0.2', 0))
    board = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    board.connect(('127.0.0.1', int(port)))
    print(f'udp://127.0.0.2:{hosts.getsockname()[1]}?listen=0', flush=True)
    host = None
    while True:
        for ready in select.select([hosts, board], [], [])[0]:
            if ready is hosts:
                datagram, host = hosts.recvfrom(2048)
                board.send(datagram)
            elif host:
                hosts.sendto(board.recv(2048), host)
            else:
                board.recv(2048)


def pty(link, device):
    host, own = os.openpty()  # `own` stays open, because a host may disconnect and reconnect
    tty.setraw(own)
    board = os.open(device, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(board)
    if os.path.islink(link):
        os.unlink(link)
    os.symlink(os.ttyname(own), link)
    print(f'serial://{link}', flush=True)
    while True:
        for ready in select.select([host, board], [], [])[0]:
            os.write(board if ready == host else host, os.read(ready, 4096))


if __name__ == '__main__':
    try:
        {'udp': udp, 'pty': pty}[sys.argv[1]](*sys.argv[2:])
    except OSError as error:
        sys.exit(f'the path has no other end any more: {error}')
