# SPDX-License-Identifier: GPL-3.0-or-later
"""r4link.Bridge: a gateway in a Python program."""
import os
import pickle

import pytest

import r4link


def test_a_host_drives_the_board_behind_a_bridge():
    with r4link.Bridge('udp://127.0.0.1:0', 'sim:') as bridge:
        (status,) = bridge.status()
        assert status.hosts.up and status.board.name == 'sim:'
        with r4link.Board(status.hosts.name + '?listen=0') as board:
            board.wait_active()
            board.arm()
            board.osmc(1).set(0.1)
            board.stop()
        counters = bridge.status()[0].hosts.counters
        assert counters.passed > counters.stops >= 1
        assert counters.damaged == counters.kept_out == 0
    assert bridge.status()[0].hosts.counters.passed >= counters.passed, 'a closed bridge has lost its counters'
    bridge.close()


def test_a_bridge_refuses_urls_that_it_cannot_join():
    with pytest.raises(r4link.UsageError, match='both sides of the bridge are the same'):
        r4link.Bridge('can://can0', 'can://can0?node=1')
    with pytest.raises(r4link.UsageError, match='every program that reaches'):
        r4link.Bridge('udp://0.0.0.0:0', 'serial:///dev/r4-is-not-there')
    r4link.Bridge('udp://0.0.0.0:0', 'serial:///dev/r4-is-not-there', open=True).close()
    with r4link.Bridge('udp://127.0.0.1:0', 'sim:') as bridge:
        with pytest.raises(r4link.OpenError, match='in use'):
            r4link.Bridge(bridge.status()[0].hosts.name, 'sim:')


def test_a_bridge_with_a_key_passes_only_signed_commands(tmp_path):
    files = [tmp_path / 'a', tmp_path / 'b']
    for number, file in enumerate(files, 1):
        file.write_text(f'{number}:' + f'{number}' * 64)
        file.chmod(0o600)
    for key in (files[0], str(files[0]), files):
        r4link.Bridge('udp://0.0.0.0:0', 'serial:///dev/r4-is-not-there', key=key).close()
    with r4link.Bridge('udp://127.0.0.1:0', 'sim:', key=files[0]) as bridge:
        with pytest.raises(r4link.Error), r4link.Board(bridge.status()[0].hosts.name + '?listen=0') as board:
            board.wait_active(timeout=0.5)
        assert bridge.status()[0].hosts.counters.refused > 0


def test_a_bridge_is_closed_in_a_forked_process():
    with r4link.Bridge('udp://127.0.0.1:0', 'sim:') as bridge:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                bridge.status()
            except r4link.ClosedError as error:
                os.write(writing, pickle.dumps(str(error)))
            bridge.close()
            os._exit(0)
        os.close(writing)
        with os.fdopen(reading, 'rb') as pipe:
            told = pickle.loads(pipe.read())
        os.waitpid(child, 0)
        assert 'fork' in told
        assert bridge.status()[0].hosts.up
