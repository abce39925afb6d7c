# SPDX-License-Identifier: GPL-3.0-or-later
"""tools/release makes the same bytes twice, and refuses a tree whose version is not the requested one."""
import hashlib
import os
import pathlib
import re
import shutil
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = re.search(r'R4LINK_VERSION "([^"]+)"', (ROOT / 'include/r4link/config.hpp').read_text())[1]
QUICK = 'source,arduino,notes'


def git(tree, *command):
    author = ['-c', 'user.name=nobody', '-c', 'user.email=nobody@example.invalid']
    subprocess.run(['git', *author, *command], cwd=tree, check=True, capture_output=True,
                   env={**os.environ, 'GIT_COMMITTER_DATE': '2026-01-02T03:04:05Z', 'GIT_CONFIG_GLOBAL': '/dev/null'})


@pytest.fixture(name='tree', scope='module')
def a_committed_tree(tmp_path_factory):
    tree = tmp_path_factory.mktemp('release') / 'tree'
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns('build', '.git', '__pycache__'))
    git(tree, 'init', '--quiet')
    git(tree, 'add', '--all')
    git(tree, 'commit', '--quiet', '--message', 'A tree')
    return tree


def release(tree, into, version=VERSION, only=QUICK):
    return subprocess.run([tree / 'tools/release', version, '--into', into, '--only', only], capture_output=True, text=True,
                          check=False)


def test_a_release_is_reproducible_and_has_checksums(tree, tmp_path):
    for name in ('one', 'two'):
        made = release(tree, tmp_path / name)
        assert made.returncode == 0, made.stderr
    files = {path.name: path.read_bytes() for path in (tmp_path / 'one').iterdir()}
    assert files == {path.name: path.read_bytes() for path in (tmp_path / 'two').iterdir()}
    assert set(files) == {f'r4link-{VERSION}.tar.gz', f'R4_Link-{VERSION}.zip', 'RELEASE_NOTES.md', 'SHA256SUMS'}
    for line in files['SHA256SUMS'].decode().splitlines():
        digest, name = line.split('  ')
        assert digest == hashlib.sha256(files[name]).hexdigest()
    assert f'R4 link {VERSION}' in files['RELEASE_NOTES.md'].decode()
    assert '](docs/' not in files['RELEASE_NOTES.md'].decode()


def change(path, old, new):
    path.write_text(path.read_text().replace(old, new))


@pytest.mark.parametrize('file, old, new', [
    ('include/r4link/config.hpp', f'R4LINK_VERSION "{VERSION}"', 'R4LINK_VERSION "9.8.7"'),
    ('debian/changelog', f'({VERSION})', '(9.8.7)'),
    ('CHANGELOG.md', VERSION, '9.8.7'),
    ('README.md', 'R4', 'R5'),
])
def test_a_release_refuses_a_tree_that_is_not_ready(tree, tmp_path, file, old, new):
    change(tree / file, old, new)
    try:
        refused = release(tree, tmp_path)
    finally:
        git(tree, 'checkout', '--', file)
    named = 'the tree' if file == 'README.md' else file
    assert refused.returncode == 1 and refused.stderr.startswith(f'tools/release: {named}: '), refused.stderr
    assert '\n  fix: ' in refused.stderr
    assert not list(tmp_path.iterdir())


def test_a_release_refuses_another_version_and_an_unknown_part(tree, tmp_path):
    assert release(tree, tmp_path, version='9.8.7').returncode == 1
    refused = release(tree, tmp_path, only='source,shoes')
    assert refused.returncode == 2 and '"shoes" is not a part' in refused.stderr, refused.stderr
