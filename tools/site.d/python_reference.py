#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the reference of the Python package as Markdown, from its sources. Usage: python_reference.py >PAGE

A class has the members of its base classes in the package. The page begins with docs/examples/python/drive.py.
"""
import ast
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PACKAGE = ROOT / 'host/python/r4link'
# The modules in the order of the page.
TITLES = {
    'board': 'A board', 'channels': 'Outputs, I2C and UARTs', '_core': 'States, commands and reports', 'values': 'Values',
    'enums': 'Enumerations', 'errors': 'Errors', 'fleet': 'Many boards', 'bridge': 'Two transports joined',
    'devices': 'Devices of your own', 'recording': 'Recordings', 'simulation': 'Simulated boards',
    'transport': 'Transports of your own', 'aio': 'asyncio: r4link.aio', 'control': 'Control: r4link.control',
    'testing': 'Tests: r4link.testing'}
# Modules that programs import by name. The page has all their names. Of other modules the page has the names in
# r4link.__all__.
WHOLE = ('aio', 'control', 'devices', 'testing')
# The results of calls that wait: of a blocking board as listed, in r4link.aio as coroutines.
RESULTS = {'Sent': 'None', 'Read': 'bytes', 'Scanned': 'list[int]'}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def tree_of(module):
    path = PACKAGE / f'{module}.py'
    return ast.parse((path if path.exists() else path.with_suffix('.pyi')).read_text(encoding='utf-8'))


TREES = {module: tree_of(module) for module in (*TITLES, 'any_board', '__init__')}
CLASSES = {each.name: each for module in ('any_board', *reversed(TITLES)) for each in TREES[module].body
           if isinstance(each, ast.ClassDef)}


def public_names():
    assigned = next(each.value for each in TREES['__init__'].body if isinstance(each, ast.Assign)
                    and getattr(each.targets[0], 'id', '') == '__all__')
    return set(ast.literal_eval(assigned))


def prose(node):
    """The docstring as Markdown; its indented examples stay as they are."""
    text = ast.get_docstring(node) or ''
    lines = (line if line.startswith('    ') else re.sub(r'([<*])(?=(?:[^`]*`[^`]*`)*[^`]*$)', r'\\\1', line)
             for line in text.splitlines())
    return '\n'.join(lines)


def line_of(text):
    return ' '.join(text.split()).replace('|', '\\|')


def is_a(node, decorator):
    return any(isinstance(each, ast.Name) and each.id == decorator for each in node.decorator_list)


def signature(node, name=None):
    arguments = re.sub(r'^(self|cls)(, /)?(, )?', '', ast.unparse(node.args))
    result = f' -> {ast.unparse(node.returns)}' if node.returns is not None and name is None else ''
    result = re.sub(r'\b(Sent|Read|Scanned)\b', lambda found: RESULTS[found[1]], result)
    return f'{name or node.name}({arguments}){result}'


def members_of(node, trees):
    """The members of a class by name, after the members of its base classes."""
    members = {}
    for base in node.bases:
        name = getattr(base, 'id', getattr(getattr(base, 'value', None), 'id', ''))
        found = trees.get(name, CLASSES.get(name))
        if found is not None and found is not node:
            members.update(members_of(found, trees))
    for each in node.body:
        if isinstance(each, FUNCTIONS) and (not each.name.startswith('_') or each.name == '__init__'):
            members.setdefault(each.name, each) if is_a(each, 'overload') else members.update({each.name: each})
        elif isinstance(each, ast.AnnAssign) and not each.target.id.startswith('_'):
            members[each.target.id] = each
    return members


def values_of(node):
    """The members of an enumeration, with their meanings."""
    for each in node.body:
        if isinstance(each, ast.Assign) and each.targets[0].id.isupper():
            value = ast.literal_eval(each.value)
            yield each.targets[0].id, *(value if isinstance(value, tuple) else (value, ''))


def table(head, rows):
    if rows:
        yield '| ' + ' | '.join(head) + ' |'
        yield '|' + '---|' * len(head)
        yield from ('| ' + ' | '.join(row) + ' |' for row in rows)
        yield ''


def class_page(node, trees):
    members = members_of(node, trees)
    yield f'### {node.name}\n'
    begin = members.pop('__init__', None)
    if begin is not None:
        yield f'    {signature(begin, node.name)}\n'
    yield prose(node) + '\n'
    if begin is not None and ast.get_docstring(begin):
        yield prose(begin) + '\n'
    yield from table(('member', 'value', 'meaning'), [(f'`{name}`', f'`{value!r}`', line_of(meaning))
                                                      for name, value, meaning in values_of(node)])
    values = [(f'`{name}`', f'`{line_of(ast.unparse(each.annotation if isinstance(each, ast.AnnAssign) else each.returns))}`',
               '' if isinstance(each, ast.AnnAssign) else line_of(prose(each)))
              for name, each in members.items() if isinstance(each, ast.AnnAssign) or is_a(each, 'property')]
    yield from table(('attribute', 'type', 'meaning'), values)
    for name, each in members.items():
        if isinstance(each, FUNCTIONS) and not is_a(each, 'property'):
            yield f'#### {node.name}.{name}\n\n    {signature(each)}\n\n{prose(each)}\n'


def page():
    listed = public_names()
    example = (ROOT / 'docs/examples/python/drive.py').read_text(encoding='utf-8')
    yield '# Python API\n\nTimes are seconds. This program connects, arms, drives, reads and stops:\n'
    yield ''.join(f'    {line}' if line.strip() else line for line in example.splitlines(True)[1:])
    for module, title in TITLES.items():
        trees = {each.name: each for each in TREES[module].body if isinstance(each, ast.ClassDef)}
        yield f'## {title}\n'
        if module != '_core':
            yield prose(TREES[module]) + '\n'
        for each in sorted(TREES[module].body, key=lambda each: getattr(each, 'name', '').lower() != module):
            if getattr(each, 'name', '_').startswith('_') or not (module in WHOLE or each.name in listed):
                continue
            if isinstance(each, ast.ClassDef):
                yield from class_page(each, trees)
            elif isinstance(each, FUNCTIONS):
                yield f'### {each.name}\n\n    {signature(each)}\n\n{prose(each)}\n'


if __name__ == '__main__':
    sys.stdout.write('\n'.join(page()))
