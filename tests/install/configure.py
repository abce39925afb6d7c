#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""ctest `configure`: the errors of CMake for a missing or too old library. Usage: configure.py TREE"""
import json
import pathlib
import platform
import re
import subprocess
import sys
import tempfile

TREE = pathlib.Path(sys.argv[1]).resolve()
OLDEST_CMAKE = '3.22'  # Ubuntu 22.04


def without(*packages):
    return [f'-DCMAKE_DISABLE_FIND_PACKAGE_{package}=ON' for package in packages]


def configure(*options):
    """Returns (True if CMake succeeds, CMake's output in one line)."""
    with tempfile.TemporaryDirectory() as folder:
        ended = subprocess.run(['cmake', '-G', 'Ninja', '-S', TREE, '-B', folder, '-DR4_TESTS=OFF', *options],
                               capture_output=True, text=True, check=False)
    return ended.returncode == 0, ' '.join((ended.stdout + ended.stderr).split())


def a_build_needs_no_library_of_what_it_leaves_out():
    works, said = configure('-DR4_ROS2=OFF', *without('CycloneDDS'))
    assert works, said


def a_missing_library_is_named_with_its_option_and_its_packages():
    works, said = configure(*without('CycloneDDS'))
    assert not works and 'CycloneDDS was not found' in said, said
    assert '-DR4_ROS2=OFF' in said and 'cyclonedds-dev' in said, said


def missing_dygraphs_are_named_with_their_option_and_package():
    works, said = configure('-DR4_ROS2=OFF', '-DCMAKE_IGNORE_PATH=/usr/share/javascript/dygraphs')
    assert not works and 'dygraph.min.js was not found' in said, said
    assert '-DR4_DYGRAPHS=FOLDER' in said and 'libjs-dygraphs' in said, said


def a_cross_build_makes_the_manual_by_the_r4_that_it_built():
    with tempfile.TemporaryDirectory() as folder:
        ended = subprocess.run(['cmake', '--preset', 'release', '-B', folder, '-DR4_TESTS=OFF', '-DR4_PYTHON=OFF',
                                '-DCMAKE_SYSTEM_NAME=Linux', f'-DCMAKE_SYSTEM_PROCESSOR={platform.machine()}'],
                               cwd=TREE, capture_output=True, text=True, check=False)
        assert ended.returncode == 0, ended.stderr
        assert f'{pathlib.Path(folder).resolve()}/r4 man ' in pathlib.Path(folder, 'build.ninja').read_text()


def an_asio_that_is_too_old_is_named():
    with tempfile.TemporaryDirectory() as folder:
        header = pathlib.Path(folder, 'asio/version.hpp')
        header.parent.mkdir()
        header.write_text('#define ASIO_VERSION 101801 // 1.18.1\n')
        works, said = configure(f'-DASIO_INCLUDE_DIR={folder}')
    assert not works and 'Asio 1.22.1 or newer is needed' in said and folder in said, said


def the_oldest_cmake_is_enough():
    """Checks the versions in the files, because the installed CMake is newer."""
    assert json.loads((TREE / 'CMakePresets.json').read_text())['version'] <= 3
    files = subprocess.run(['find', TREE, '-name', 'build', '-prune', '-o', '-name', 'CMakeLists.txt', '-print', '-o', '-name',
                            '*.cmake', '-print'], capture_output=True, text=True, check=True).stdout.split('\n')[:-1]
    assert len(files) > 10, files
    newer = re.compile(r'find_package\([^)]*\bGLOBAL\b|CMAKE_FIND_PACKAGE_TARGETS_GLOBAL|^\s*block\(|PROPAGATE|'
                       r'cmake_file_api|JOB_SERVER_AWARE|\$<(LIST|PATH|BUILD_LOCAL_INTERFACE)[:>]', re.MULTILINE)
    for file in files:
        text = pathlib.Path(file).read_text()
        assert re.findall(r'cmake_minimum_required\(VERSION (\S+)\)', text) in ([], [OLDEST_CMAKE]), file
        assert not newer.search(text), (file, newer.search(text))


failed = 0
for test in (a_build_needs_no_library_of_what_it_leaves_out, a_missing_library_is_named_with_its_option_and_its_packages,
             missing_dygraphs_are_named_with_their_option_and_package,
             a_cross_build_makes_the_manual_by_the_r4_that_it_built, an_asio_that_is_too_old_is_named, the_oldest_cmake_is_enough):
    name = test.__name__.replace('_', ' ')
    try:
        test()
        print(f'passed: {name}')
    except AssertionError as error:
        print(f'failed: {name}: {error}')
        failed += 1
sys.exit(failed > 0)
