# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: a board on two buses, one of which fails, and a board on
a bus and a cable."""
import contextlib
import fcntl
import signal
import socket
import struct

from can_inside import PATIENTLY, ip
from r4_process import Board, run
from slcan_bus import SlcanBus
from host_on_paths import HostOnPaths, Relay, has_joined, has_left

SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP = 0x8913, 0x8914, 1


def switch(interface, up):
    """Sets the flag by ioctl, because the guest takes a quarter of a second to start a program."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = bytearray(struct.pack('16s24x', interface.encode()))
        fcntl.ioctl(any_socket, SIOCGIFFLAGS, request)
        flags, = struct.unpack_from('=H', request, 16)
        struct.pack_into('=H', request, 16, flags | IFF_UP if up else flags & ~IFF_UP)
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, request)


@contextlib.contextmanager
def one_bus(bus):
    ip('link', 'add', bus, 'type', 'vcan')
    ip('link', 'set', bus, 'up')
    try:
        yield bus
    finally:
        ip('link', 'delete', bus)


def test_a_session_survives_the_loss_of_its_cable_or_its_bus(tmp_path_factory):
    folder = tmp_path_factory.mktemp('paths')
    with one_bus('vcan8') as bus, \
            Board(f'pty:{folder}/board', f'can://{bus}?node=3', options=PATIENTLY) as board:
        cable = Relay('pty', f'{folder}/host', f'{folder}/board')
        try:
            with HostOnPaths([cable.url, f'can://{bus}?node=3'], ['/host', bus]) as host:
                board.next(has_joined(2))
                for place, away, back in (('/host', cable.pull, cable.plug_in),
                                          (bus, lambda: switch(bus, up=False), lambda: switch(bus, up=True))):
                    host.loses(place, away)
                    board.next(has_left(1))
                    host.has_again(place, back)
                    board.next(has_joined(2))
                # When the stopped cable resumes, it delivers old states.
                host.loses_by_silence('/host', lambda: cable.signal(signal.SIGSTOP))
                board.next(has_left(1))
                host.has_again('/host', lambda: cable.signal(signal.SIGCONT))
                board.next(has_joined(2))
                host.ends(board)
        finally:
            cable.pull()


def test_a_stop_over_a_bus_and_the_network_must_reach_one_board():
    with one_bus('vcan8') as bus, Board('udp://127.0.0.1:0', f'can://{bus}?node=3', options=PATIENTLY) as board:
        stopped = run('stop', board.host_url, f'can://{bus}?node=3', timeout=60)
        assert stopped.returncode == 0, stopped
        with Board(f'can://{bus}?node=4', options=PATIENTLY):
            stopped = run('stop', board.host_url, f'can://{bus}?node=4', timeout=60)
            assert stopped.returncode == 3 and 'two boards' in stopped.stderr, stopped


def test_a_session_survives_bus_off_at_the_board_or_at_the_host():
    """can0 and can1 are one bus. The ends of the other bus have error counters and bus-off."""
    boards, hosts = (('can0', 'slcan0'), ('can1', 'slcan1'))
    with SlcanBus() as bus, \
            Board(*(f'can://{each}?node=3' for each in boards), options=PATIENTLY) as board, \
            HostOnPaths([f'can://{each}?node=3' for each in hosts], [f'//{each}?' for each in hosts]) as host:
        board.next(has_joined(2))

        def spoil(node):
            bus.order('spoil', node)
            bus.state(node, 'bus-off')

        def heal(node):
            bus.order('heal', node)
            switch(f'slcan{node}', up=False)  # the kernel sometimes needs more than a second for the switch
            return lambda: switch(f'slcan{node}', up=True)

        host.loses('//slcan1', lambda: spoil(1))
        board.next(has_left(1))
        host.has_again('//slcan1', heal(1))
        board.next(has_joined(2))
        # The board's end of the bus is off, which the host cannot detect.
        host.loses_by_silence('//slcan1', lambda: spoil(0))
        board.next(has_left(1))
        host.has_again('//slcan1', heal(0))
        board.next(has_joined(2))
        host.ends(board)
