# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the Python package (PEP 517) with only cmake and Python, so without a network.

The module links libraries of the system (tools/setup --python), so this wheel is for the same system. tools/wheel makes
a wheel that carries its libraries. R4_BUILD=FOLDER takes the package from this build folder, and builds it if needed.
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
import time
import zipfile

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / 'pyproject.toml').read_text())['project']
VERSION = re.search(r'R4LINK_VERSION "([^"]+)"', (ROOT / 'include/r4link/config.hpp').read_text())[1]
NAME = f'{PROJECT["name"]}-{VERSION}'
INFO = f'{NAME}.dist-info'
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
        sys.exit(f'{ended.stdout}\n{" ".join(command)} failed\n  fix: install the tools of the build: tools/setup --python')


def configure(folder):
    """Configures a build of the package alone. The build contains no folder names."""
    folder = pathlib.Path(folder).resolve()
    flags = f'{os.environ.get("CXXFLAGS", "")} -ffile-prefix-map={ROOT}/= -ffile-prefix-map={folder}/='
    _run('cmake', '-S', str(ROOT), '-B', str(folder), '-G', 'Ninja', '-DCMAKE_BUILD_TYPE=Release', '-DR4_TOOLS=OFF',
         '-DR4_TESTS=OFF', '-DR4_PYTHON=ON', f'-DCMAKE_CXX_FLAGS={flags}')


def _built():
    """Yields the package's files: (name, content)."""
    given = os.environ.get('R4_BUILD')
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(given or temporary)
        if not given:
            configure(folder)
        elif 'R4_PYTHON:BOOL=ON' not in (folder / 'CMakeCache.txt').read_text():  # tools/build leaves the package out
            _run('cmake', '-DR4_PYTHON=ON', str(folder))
        _run('cmake', '--build', str(folder), '--target', 'r4_python')
        package = folder / 'python'
        for path in sorted([*package.glob('r4link/*'), package / 'r4link_pytest.py']):
            if path.is_file():
                yield str(path.relative_to(package)), path.read_bytes()


def contents():
    """The content of a wheel without its tag: {name: content}."""
    entries = ''.join(f'[{group}]\n' + ''.join(f'{name} = {where}\n' for name, where in each.items())
                      for group, each in PROJECT['entry-points'].items())
    return {**dict(_built()), f'{INFO}/entry_points.txt': entries.encode(), f'{INFO}/METADATA': METADATA.encode(),
            f'{INFO}/LICENSE': (ROOT / 'LICENSE').read_bytes()}


def write_wheel(folder, files, platform):
    """The same files and SOURCE_DATE_EPOCH give the same bytes. Without SOURCE_DATE_EPOCH the files are of 1980."""
    python = f'cp{sys.version_info.major}{sys.version_info.minor}'
    tag = f'{python}-{python}-{platform}'
    about = f'Wheel-Version: 1.0\nGenerator: r4link\nRoot-Is-Purelib: false\nTag: {tag}\n'
    files = {**files, f'{INFO}/WHEEL': about.encode()}
    record = ''
    for name, content in sorted(files.items()):
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b'=').decode()
        record += f'{name},sha256={digest},{len(content)}\n'
    files[f'{INFO}/RECORD'] = f'{record}{INFO}/RECORD,,\n'.encode()
    epoch = max(int(os.environ.get('SOURCE_DATE_EPOCH', 0)), 315532800)  # 1980, the earliest time in a zip
    wheel = f'{NAME}-{tag}.whl'
    with zipfile.ZipFile(pathlib.Path(folder) / wheel, 'w', zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, time.gmtime(epoch)[:6])
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o100755 if '.so' in name else 0o100644) << 16
            archive.writestr(entry, content)
    return wheel


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    return write_wheel(wheel_directory, contents(), sysconfig.get_platform().replace('-', '_').replace('.', '_'))


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    sys.exit('r4link: the package cannot be installed with -e, because a part is compiled\n  fix: pip install . ; or, to work '
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
