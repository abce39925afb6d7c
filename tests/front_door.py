#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the first pages and files that a visitor sees. Usage: front_door.py TREE

Workflows, actions and issue forms are valid for GitHub. The tools in these files and in the top pages exist, and accept
the options in these places. The changelog and the packages have this version. The site can be made, because every link
has a target, and Doxygen understands the headers.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

import yaml

TOOL = re.compile(r'(?<![\w/.])((?:tools|\.ci)/[\w-]+)(?![\w/])([^`|;&\n]*)')
RUNNERS = {'tools/on', 'tools/with-can'}  # these tools run a command, which has its own options
FIELDS = {'dropdown', 'textarea', 'input', 'checkboxes', 'markdown'}


def workflow_faults(content):
    events = content.get(True) or content.get('on') or {}
    for_tags = isinstance(events, dict) and (events.get('push') or {}).get('tags')
    if not for_tags and not {'push', 'pull_request'} <= set(events):
        yield 'it runs neither for tags nor for pushes and pull requests'
    for name, job in content['jobs'].items():
        if not job.get('timeout-minutes'):
            yield f'job {name} may run for ever'
        for step in job['steps']:
            if ('run' in step) == ('uses' in step):
                yield f'job {name}: a step either runs or uses something'
        used = set(re.findall(r'matrix\.([\w-]+)', str(job)))
        rows = job.get('strategy', {}).get('matrix', {})
        known = set(rows).union(*rows.get('include', ()))  # a row without a key has an empty value
        if not used <= known:
            yield f'job {name}: its matrix has no {", ".join(sorted(used - known))}'
        if job.get('needs') and job['needs'] not in content['jobs']:
            yield f'job {name} needs {job["needs"]}, which is not there'


def action_faults(content):
    if not {'name', 'description', 'inputs', 'runs'} <= set(content):
        yield 'name, description, inputs or runs is missing'
    for step in content['runs']['steps']:
        if 'shell' not in step:
            yield 'a step of an action has no shell'
        for used in re.findall(r'inputs\.([\w-]+)', str(step)):
            if used not in content['inputs']:
                yield f'there is no input {used}'


def form_faults(content):
    if not {'name', 'description', 'body'} <= set(content):
        yield 'name, description or body is missing'
    names = [field.get('id') for field in content['body']]
    if len(set(names)) != len(names):
        yield 'two fields have the same id'
    for field in content['body']:
        if field['type'] not in FIELDS or not field['attributes'].get('label'):
            yield f'{field.get("id")}: a field needs a type and a label'
        options = field['attributes'].get('options', [])
        if field['type'] in ('dropdown', 'checkboxes') and not options:
            yield f'{field["id"]}: there is nothing to choose'
        if not all(isinstance(each, str) or 'label' in each for each in options):
            yield f'{field["id"]}: an option is not text (quote it)'


def yaml_faults(root):
    kinds = {'workflows': workflow_faults, 'ISSUE_TEMPLATE': form_faults, 'with-can': action_faults}
    files = sorted((root / '.github').rglob('*.yml'))
    if {file.parent.name for file in files} != set(kinds):
        yield f'.github: not all of {", ".join(kinds)} are there'
    for file in files:
        try:
            for fault in kinds[file.parent.name](yaml.safe_load(file.read_text())):
                yield f'{file.relative_to(root)}: {fault}'
        except (yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
            yield f'{file.relative_to(root)}: {type(error).__name__} {error}'


def tool_faults(root):
    pages = ('README.md', 'CONTRIBUTING.md', 'docs/design/contributing.md', 'docs/how-to/packages.md', '.github/workflows/ci.yml',
             '.github/workflows/release.yml')
    for page in pages:
        for tool, options in TOOL.findall((root / page).read_text()):
            program = root / tool
            if tool in RUNNERS:
                options = re.match(r'(?: --[\w-]+)*', options)[0]
            if not program.exists():
                yield f'{page}: there is no {tool}'
            elif program.is_file():
                text = program.read_text()
                for option in re.findall(r'(?<= )--[\w-]+', options):
                    if option not in text:
                        yield f'{page}: {tool} has no option {option}'


def version_faults(root):
    version = re.search(r'R4LINK_VERSION "([^"]+)"', (root / 'include/r4link/config.hpp').read_text())[1]
    minor = version.rpartition('.')[0]
    if not re.search(rf'^## \[.*{re.escape(version)}', (root / 'CHANGELOG.md').read_text(), re.MULTILINE):
        yield f'CHANGELOG.md has no section of {version}'
    if not (root / 'debian/changelog').read_text().startswith(f'r4link ({version})'):
        yield f'debian/changelog does not begin with {version}'
    if f'Package: libr4link{minor}\n' not in (root / 'debian/control').read_text():
        yield f'debian/control has no package of the library {minor}'


def site_faults(root):
    with tempfile.TemporaryDirectory() as folder:
        made = subprocess.run([root / 'tools/site', folder], capture_output=True, text=True, check=False)
        if made.returncode != 0:
            yield made.stderr.strip()
        elif not (pathlib.Path(folder) / 'api/classr4_1_1Board.html').is_file():
            yield 'tools/site: the reference has no page of r4::Board'
        else:
            page = (pathlib.Path(folder) / 'api/python.html').read_text(encoding='utf-8')
            yield from (f'tools/site: the Python reference lacks {name}' for name in
                        ('Board', 'Board.arm', 'Command.servo', 'LinkState', 'OpenError', 'wait_active')
                        if f'>{name}' not in page and f'{name}(' not in page)


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    faults = [fault for faults_of in (yaml_faults, tool_faults, version_faults, site_faults) for fault in faults_of(root)]
    print('\n'.join([*faults, f'{len(faults)} faults']))
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
