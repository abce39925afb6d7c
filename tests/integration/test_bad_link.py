# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 sim --link: the effects on the datagrams and on the link."""
from machine import within_ms
from r4_process import Board, is_link, is_state, monitor, run


def behind(link):
    return Board('udp://127.0.0.1:0', options=('--link', link))


def suffered(board):
    """The impairments of the received and of the sent datagrams, as the board reports them."""
    [told] = [each for each in board.rest() if each['type'] == 'impairment']
    return told['received'], told['sent']


def share(of, counters):
    came_in = counters['passed'] - counters['duplicated'] + counters['lost'] + counters['cut']
    return counters[of] / came_in


def test_loss_is_counted_and_commands_are_still_confirmed():
    with behind('loss=20%,seed=3') as board:
        assert run('send', board.host_url, 'R:1,On', 'O:358,1,1', '--timeout', '5').returncode == 0
        board.executed('O:358,1,1')
        with monitor(board.host_url) as host:
            host.next(is_link('active'))
            times = [host.next(is_state)['t'] for _ in range(80)]
        received, sent = suffered(board)
    assert 0.1 < share('lost', sent) < 0.3 and received['lost'] > 0, (received, sent)
    missing = (times[-1] - times[0]) / 10 + 1 - len(times)
    assert missing > 5, 'too few states were lost'
    assert sent['duplicated'] == sent['corrupted'] == sent['cut'] == sent['overflow'] == 0


def test_damaged_datagrams_are_reported_and_never_executed():
    with behind('corrupt=20%,seed=5') as board:
        assert run('send', board.host_url, 'R:1,On', 'O:358,1,1', '--timeout', '5').returncode == 0
        with monitor(board.host_url) as host:
            damaged = host.next(lambda each: each['type'] == 'error')
            host.next(is_state)
        received, sent = suffered(board)
        executed = [each['executed']['command'] for each in board.log if 'executed' in each]
    assert damaged['fields']['error'] in ('crc', 'syntax', 'length'), damaged
    assert 0.1 < share('corrupted', sent) < 0.3 and received['corrupted'] > 0, (received, sent)
    assert {each for each in executed if each[0] in 'DOPRSB'} == {'R:1,On', 'O:358,1,1'}


def test_the_board_is_safe_until_a_cut_of_the_link_ends():
    with behind('cut=1s+1.5s') as board, monitor(board.host_url) as host:
        host.next(is_link('active'))
        safe = board.state('SAFE', 'link')
        assert safe['silence'] <= within_ms(1020)
        host.next(is_link('active'))
        board.state('ACTIVE')
        host.skip_past()
        host.next(is_state)
        assert host.end() == 0
        received, sent = suffered(board)
    assert received['cut'] > 10 and sent['cut'] > 10, (received, sent)
    assert received['lost'] == sent['lost'] == 0
