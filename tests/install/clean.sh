#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Installs, uses and removes the files in FOLDER for this system: the wheel, the .debs, or both. Usage: clean.sh FOLDER
# As root in a minimal system: tools/on debian13/arm64 --clean --see FOLDER tests/install/clean.sh FOLDER
set -euo pipefail
tree=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
folder=$(realpath "$1")
work=$(mktemp -d)
chmod 755 "$work"
export DEBIAN_FRONTEND=noninteractive
quietly() {
  "$@" >"$work/log" 2>&1 || {
    tail -n 20 "$work/log"
    echo "clean: '$*' failed"
    exit 1
  }
}

compgen -G "$folder/*.whl" >/dev/null || compgen -G "$folder/*.deb" >/dev/null || {
  echo "clean: $folder has neither a wheel nor packages"
  exit 1
}
quietly apt-get update
if compgen -G "$folder/*.whl" >/dev/null; then
  quietly apt-get install -y --no-install-recommends -o DPkg::Options::=--force-unsafe-io python3-venv
  python=$(python3 -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
  cp "$folder"/r4link-*-"$python"-*_"$(uname -m)".whl "$tree/tests/install/wheel_inside.sh" "$work"
  "$work/wheel_inside.sh"
fi
# shellcheck source=/dev/null
release=$(. /etc/os-release && printf '%s%s' "$ID" "$VERSION_ID")
arch=$(dpkg --print-architecture)
if compgen -G "$folder/*.deb" >/dev/null; then
  cp "$folder"/*+"$release"_"$arch".deb "$tree/tests/install/packages_inside.sh" "$work"
  # A cross build makes no documentation package: one package is for all architectures.
  find "$folder" -maxdepth 1 -name "r4link-doc_*+${release}_all.deb" -exec cp {} "$work" \;
  cp -r "$tree/docs/examples/drive" "$work"
  "$work/packages_inside.sh" --apt
fi
left=$(find /etc /usr /var -name '*r4link*' -o -name '70-r4.rules' -o -name 'r4-*@.service')
if [[ -n "$left" ]]; then
  printf 'clean: purging them leaves\n%s\n' "$left"
  exit 1
fi
echo "clean: $release $arch: installed, used, and nothing is left"
