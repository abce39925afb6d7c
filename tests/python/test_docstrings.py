# SPDX-License-Identifier: GPL-3.0-or-later
"""Each public function of the package has a docstring, and each number that it takes has a unit or a range."""
import ast
import re

import pytest

import r4link
from running import ROOT

SOURCES = sorted(path for path in (ROOT / 'host/python/r4link').glob('*.py*')
                 if path.name not in ('__init__.py', 'py.typed', 'pytest_plugin.py'))
SECONDS = {'timeout', 'within'}  # in the whole package: docs/how-to/python.md
UNITS = {'us', 'degrees', 'cm', 'millivolts'}  # these names are units
# A match must follow the name of a number.
UNIT_OR_RANGE = re.compile(r'\d|FORWARD|\b(seconds?|time\.monotonic|volts?|metres?|m/s|radians?|rad|steps|counts'
                           r'|bytes|index|ratio|per|a (second|metre|turn)|units? of)\b')
REACH = 160  # characters


def is_public(path, names):
    if path.name == '_core.pyi' and getattr(getattr(r4link, names[0], None), '__module__', '') != 'r4link._core':
        return False  # internal: the package wraps it
    return names[-1] == '__init__' or not any(name.startswith('_') for name in names)


def is_overload(function):
    """True if `function` is the signature of one way to call a function. The function follows, with its docstring."""
    return 'overload' in map(ast.unparse, function.decorator_list)


def functions_of(path):
    """Yields each public function with the docstrings that may describe its arguments: its own and its class's."""
    for node in ast.parse(path.read_text()).body:
        for each in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(each, (ast.FunctionDef, ast.AsyncFunctionDef)) and not (
                    path.suffix == '.py' and is_overload(each)):
                parts = [node] if each is node else [node, each]
                names = [part.name for part in parts]
                if is_public(path, names) and not names[0].startswith('_'):
                    yield pytest.param(path, each, [ast.get_docstring(part) or '' for part in reversed(parts)],
                                       id='.'.join([path.stem, *names]))


def numbers_of(function):
    for each in function.args.posonlyargs + function.args.args + function.args.kwonlyargs:
        if each.annotation and {'int', 'float'} & set(ast.unparse(each.annotation).split(' | ')):
            yield each.arg


FUNCTIONS = [each for path in SOURCES for each in functions_of(path)]


@pytest.mark.parametrize('path, function, texts', FUNCTIONS)
def test_a_function_has_a_docstring(path, function, texts):
    said_by_its_name = path.name == '_core.pyi' and [ast.unparse(each) for each in function.decorator_list] == ['property']
    assert said_by_its_name or texts[0] or (function.name == '__init__' and texts[-1])


@pytest.mark.parametrize('path, function, texts', FUNCTIONS)
def test_a_number_has_a_unit_or_a_range(path, function, texts):
    def is_described(name):
        return any(UNIT_OR_RANGE.search(text, found.end(), found.end() + REACH)
                   for text in texts for found in re.finditer(rf'\b{name}\b', text, re.IGNORECASE))

    assert [name for name in numbers_of(function) if name not in SECONDS | UNITS and not is_described(name)] == []
