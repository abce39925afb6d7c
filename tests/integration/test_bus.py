# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 bus: the table, the JSON, the warning, the exit codes, and the numbers of docs/how-to/can.md."""
import math
import os
import re

import pytest

from r4_process import ERROR, objects, run

DATA_BAD, USAGE = 1, 2
DOCS = os.path.join(os.path.dirname(__file__), '..', '..', 'docs')


def planned(*arguments):
    """Returns the rows of a plan by name, and the ended process."""
    result = run('bus', '--json', *arguments)
    return {each['name']: each for each in objects(result.stdout) if 'name' in each}, result


def test_eight_boards_fit_in_the_packed_form_but_not_in_plain_text():
    rows, result = planned()
    assert result.returncode == 0 and result.stderr == '' and rows['total']['packed'] is True
    assert rows['total']['boards'] == 8 and rows['total']['fits'] is True
    assert rows['total']['load'] < 0.6 and rows['total']['worst_load'] < 0.8
    rows, result = planned('--plain')
    assert result.returncode == DATA_BAD and ERROR.search(result.stderr) and '--plain' in result.stderr
    assert rows['total']['load'] > 2 and rows['total']['fits'] is False
    assert objects(result.stdout)[-1]['type'] == 'error'
    rows, result = planned('--plain', '--boards', '2')
    assert result.returncode == 0 and rows['total']['fits'] is True


def test_the_rows_add_up_to_the_total():
    rows, _ = planned('--boards', '3', '--commands', '5', '--rate', '40')
    total = rows.pop('total')
    assert list(rows) == ['state', 'board heartbeat', 'host heartbeat', 'command']
    assert [rows[name]['datagrams'] for name in rows] == [120, 6, 30, 15]
    for key in ('datagrams', 'frames', 'bits', 'load', 'worst_load'):
        assert math.isclose(total[key], sum(row[key] for row in rows.values())), key
    assert math.isclose(total['load'], total['bits'] / total['bitrate'], rel_tol=1e-9)


def test_can_fd_lowers_the_load():
    classic, _ = planned('--boards', '4')
    fd, _ = planned('--boards', '4', '--fd', '--dbitrate', '8000000')
    assert fd['total']['load'] < classic['total']['load'] and fd['total']['dbitrate'] == 8000000


def test_r4_bus_warns_above_a_load_of_80_percent():
    result = run('bus', '--boards', '13')
    assert result.returncode == 0
    assert re.fullmatch(r'r4: warning: the bus: .+; .+\n', result.stderr)
    assert run('bus', '--boards', '11').stderr == ''


@pytest.mark.parametrize('arguments, words', [
    (['--boards', '0'], 'write 1 to 32'),
    (['--boards', '33'], 'write 1 to 32'),
    (['--rate', '1001'], 'write 1 to 1000'),
    (['--bitrate', '2000000'], 'write 10000 to 1000000'),
    (['--fields', 'AIN99'], 'this is not a list of state fields'),
    (['--dbitrate', '5000000'], 'add --fd'),
    (['--fd', '--dbitrate', '500000'], 'below the nominal'),
    (['can0'], 'a transport and a colon'),
    (['udp://192.168.1.77'], 'such as can://can0'),
    (['can://can0?node=1'], 'write can://can0'),
    (['can://can0:5'], 'such as can://can0'),
    ([''], 'a transport and a colon'),
    (['can://can0', '--boards', '2'], '--boards: cannot be combined with URL; leave out one of the two'),
    (['can://can0', '--bitrate', '500000', '--dbitrate', '250000'], 'below the nominal'),
    (['--duration', '2'], 'as in can://can0'),
])
def test_wrong_options_are_refused_with_a_fix(arguments, words):
    result = run('bus', *arguments)
    assert result.returncode == USAGE and result.stdout == ''
    assert ERROR.search(result.stderr) and words in result.stderr


def test_the_documentation_shows_the_printed_output():
    with open(os.path.join(DOCS, 'how-to', 'can.md'), encoding='utf-8') as file:
        text = file.read()
    examples = re.findall(r'^    \$ r4 bus(?! can:)(.*)\n((?:    .*\n|\n(?=    (?!\$)))*)', text, re.MULTILINE)
    assert examples
    for arguments, shown in examples:
        printed = run('bus', *arguments.split())
        lines = [line.removeprefix('    ').rstrip() for line in shown.rstrip('\n').split('\n')]
        assert lines == [line.rstrip() for line in (printed.stdout + printed.stderr).rstrip('\n').split('\n')]
