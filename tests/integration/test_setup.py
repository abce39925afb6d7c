# SPDX-License-Identifier: GPL-3.0-or-later
"""tools/setup on simulated releases, with programs in place of apt's, and the errors of tools/on."""
import os
import pathlib
import re
import shutil
import subprocess

import pytest

TOOLS = pathlib.Path(__file__).resolve().parents[2] / 'tools'
PRODUCT = {'g++', 'cmake', 'ninja-build', 'pkg-config', 'libasio-dev', 'libboost-dev', 'libserialport-dev',
           'libnl-route-3-dev', 'libfmt-dev', 'libdeflate-dev', 'libzstd-dev', 'liblz4-dev', 'libcli11-dev',
           'nlohmann-json3-dev', 'libjs-dygraphs', 'cyclonedds-dev', 'cyclonedds-tools'}
PARTS = {'cyclonedds-dev', 'cyclonedds-tools'}
UNIT_TESTS = {'libgtest-dev', 'librapidcheck-dev', 'libbenchmark-dev', 'python3', 'python3-pytest', 'libpython3-dev',
              'pybind11-dev'}


class Release:
    """A simulated system with some packages installed and some in its archive. Its programs are first in PATH."""

    def __init__(self, folder, archive, installed=(), version='9.0'):
        self._log = folder / 'installed'
        self._path = folder
        there = '\n'.join(f'installed amd64 {each} 1:9.0' for each in installed)
        self._program('dpkg-query', f"cat <<'END'\n{there}\nEND")
        known = '\n'.join(f'{each}:\n  Installed: (none)\n  Candidate: 1:{version}\n' for each in archive)
        self._program('apt-cache', f"cat <<'END'\n{known}\nEND")
        self._program('apt-get', f'case "$*" in *install*) echo "$*" >>"{self._log}" ;; esac')
        self._program('sudo', 'exec "$@"')
        self._program('dpkg', '''case "$1" in
          --print-architecture) echo amd64 ;;
          --print-foreign-architectures) echo arm64 ;;
          *) exec /usr/bin/dpkg "$@" ;;
        esac''')

    def _program(self, name, script):
        path = self._path / name
        path.write_text(f'#!/bin/bash\n{script}\n')
        path.chmod(0o755)

    def set_up(self, *options, **variables):
        """Runs tools/setup, and returns the run and the packages that tools/setup would have installed."""
        ended = subprocess.run([TOOLS / 'setup', *options], capture_output=True, text=True, check=False,
                               env={**os.environ, 'PATH': f'{self._path}:/usr/bin:/bin', **variables})
        said = self._log.read_text() if self._log.exists() else ''
        return ended, set(said.partition('--no-install-recommends ')[2].split())


def test_a_build_installs_only_the_packages_of_the_product(tmp_path):
    ended, installed = Release(tmp_path, PRODUCT | UNIT_TESTS | {'libfastdds-dev'}).set_up()
    assert ended.returncode == 0, ended.stderr
    assert installed == PRODUCT


def test_setup_installs_nothing_if_all_packages_are_installed(tmp_path):
    ended, installed = Release(tmp_path, (), PRODUCT).set_up()
    assert (ended.returncode, installed) == (0, set())
    assert f'all {len(PRODUCT)} packages are there' in ended.stdout


@pytest.mark.parametrize('name', ['libfastdds-dev', 'libfastrtps-dev'])
def test_setup_uses_the_package_name_of_the_release(tmp_path, name):
    ended, installed = Release(tmp_path, UNIT_TESTS | {name}, PRODUCT).set_up('--test')
    assert ended.returncode == 0, ended.stderr
    assert installed == UNIT_TESTS | {name}


def test_setup_skips_and_names_a_missing_test_package(tmp_path):
    ended, installed = Release(tmp_path, UNIT_TESTS, PRODUCT).set_up('--test')
    assert ended.returncode == 0, ended.stderr
    assert installed == UNIT_TESTS
    assert re.search(r'skipped.*libfastdds-dev', ended.stderr)


def test_a_missing_product_package_is_named_with_library_and_version(tmp_path):
    ended, installed = Release(tmp_path, PRODUCT - {'libfmt-dev'}).set_up()
    assert (ended.returncode, installed) == (1, set())
    assert re.match(r'tools/setup: this release has no package libfmt-dev, or too old a one\n  fix: install .*fmt 8\.1', ended.stderr,
                    re.DOTALL)


def test_setup_skips_a_part_whose_library_is_too_old(tmp_path):
    ended, installed = Release(tmp_path, {'cyclonedds-dev', 'cyclonedds-tools'}, PRODUCT - PARTS, '0.8.2').set_up()
    assert (ended.returncode, installed) == (0, set())
    assert re.search(r'skipped.*cyclonedds-dev cyclonedds-tools', ended.stderr)


def test_setup_installs_a_cross_compiler_for_another_architecture(tmp_path):
    libraries = {each for each in PRODUCT if each.endswith('-dev')} - {'libasio-dev'}
    archive = PRODUCT | {f'{each}:arm64' for each in libraries} | {'g++-aarch64-linux-gnu'}
    ended, installed = Release(tmp_path, archive).set_up(R4_ARCH='arm64')
    assert ended.returncode == 0, ended.stderr
    assert installed == (PRODUCT - libraries - {'g++'}) | {f'{each}:arm64' for each in libraries} | {'g++-aarch64-linux-gnu'}


@pytest.mark.parametrize('arguments, words', [
    (['debian11', 'true'], ['debian11 is not a release', 'debian12']),
    (['debian12/mips', 'true'], ['mips is not an architecture', 'arm64']),
    (['debian12'], ['no command', 'tools/demo']),
    (['debian12', '--see', '/nowhere', 'true'], ['/nowhere is not a folder']),
    (['debian12', '--dirty', 'true'], ['--dirty is not an option', '--help']),
    (['--all', 'debian11'], ['debian11 is neither', 'debian12']),
])
def test_tools_on_refuses_wrong_options_with_a_fix(arguments, words):
    ended = subprocess.run([TOOLS / 'on', *arguments], capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert re.match(r'tools/on: .+\n  fix: .+\n$', ended.stderr), ended.stderr
    assert all(word in ended.stderr for word in words), ended.stderr


def test_tools_on_names_the_package_of_a_missing_program(tmp_path):
    for program in ('bash', 'dirname', 'dpkg', 'uname'):
        (tmp_path / program).symlink_to(f'/usr/bin/{program}')
    ended = subprocess.run([TOOLS / 'on', 'debian12', 'true'], capture_output=True, text=True, check=False,
                           env={'PATH': str(tmp_path), 'HOME': str(tmp_path)})
    assert (ended.returncode, ended.stderr) == (
        6, 'tools/on: mmdebstrap is not installed\n  fix: apt-get install mmdebstrap\n')


class Table:
    """tools/on --all with a program in place of tools/on, which logs its arguments and then runs `script`."""

    def __init__(self, folder, script=''):
        self.folder = folder
        (folder / 'tools/on.d').mkdir(parents=True)
        shutil.copy(TOOLS / 'on.d/table', folder / 'tools/on.d')
        program = folder / 'tools/on'
        program.write_text(f'#!/bin/sh\necho "$*" >>"{folder}/commands"\n{script}\n')
        program.chmod(0o755)

    def run(self, *words):
        """Runs the table, and returns the run and the logged commands."""
        ended = subprocess.run([self.folder / 'tools/on.d/table', *words], capture_output=True, text=True, check=False,
                               env={**os.environ, 'R4_ON_DIR': str(self.folder / 'roots')})
        return ended, (self.folder / 'commands').read_text().splitlines()


def test_packages_compile_once_and_are_tested_in_a_minimal_system(tmp_path):
    ended, commands = Table(tmp_path).run('debian13/arm64', 'package', 'wheel')
    assert ended.returncode == 0, ended.stderr
    packages, wheel = (f'{tmp_path}/roots/debian13-arm64/root/r4link/build/{made}' for made in ('packages', 'wheel'))
    assert commands == [
        'debian13/arm64 bash -c tools/setup --package && tools/package',
        f'debian13/arm64 --clean --see {packages} tests/install/clean.sh {packages}',
        'debian13/arm64 bash -c tools/setup --package && tools/wheel --built build/packages/r4link/debian/build',
        f'debian13/arm64 --clean --see {wheel} tests/install/clean.sh {wheel}']


def test_packages_that_fail_to_build_are_not_tested(tmp_path):
    ended, commands = Table(tmp_path, 'exit 1').run('debian13/amd64', 'package')
    assert (ended.returncode, len(commands)) == (1, 1)
    assert re.search(r'\| debian13/amd64 +\|[ |]* FAILED ', ended.stdout), ended.stdout


def test_a_build_with_a_warning_fails(tmp_path):
    ended, _ = Table(tmp_path, "echo 'a.cpp:1:2: warning: unused variable'").run('debian13/amd64', 'build')
    assert ended.returncode == 1
    assert re.search(r'\| debian13/amd64 +\| FAILED ', ended.stdout), ended.stdout
