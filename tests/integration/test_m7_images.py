# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of tools/m7 that run in virtual time or only measure: tests on the M7 itself, instructions and sizes."""
import importlib.machinery
import importlib.util
import json
import re

import pytest

from m7_board import M7, m7


def test_the_tests_that_run_on_the_m7_pass():
    result = m7('--test')
    print(result.stdout)
    assert result.returncode == 0, result
    names = re.findall(r'^passed (\S+)$', result.stdout, re.MULTILINE)
    assert 'FAILED' not in result.stdout and len(names) >= 20
    assert 'BoardState.StreamsAt1000HzOverUdpWithNothingLostOrLeftOut' in names
    assert 'Fault.AStackOverflowSwitchesOffAndIsNoted' in names
    assert int(re.search(r'stack of the tests: (\d+)', result.stdout)[1]) < 6144


def test_the_instruction_counts_match_the_table():
    result = m7('--instructions')
    print(result.stdout)
    assert result.returncode == 0, result
    assert m7('--instructions').stdout == result.stdout  # each run counts the same number of instructions


@pytest.fixture(name='tool')
def tool_as_a_module(tmp_path):
    """tools/m7 with a separate table: 1000 instructions, and 2000 with a bar of 2050."""
    loader = importlib.machinery.SourceFileLoader('m7_tool', M7)
    tool = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(tool)
    tool.ROOT, tool.TABLE = tmp_path, tmp_path / 'table.json'
    tool.TABLE.write_text(json.dumps({'plain': {'instructions': {'12': 1000}},
                                      'barred': {'instructions': {'12': 2000}, 'bar': 2050}}))
    tool.compiler = lambda: '12'
    return tool


@pytest.mark.parametrize('counts, good, word', [
    ({'plain': 1000, 'barred': 2000}, True, 'ok'),
    ({'plain': 1049, 'barred': 1}, True, 'ok'),
    ({'plain': 1051, 'barred': 2000}, False, 'worse: the table has 1000'),
    ({'plain': 1000, 'barred': 2051}, False, 'above its bar of 2050'),
    ({'plain': 1000, 'barred': 2000, 'new': 1}, False, 'not in the table'),
    ({'plain': 1000}, False, 'no longer measured'),
])
def test_the_check_fails_on_a_higher_new_or_missing_count(tool, capsys, counts, good, word):
    before = tool.TABLE.read_text()
    tool.measured = lambda: counts
    assert tool.instructions(update=False) == good
    assert word in capsys.readouterr().out
    assert tool.TABLE.read_text() == before


def test_only_the_bars_apply_to_a_compiler_without_a_table_entry(tool, capsys):
    tool.compiler = lambda: '13'
    tool.measured = lambda: {'plain': 3000, 'barred': 2049}
    assert tool.instructions(update=False)
    tool.measured = lambda: {'plain': 3000, 'barred': 2051}
    assert not tool.instructions(update=False)
    assert 'above its bar of 2050' in capsys.readouterr().out
    tool.measured = lambda: {'plain': 3000, 'barred': 2049}
    assert tool.instructions(update=True)
    assert json.loads(tool.TABLE.read_text())['plain'] == {'instructions': {'12': 1000, '13': 3000}}


def test_an_update_records_all_counts_unless_one_is_above_its_bar(tool):
    tool.measured = lambda: {'plain': 3000, 'barred': 2049, 'new': 7}
    assert tool.instructions(update=True)
    assert json.loads(tool.TABLE.read_text()) == {
        'plain': {'instructions': {'12': 3000}}, 'barred': {'instructions': {'12': 2049}, 'bar': 2050},
        'new': {'instructions': {'12': 7}}}
    tool.measured = lambda: {'plain': 3000, 'barred': 2051, 'new': 7}
    assert not tool.instructions(update=True)


def test_flash_ram_and_stacks_are_within_their_bars():
    result = m7('--size')
    print(result.stdout)
    assert result.returncode == 0, result
    assert len(re.findall(r'^portable code, .* ok$', result.stdout, re.MULTILINE)) == 2  # flash and RAM; stacks


@pytest.mark.parametrize('arguments, code, words', [
    (['--udp', '0'], 2, ['--udp 0', 'not a valid port']),
    (['--nothing'], 2, ['--nothing']),
    (['--update'], 2, ['--instructions']),
])
def test_wrong_options_are_refused_with_a_fix(arguments, code, words):
    result = m7(*arguments)
    assert result.returncode == code
    assert re.match(r'tools/m7: m7: .+\n  fix: .+\n$', result.stderr), result.stderr
    assert all(word in result.stderr for word in words)
