# SPDX-License-Identifier: GPL-3.0-or-later
"""What test_can_wires.py runs where SocketCAN is: a board on two buses, of which either is switched off."""
import contextlib
import subprocess
import time

from r4_process import Board, Running, is_state, monitor, run

BUSES = ('vcan8', 'vcan9')
URLS = [f'can://{bus}?node=3' for bus in BUSES]
REPORTED_WITHIN_S, BACK_WITHIN_S = 0.05, 1
# The guest emulates its processor.
SLOWER = 4


def ip(*arguments):
    subprocess.run(['ip', *arguments], check=True)


@contextlib.contextmanager
def two_buses():
    for bus in BUSES:
        ip('link', 'add', bus, 'type', 'vcan')
        ip('link', 'set', bus, 'up')
    try:
        yield
    finally:
        for bus in BUSES:
            ip('link', 'delete', bus)


def of_wire(bus, carries):
    return lambda each: (each['type'] == 'wire' and bus in each['fields']['name'] and
                         (each['fields']['state'] == 'carrying') == carries)


def has_joined(wires):
    """The board has so many wires to its host, with one that it did not have."""
    return lambda each: each.get('wire', {}).get('event') == 'joined' and each['wire']['wires'] == wires


def test_either_of_two_buses_is_switched_off_and_nothing_is_missed():
    with two_buses(), Board(*URLS) as board, monitor('+'.join(URLS)) as host:
        for bus in BUSES:
            if not any(of_wire(bus, True)(each) for each in host.log):
                host.next(of_wire(bus, True))
        board.next(has_joined(2))
        began = host.next(is_state)['came']
        for bus in BUSES:
            ip('link', 'set', bus, 'down')
            down = time.monotonic()
            lost = host.next(of_wire(bus, False))['came'] - down
            ip('link', 'set', bus, 'up')
            up = time.monotonic()
            back = host.next(of_wire(bus, True))['came'] - up
            board.next(has_joined(2))
            print(f'{bus}: told of it after {lost * 1e3:.0f} ms, used again after {back * 1e3:.0f} ms')
            assert lost <= SLOWER * REPORTED_WITHIN_S and back <= SLOWER * BACK_WITHIN_S
        for _ in range(20):
            host.next(is_state)
        states = [each for each in host.log if is_state(each) and each['came'] >= began]
        gap = max(later['came'] - earlier['came'] for earlier, later in zip(states, states[1:]))
        times = [each['t'] for each in states]
        print(f'longest gap between states {gap * 1e3:.0f} ms')
        assert times == sorted(set(times)) and gap < 0.5
        board.never('SAFE', 0.1)


def test_commands_are_executed_once_each_while_buses_come_and_go():
    commands = [f'S:{1000 + i},{i % 16 + 1}' for i in range(120)]
    with two_buses(), Board(*URLS) as board:
        with Running('send', *URLS, *commands, '--json', '--hold', '60', '--timeout', '5') as host:
            def confirmed(several):
                for command in several:
                    result = host.next()
                    assert result['command'] == command and result['confirmed'], result

            board.next(has_joined(2))
            for i, bus in enumerate(BUSES):
                confirmed(commands[40 * i:40 * i + 20])
                ip('link', 'set', bus, 'down')
                confirmed(commands[40 * i + 20:40 * i + 40])
                ip('link', 'set', bus, 'up')
                board.next(has_joined(2))  # before that there is only one, which must not go
            confirmed(commands[80:])
        executed = [each['executed']['command'] for each in board.rest() if 'executed' in each]
    assert [each for each in executed if each.startswith('S:')] == commands


def test_a_stop_by_either_bus_is_enough():
    with two_buses(), Board(*URLS) as board:
        assert run('send', *URLS, 'S:1500,1', timeout=60).returncode == 0
        ip('link', 'set', BUSES[0], 'down')
        assert run('stop', *URLS, timeout=60).returncode == 0
        board.state('SAFE', 'stop')
