# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the Python package (PEP 517) with nothing but cmake and Python itself, so also without a network.

The module links libraries of the system (tools/setup --python): the wheel is for this one. R4_BUILD=FOLDER takes the
package that is in that build folder, and builds it there if it is not.
"""
import base64
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']
VERSION = re.search(r'R4LINK_VERSION "([^"]+)"', (ROOT / 'include/r4link/config.hpp').read_text())[1]
NAME = f'{PROJECT["name"]}-{VERSION}'
METADATA = f"""Metadata-Version: 2.1
Name: {PROJECT['name']}
Version: {VERSION}
Summary: {PROJECT['description']}
License: {PROJECT['license']['text']}
Requires-Python: {PROJECT['requires-python']}
"""


def _run(*command):
    ended = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if ended.returncode != 0:
        sys.exit(f'{ended.stdout}\n{" ".join(command)} failed\n  fix: tools/setup --python installs what the build needs')


def configure(folder):
    """A build of the package alone."""
    _run('cmake', '-S', str(ROOT), '-B', str(folder), '-G', 'Ninja', '-DCMAKE_BUILD_TYPE=Release', '-DR4_TESTS=OFF',
         '-DR4_PYTHON=ON')


def _built():
    """The package's files: (name, content)."""
    given = os.environ.get('R4_BUILD')
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(given or temporary)
        if not given:
            configure(folder)
        elif 'R4_PYTHON:BOOL=ON' not in (folder / 'CMakeCache.txt').read_text():  # what tools/build leaves out
            _run('cmake', '-DR4_PYTHON=ON', str(folder))
        _run('cmake', '--build', str(folder), '--target', 'r4_python')
        package = folder / 'python'
        for path in sorted([*package.glob('r4link/*'), package / 'r4link_pytest.py']):
            if path.is_file():
                yield str(path.relative_to(package)), path.read_bytes()


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    python = f'cp{sys.version_info.major}{sys.version_info.minor}'
    tag = f'{python}-{python}-{sysconfig.get_platform().replace("-", "_").replace(".", "_")}'
    info = f'{NAME}.dist-info'
    entries = ''.join(f'[{group}]\n' + ''.join(f'{name} = {where}\n' for name, where in each.items())
                      for group, each in PROJECT['entry-points'].items())
    files = [*_built(), (f'{info}/entry_points.txt', entries.encode()), (f'{info}/METADATA', METADATA.encode()),
             (f'{info}/LICENSE', (ROOT / 'LICENSE').read_bytes()),
             (f'{info}/WHEEL', f'Wheel-Version: 1.0\nGenerator: r4link\nRoot-Is-Purelib: false\nTag: {tag}\n'.encode())]
    record = ''
    for name, content in files:
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b'=').decode()
        record += f'{name},sha256={digest},{len(content)}\n'
    files.append((f'{info}/RECORD', f'{record}{info}/RECORD,,\n'.encode()))
    wheel = f'{NAME}-{tag}.whl'
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / wheel, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, content in files:
            archive.writestr(name, content)
    return wheel


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    sys.exit('r4link: it cannot be installed with -e, because a part of it is compiled\n  fix: pip install . ; or, to work '
             'on it, cmake --build build --target r4_python, and PYTHONPATH=build/python')


def build_sdist(sdist_directory, config_settings=None):
    sdist = f'{NAME}.tar.gz'
    info = pathlib.Path(tempfile.mkdtemp()) / 'PKG-INFO'
    info.write_text(METADATA)
    with tarfile.open(pathlib.Path(sdist_directory) / sdist, 'w:gz', format=tarfile.PAX_FORMAT) as archive:
        archive.add(info, f'{NAME}/PKG-INFO')
        for name in ('CMakeLists.txt', 'CMakePresets.json', 'LICENSE', 'README.md', 'pyproject.toml', 'cmake', 'firmware',
                     'host', 'include', 'protocol', 'tools', 'transports'):
            archive.add(ROOT / name, f'{NAME}/{name}',
                        filter=lambda each: None if '__pycache__' in each.name else each)
    return sdist
