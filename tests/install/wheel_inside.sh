#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Installs the wheel in the folder of this script into a new environment, and drives a simulated board with it.
# Usage: wheel_inside.sh [PYTHON], in a system that needs only Python and its venv
# (tools/on debian13 --clean …; docs/how-to/packages.md).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"${1-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --no-index --disable-pip-version-check ./r4link-*-manylinux_*.whl
cd "$work"
venv/bin/python - <<'EOF'
import importlib.metadata
import pathlib

import r4link

with r4link.Board('sim:') as board:
    board.wait_active()
    board.arm()
    board.osmc(1).set(0.1)
    pwm = next(iter(board.states())).osmc1.pwm
    board.stop()

package = importlib.metadata.distribution('r4link')
files = {str(each) for each in package.files}
assert pwm == 410, pwm
assert package.version == r4link.__version__
assert list(importlib.metadata.entry_points(group='pytest11', name='r4link'))
assert {'r4link/py.typed', 'r4link/_core.pyi', 'r4link_pytest.py'} <= files, files
carried = [each for each in files if each.startswith('r4link.libs/')]
loaded = {line.split()[-1] for line in pathlib.Path('/proc/self/maps').read_text().splitlines() if '/' in line}
assert all(str(package.locate_file(each)) in loaded for each in carried), (carried, loaded)
assert sum(each.endswith('/copyright') for each in files) == len(carried)
print(f'wheel: {package.name} {package.version} drives a board; {len(carried)} libraries are its own')
EOF
