# SPDX-License-Identifier: GPL-3.0-or-later
"""The types of the Python package, and its build and installation with Debian's packages and without a network."""
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile

import r4link
from running import OFFLINE, ROOT, run


def test_the_package_and_examples_pass_strict_type_checks():
    """One run checks all files, because the types of the standard library, which mypy caches, take most of the time."""
    package, examples = ROOT / 'host/python/r4link', ROOT / 'docs/examples'
    sources = [*package.glob('*.py'), package / '_core.pyi', *(examples / 'python').glob('*.py'),
               examples / 'openscout/openscout.py']
    kept = pathlib.Path(os.environ['R4_BUILD']) / 'mypy'
    run(sys.executable, '-m', 'mypy', '--strict', '--python-version', '3.10', '--cache-dir', kept, *sorted(sources),
        env={**os.environ, 'MYPYPATH': f'{ROOT / "host/python"}:{ROOT / "docs/examples/openscout"}'})


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
    # The source distribution is complete, because it configures in a new folder, as a build without R4_BUILD does.
    run(sys.executable, '-c', 'import build_backend; build_backend.configure("build")',
        cwd=tmp_path / 'source' / f'r4link-{r4link.__version__}',
        env={**OFFLINE, 'PYTHONPATH': 'host/python'})
    assert f'r4link-{r4link.__version__}/host/python/bindings/board/board.cpp' in names
    assert not any('__pycache__' in each or each.endswith('.so') for each in names)


def test_a_wheel_is_reproducible_and_contains_its_libraries(tmp_path):
    for folder in (tmp_path / 'one', tmp_path / 'two'):
        made = run(ROOT / 'tools/wheel', '--built', os.environ['R4_BUILD'], '--into', folder)
        assert '-manylinux_2_' in made and not list(folder.glob('*-linux_*')), made
    first, second = sorted(tmp_path.glob('*/*.whl'))
    assert first.name == second.name and first.read_bytes() == second.read_bytes()
    shutil.copy(ROOT / 'tests/install/wheel_inside.sh', tmp_path / 'one')
    told = run(tmp_path / 'one/wheel_inside.sh', sys.executable, env=OFFLINE)
    assert 'drives a board; 6 libraries are its own' in told, told


def test_the_module_leaks_no_reference():
    """Runs on an interpreter that counts references, such as python3.11-dbg, with the module built for it."""
    build = pathlib.Path(os.environ['R4_BUILD'])
    ended = subprocess.run([f'/usr/bin/python3.{sys.version_info.minor}-dbg', ROOT / 'tests/python/reference_counts.py'],
                           capture_output=True, text=True, timeout=120, check=False,
                           env={**os.environ, 'PYTHONPATH': str(build / 'python-debug')})
    assert ended.returncode == 0 and ended.stderr == '', ended.stdout + ended.stderr
