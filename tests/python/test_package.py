# SPDX-License-Identifier: GPL-3.0-or-later
"""The contents of the package, and the programs in its documentation."""
import ast
import os
import pathlib
import re
import subprocess
import sys
import textwrap

import pytest

import r4link
from r4link import _core
from running import OFFLINE, ROOT, run


def test_the_stub_matches_the_module():
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
    assert 'OSMC 1: 410 forward' in told, told


@pytest.mark.parametrize('page', ['README.md', 'docs/how-to/control.md', 'docs/how-to/fleet.md', 'docs/how-to/python.md'])
def test_programs_in_the_documentation_run(page, tmp_path):
    shown = re.findall(r'^```python\n(.*?)^```', (ROOT / page).read_text(), re.MULTILINE | re.DOTALL)
    assert shown
    imports = ''
    for program in shown:
        program = re.sub(r"Board\('udp://[\d.]+'", "Board('sim:'", program)
        if 'async with' in program:
            program = 'import asyncio\nasync def main():\n' + textwrap.indent(
                program.replace('        ...', '        break'), '    ') + 'asyncio.run(main())\n'
        run(sys.executable, '-c', imports + program, cwd=tmp_path)
        imports = 'import r4link\n'  # of the page's first program


def test_importing_the_sources_reports_the_missing_module():
    ended = subprocess.run([sys.executable, '-B', '-c', 'import r4link'], cwd=ROOT / 'host/python', env=OFFLINE,
                           capture_output=True, text=True, check=False)
    assert 'ImportError: r4link: ' in ended.stderr and 'without the compiled module; build it' in ended.stderr, ended.stderr


def test_an_editable_installation_is_refused_with_a_fix(tmp_path):
    ended = subprocess.run([sys.executable, '-c', 'import build_backend; build_backend.build_editable("x")'], cwd=tmp_path,
                           env={**OFFLINE, 'PYTHONPATH': str(ROOT / 'host/python')}, capture_output=True, text=True,
                           check=False)
    assert ended.returncode != 0 and 'fix: pip install .' in ended.stderr, ended.stderr
