# SPDX-License-Identifier: GPL-3.0-or-later
"""The texts of r4 about itself: help, version, completion, manual pages."""
import os
import re
import subprocess
import tempfile

import pytest

from r4_process import DATA, objects, run

COMMANDS = ['monitor', 'send', 'stop', 'list', 'doctor', 'bridge', 'bus', 'bench', 'record', 'info', 'convert', 'plot',
            'replay', 'metrics', 'web', 'ros2', 'sim', 'key', 'demo', 'encode', 'decode', 'completion', 'man', 'devices',
            'upload', 'wiring', 'commission']


def test_the_option_version_prints_the_version():
    result = run('--version')
    assert result.returncode == 0 and re.fullmatch(r'r4 \d+\.\d+\.\d+\n', result.stdout)


def test_help_names_every_command_url_and_exit_code():
    result = run('--help')
    assert result.returncode == 0 and result.stderr == ''
    commands = result.stdout.split('\nCommands:\n')[1].split('\n\n')[0]
    assert re.findall(r'^  (\S+) +\S', commands, re.MULTILINE) == COMMANDS
    for word in ('udp://', 'serial:', 'pty:', 'sim:', 'Exit codes', 'r4 demo'):
        assert word in result.stdout


def test_the_command_reference_matches_the_help():
    with open(os.path.join(DATA, '..', '..', 'docs', 'reference', 'commands.md'), encoding='utf-8') as page:
        rows = re.findall(r'^\| `(\w+)` \| ([^|]*) \|', page.read(), re.MULTILINE)
    commands = run('--help').stdout.split('\nCommands:\n')[1].split('\n\n')[0]
    assert rows == re.findall(r'^  (\S+) +(\S.*)', commands, re.MULTILINE)


@pytest.mark.parametrize('command', COMMANDS)
def test_help_of_every_command_shows_usage_and_exit_codes(command):
    result = run(command, '--help')
    assert result.returncode == 0
    assert 'Usage: r4 ' + command in result.stdout and 'Exit codes' in result.stdout
    assert max(len(line) for line in result.stdout.splitlines()) <= 110


def test_an_option_of_one_meaning_has_one_name_in_all_commands():
    names = {}
    for command in COMMANDS:
        for name, meaning in re.findall(r'^  (-\S+)[^\n]*?  +(\S[^\n]*)$', run(command, '--help').stdout, re.MULTILINE):
            names.setdefault(meaning, set()).add(name)
    assert [each for each in names.values() if len(each) > 1] == []
    assert names['end after this time'] == {'--duration'}


def test_list_names_ports_and_urls():
    assert run('list').returncode == 0
    listed = objects(run('list', '--json').stdout)
    assert {'udp', 'serial', 'pty', 'sim'} <= {each.get('scheme') for each in listed}


def complete(*words):
    """The completions that bash offers for the last word."""
    script = '''
        source "$1"; shift
        COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
        _r4; printf '%s\\n' "${COMPREPLY[@]}"'''
    with tempfile.NamedTemporaryFile('w') as file:
        file.write(run('completion', 'bash').stdout)
        file.flush()
        result = subprocess.run(['bash', '-c', script, 'bash', file.name, *words],
                                capture_output=True, text=True, check=True)
    assert result.stderr == ''
    return result.stdout.split()


def test_bash_completes_commands_options_urls_and_files():
    assert complete('r4', 'mo') == ['monitor']
    assert set(COMMANDS) <= set(complete('r4', ''))
    assert complete('r4', 'monitor', '--js') == ['--json']
    assert {'--count', '--duration', '--fields', '--help'} <= set(complete('r4', 'monitor', '--'))
    assert complete('r4', 'sim', 'ud') == ['udp://']
    assert complete('r4', 'monitor', '--count', '') == []
    assert complete('r4', 'completion', '') == ['bash', 'zsh', 'fish']
    assert complete('r4', 'decode', DATA + '/paper_c') == [DATA + '/paper_capture.tsv']
    assert complete('r4', 'key', 'giv') == ['give']
    assert complete('r4', 'send', '--key', DATA + '/paper_c') == [DATA + '/paper_capture.tsv']
    assert complete('r4', 'sim', '--script', DATA + '/paper_c') == [DATA + '/paper_capture.tsv']


def test_fish_completes_commands_options_urls_and_files(tmp_path):
    script = tmp_path / 'r4.fish'
    script.write_text(run('completion', 'fish').stdout)

    def offered(*lines):
        """The words that fish offers at the end of each line."""
        asked = ''.join(f"complete -C '{line}'; echo; " for line in lines)
        result = subprocess.run(['fish', '--no-config', '-c', f'source {script}; {asked}'], capture_output=True, text=True,
                                check=True, env={**os.environ, 'HOME': str(tmp_path)})
        assert result.stderr == ''
        return [[word.split('\t')[0] for word in each.split('\n') if word]
                for each in result.stdout.split('\n\n')[:len(lines)]]

    commands, option, values, url, choices, path = offered(
        'r4 ', 'r4 monitor --co', 'r4 monitor --count ', 'r4 --json monitor ud', 'r4 completion ',
        f'r4 send --key {DATA}/paper_c')
    assert set(COMMANDS) <= set(commands) and 'udp://' not in commands
    assert option == ['--control', '--count']
    assert not {'monitor', '--json'} & set(values)
    assert url == ['udp://']
    assert sorted(choices) == ['bash', 'fish', 'zsh']
    assert path == [DATA + '/paper_capture.tsv']


@pytest.mark.parametrize('shell', ['bash', 'zsh', 'fish'])
def test_completion_scripts_are_valid_in_their_shell(shell):
    script = run('completion', shell).stdout
    assert all(command in script for command in COMMANDS)
    result = subprocess.run([shell, '-n', '/dev/stdin'], input=script, capture_output=True, text=True,
                            check=False)
    assert (result.returncode, result.stderr) == (0, '')


def test_manual_pages_match_the_help_and_pass_mandoc_lint(tmp_path):
    assert run('man', '--output', str(tmp_path)).returncode == 0
    pages = sorted(tmp_path.iterdir())
    assert {page.name for page in pages} >= {'r4.1', *(f'r4-{command}.1' for command in COMMANDS)}
    lint = subprocess.run(['mandoc', '-T', 'lint', *pages], capture_output=True, text=True, check=False)
    assert (lint.returncode, lint.stdout, lint.stderr) == (0, '', '')

    def words_of(text):
        return set(re.findall(r'[\w./=]{4,}', text.lower()))

    for page in pages:
        command = page.stem.removeprefix('r4').removeprefix('-')
        shown = subprocess.run(['mandoc', '-T', 'utf8', '-O', 'width=500', page], capture_output=True, text=True,
                               check=True).stdout
        shown = re.sub('.\b', '', shown)  # bold or underlined characters are printed twice
        told = run(*command.split(), '--help').stdout
        assert words_of(told) - words_of(shown) <= {'usage', 'codes', 'excludes'}, command
    assert run('man').stdout == (tmp_path / 'r4.1').read_text()
    assert run('man', 'send').stdout == (tmp_path / 'r4-send.1').read_text()
