# SPDX-License-Identifier: GPL-3.0-or-later
"""The pytest plugin, with the example of docs/how-to/testing.md and with tests that fail."""
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from r4link import UsageError, pytest_plugin

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / 'docs/examples/robot_tests'


def run_pytest(*arguments, cwd, **env):
    return subprocess.run([sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '-p', 'r4link.pytest_plugin',
                           *map(str, arguments)], cwd=cwd, env={**os.environ, **env}, capture_output=True, text=True,
                          check=False)


def steps():
    """The lines of the example's workflow that run its tests."""
    workflow = (EXAMPLE / '.github/workflows/tests.yml').read_text()
    return re.findall(r'- run: (.*-m pytest.*)', workflow)


def written(*names):
    return sum(len(re.findall(r'^def test_', (EXAMPLE / name).read_text(), re.MULTILINE)) for name in names)


def run_step(step, folder, *files):
    """Runs a step of the example's workflow, and asserts that no test is skipped. `files`: runs only these tests."""
    project = shutil.copytree(EXAMPLE, folder / 'project')
    env = {**os.environ, 'R4LINK': str(ROOT), 'PATH': f'{pathlib.Path(sys.executable).parent}:{os.environ["PATH"]}',
           'PYTHONPATH': f'{ROOT / "tests/integration"}:{os.environ["PYTHONPATH"]}',
           'PYTEST_ADDOPTS': '-p no:cacheprovider -p r4link.pytest_plugin -p repeat'}
    ended = subprocess.run(['bash', '-c', f'{step} {" ".join(files)}'], cwd=project, env=env, stdin=subprocess.DEVNULL,
                           capture_output=True, text=True, timeout=200, check=False)
    everything = "-m ''" in step
    passed = written(*(files or ['test_patrol.py']))
    assert ended.returncode == 0 and f'{passed} passed' in ended.stdout, ended.stdout + ended.stderr
    assert 'skipped' not in ended.stdout and ('deselected' in ended.stdout) != everything


# pytest_plugin_can_inside.py runs the last step.
@pytest.mark.parametrize('step', steps()[:-1])
def test_the_example_passes_in_this_process_and_over_udp(step, tmp_path):
    run_step(step, tmp_path)


def test_the_documented_steps_use_every_transport():
    assert [step for step in steps() if 'with-can' in step] == [steps()[-1]] and '--r4-transport can' in steps()[-1]
    assert any('--r4-transport udp' in step for step in steps())
    project = tomllib.loads((EXAMPLE / 'pyproject.toml').read_text())['project']
    assert project['dependencies'] == ['r4link'] and 'pytest' in project['optional-dependencies']['test']


def test_a_failed_expectation_is_reported(tmp_path):
    (tmp_path / 'test_wrong.py').write_text('''
import r4link

def test_field(r4_board):
    r4_board.expect(osmc1=358, dmhsta=True, within=0.05)

def test_unknown(r4_board):
    r4_board.expect(motor=1)

def test_safe(r4_board):
    r4_board.expect_safe('stop', within=0.05)

def test_link(r4_link):
    assert False

def test_can(request, tmp_path):
    import pytest
    from r4link.testing import make_robot
    with pytest.raises(r4link.Error) as raised:
        make_robot('can', tmp_path, interface='nocan0')
    assert 'nocan0' in str(raised.value)
''')
    ended = run_pytest('test_wrong.py', cwd=tmp_path)
    assert '4 failed, 1 passed' in ended.stdout, ended.stdout
    assert re.search(r"@pytest.mark.r4\(link='loss=2%,delay=5ms±5,seed=\d+'\)", ended.stdout)
    for words in ('osmc1 is Drive(pwm=0, direction=0), not 358 (link active, reason none; State(pnum=',
                  'this is not a state field; see r4link.FIELDS',
                  'after 0.05 s the board is not safe (stop): the link is active, its reason none'):
        assert words in ended.stdout.replace('\n', ' '), ended.stdout


def test_a_missing_r4_command_is_reported_with_a_fix(tmp_path):
    (tmp_path / 'test_it.py').write_text('def test_it(r4_board): pass\n')
    env = {'R4': '', 'PATH': str(tmp_path)}
    ended = run_pytest('test_it.py', '--r4-transport', 'udp', cwd=tmp_path, **env)
    assert 'the command r4: the command is not on PATH; set R4=FILE' in ended.stdout, ended.stdout


def test_xdist_workers_use_different_nodes_of_a_bus(monkeypatch):
    node = pytest_plugin._node
    assert [node(number) for number in range(3)] == [1, 2, 3]
    monkeypatch.setenv('PYTEST_XDIST_WORKER_COUNT', '4')
    nodes = set()
    for worker in range(4):
        monkeypatch.setenv('PYTEST_XDIST_WORKER', f'gw{worker}')
        nodes |= {node(number) for number in range(7)}
    assert len(nodes) == 4 * 7 and nodes <= set(range(1, 32))
    with pytest.raises(UsageError, match='use fewer workers'):
        node(8)


@pytest.mark.parametrize('broken', [False, True])
def test_a_broken_package_fails_only_the_tests_that_use_it(broken, tmp_path):
    """Loads the plugin by its entry point, as pytest does after an installation."""
    site = tmp_path / 'site'
    shutil.copytree(pathlib.Path(pytest_plugin.__file__).parent, site / 'r4link')
    shutil.copy(ROOT / 'host/python/r4link_pytest.py', site)
    information = site / 'r4link-1.dist-info'
    information.mkdir()
    (information / 'METADATA').write_text('Metadata-Version: 2.1\nName: r4link\nVersion: 1\n')
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']
    (information / 'entry_points.txt').write_text(f'[pytest11]\nr4link = {project["entry-points"]["pytest11"]["r4link"]}\n')
    if broken:
        (site / 'r4link/_core.so').write_bytes(b'no library')
    (tmp_path / 'test_any.py').write_text('def test_any(): pass\n')
    (tmp_path / 'test_robot.py').write_text('def test_robot(r4_robot): pass\n')
    ended = subprocess.run([sys.executable, '-B', '-W', 'error', '-m', 'pytest', '-q', '-p', 'no:cacheprovider'], cwd=tmp_path,
                           env={**os.environ, 'PYTHONPATH': str(site)}, capture_output=True, text=True, check=False)
    assert ('1 passed, 1 error' if broken else '2 passed') in ended.stdout, ended.stdout + ended.stderr
    assert ('warning: r4link: its pytest plugin cannot be loaded: ImportError' in ended.stdout) == broken, ended.stdout
