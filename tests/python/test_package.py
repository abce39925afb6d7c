# SPDX-License-Identifier: GPL-3.0-or-later
"""The package's types, and that it is built and installed with what Debian has, without a network."""
import ast
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import textwrap

import pytest

import r4link
from r4link import _core

ROOT = pathlib.Path(__file__).resolve().parents[2]
OFFLINE = {**os.environ, 'PIP_NO_INDEX': '1', 'PIP_DISABLE_PIP_VERSION_CHECK': '1'}
OFFLINE.pop('PYTHONPATH')


def run(*command, cwd=ROOT, env=None):
    ended = subprocess.run([str(each) for each in command], cwd=cwd, env=env or os.environ, capture_output=True, text=True,
                           check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def test_types_are_strict():
    """In one run, because most of its time goes into the types of the standard library, which the build folder keeps."""
    package, examples = ROOT / 'host/python/r4link', ROOT / 'docs/examples'
    sources = [*package.glob('*.py'), package / '_core.pyi', *(examples / 'python').glob('*.py'),
               examples / 'openscout/openscout.py']
    kept = pathlib.Path(os.environ['R4_BUILD']) / 'mypy'
    run(sys.executable, '-m', 'mypy', '--strict', '--python-version', '3.10', '--cache-dir', kept, *sorted(sources),
        env={**os.environ, 'MYPYPATH': f'{ROOT / "host/python"}:{ROOT / "docs/examples/openscout"}'})


def test_the_stub_has_what_the_module_has():
    stub = ast.parse((ROOT / 'host/python/r4link/_core.pyi').read_text())
    classes = {each.name: each for each in stub.body if isinstance(each, ast.ClassDef)}
    runtime = {name: each for name, each in vars(_core).items() if isinstance(each, type)}
    assert set(classes) - {'_Record'} == set(runtime)
    for name, each in runtime.items():
        told = [classes[name], classes['_Record']] if hasattr(each, 'as_dict') else [classes[name]]
        stubbed = {getattr(one, 'name', None) or one.target.id for part in told for one in part.body
                   if isinstance(one, (ast.FunctionDef, ast.AnnAssign))}
        assert public(stubbed) == public(dir(each)), name


def public(names):
    return {each for each in names if not each.startswith('_')}


@pytest.mark.parametrize('example', sorted((ROOT / 'docs/examples/python').glob('*.py')), ids=lambda path: path.stem)
def test_examples_run(example, sim, tmp_path):
    told = run(sys.executable, example, 'sim:', cwd=tmp_path)
    assert 'OSMC 1: 358 forward' in told, told


@pytest.mark.parametrize('page', ['README.md', 'docs/control.md', 'docs/fleet.md', 'docs/python.md'])
def test_what_the_documentation_shows_runs(page, tmp_path):
    shown = re.findall(r'^```python\n(.*?)^```', (ROOT / page).read_text(), re.MULTILINE | re.DOTALL)
    assert shown
    for program in shown:
        program = program.replace('udp://192.168.0.125', 'sim:')
        if 'async with' in program:
            program = 'import asyncio\nasync def main():\n' + textwrap.indent(
                program.replace('        ...', '        break'), '    ') + 'asyncio.run(main())\n'
        run(sys.executable, '-c', 'import r4link\n' + program, cwd=tmp_path)


def test_installs_into_a_venv_and_builds_a_source_distribution(tmp_path):
    run(sys.executable, '-m', 'venv', tmp_path / 'venv')
    python = tmp_path / 'venv/bin/python'
    run(python, '-m', 'pip', 'install', '--quiet', ROOT, env=OFFLINE)
    told = run(python, '-c', 'import r4link; print(r4link.__version__, r4link.__file__); '
                             'board = r4link.Board("sim:"); board.wait_active(); print(board)', cwd=tmp_path, env=OFFLINE)
    assert told.startswith(f'{r4link.__version__} {tmp_path}') and 'active' in told
    run(sys.executable, '-m', 'build', '--outdir', tmp_path / 'dist', '--sdist', ROOT, env=OFFLINE)
    [source] = (tmp_path / 'dist').iterdir()
    with tarfile.open(source) as archive:
        names = archive.getnames()
        archive.extractall(tmp_path / 'source')
    # The source distribution is whole: it configures in a folder of its own, as a build without R4_BUILD does.
    run(sys.executable, '-c', 'import build_backend; build_backend.configure("build")',
        cwd=tmp_path / 'source' / f'r4link-{r4link.__version__}',
        env={**OFFLINE, 'PYTHONPATH': 'host/python'})
    assert f'r4link-{r4link.__version__}/host/python/bindings/board.cpp' in names
    assert not any('__pycache__' in each or each.endswith('.so') for each in names)


def test_a_wheel_has_the_same_bytes_twice_and_carries_its_libraries(tmp_path):
    for folder in (tmp_path / 'one', tmp_path / 'two'):
        made = run(ROOT / 'tools/wheel', '--built', os.environ['R4_BUILD'], '--into', folder)
        assert '-manylinux_2_' in made and not list(folder.glob('*-linux_*')), made
    first, second = sorted(tmp_path.glob('*/*.whl'))
    assert first.name == second.name and first.read_bytes() == second.read_bytes()
    shutil.copy(ROOT / 'tests/install/wheel_inside.sh', tmp_path / 'one')
    told = run(tmp_path / 'one/wheel_inside.sh', sys.executable, env=OFFLINE)
    assert 'drives a board; 6 libraries are its own' in told, told


def test_a_folder_of_sources_says_what_is_missing():
    ended = subprocess.run([sys.executable, '-B', '-c', 'import r4link'], cwd=ROOT / 'host/python', env=OFFLINE,
                           capture_output=True, text=True, check=False)
    assert 'ImportError: r4link: ' in ended.stderr and 'without the compiled module; build it' in ended.stderr, ended.stderr


def test_an_editable_installation_says_what_to_do_instead(tmp_path):
    ended = subprocess.run([sys.executable, '-c', 'import build_backend; build_backend.build_editable("x")'], cwd=tmp_path,
                           env={**OFFLINE, 'PYTHONPATH': str(ROOT / 'host/python')}, capture_output=True, text=True,
                           check=False)
    assert ended.returncode != 0 and 'fix: pip install .' in ended.stderr, ended.stderr
