# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where SocketCAN exists: r4 bridge between UDP and a bus."""
from can_inside import EMERGENCY, Dump, ip
from r4_process import PATIENCE_S, Board, Running, driving, run


def test_a_udp_host_drives_a_bus_and_its_stop_reaches_every_board():
    with Board('can://vcan0?node=0-1', listens=2) as boards, \
            Running('bridge', 'udp://127.0.0.1:2100-2101', 'can://vcan0?node=0-1', '--json') as bridge:
        joined = [bridge.next(lambda each: each['type'] == 'bridge')['board'] for _ in range(2)]
        assert joined == ['can://vcan0?node=0', 'can://vcan0?node=1']
        with driving('udp://127.0.0.1:2101?listen=0', 'O:358,1,1'):
            boards.next(lambda each: each.get('board') == 'sim-1' and
                        each.get('executed', {}).get('command') == 'O:358,1,1')
            with Dump('vcan0') as dump:
                dump.more(1)
                stopped = run('stop', 'udp://127.0.0.1:2100?listen=0', timeout=3 * PATIENCE_S)
                assert stopped.returncode == 0, stopped.stderr
                assert [data for number, data in dump.frames if number == EMERGENCY]
            safe = set()  # the frame of the emergency stop is for all boards of the bus
            while safe != {'sim-0', 'sim-1'}:
                safe.add(boards.next(lambda each: each.get('reason') == 'stop')['board'])


def test_a_bridge_reports_a_missing_interface_and_waits_for_it():
    ip('link', 'add', 'vcan7', 'type', 'vcan')
    ip('link', 'set', 'vcan7', 'up')
    with Running('bridge', 'udp://127.0.0.1:0', 'can://vcan7', '--json') as bridge:
        def told(event):
            return bridge.next(lambda each: each['type'] == 'transport' and each['side'] == 'board' and
                               each['event'] == event)
        told('up')
        ip('link', 'del', 'vcan7')
        gone = told('down')
        assert 'vcan7' in gone['thing'] and gone['reason'] and gone['fix']
        ip('link', 'add', 'vcan7', 'type', 'vcan')
        ip('link', 'set', 'vcan7', 'up')
        told('up')
    ip('link', 'del', 'vcan7')
