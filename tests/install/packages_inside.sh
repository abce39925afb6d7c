#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Installs the packages in its folder, uses each, and purges them. packages.sh runs it in a copy of the system. In a
# minimal system clean.sh runs it with --apt, which also installs the dependencies and the programs of the steps.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

# step NAME COMMAND...: shows the output of the command if it fails.
step() {
  local name=$1
  shift
  "$@" >"$PWD/out" 2>&1 || {
    tail -n 30 "$PWD/out"
    echo "packages: $name failed"
    exit 1
  }
  printf '%5ds  packages: %s\n' "$SECONDS" "$name"
}

if [[ "${1-}" == --apt ]]; then
  export DEBIAN_FRONTEND=noninteractive
  apt=(apt-get -q -y --no-install-recommends -o DPkg::Options::=--force-unsafe-io)
  step 'install' "${apt[@]}" install ./*.deb
  step 'what the steps use' "${apt[@]}" install bash-completion cmake fish g++ libasio-dev make man-db systemd tshark udev zsh
else
  step 'install' dpkg --force-unsafe-io --install ./*.deb
fi

step 'man r4-send' bash -c "MANPAGER=cat man r4-send | grep -q 'until the board confirms'"
completes() {
  bash -c 'source /usr/share/bash-completion/completions/r4; complete -p r4'
  fish --no-config -c 'complete -C "r4 mo"' | grep -q '^monitor'
  zsh -n /usr/share/zsh/vendor-completions/_r4
}
step 'completions' completes
units_are_safe() {
  local unit
  for unit in r4-record@left-arm.service r4-bridge@usb.service; do
    systemd-analyze verify "$unit"
    systemd-analyze security --offline=true --threshold=25 "$unit"
  done
}
step 'r4-record@.service and r4-bridge@.service are whole, and expose little' units_are_safe
udev_rules_are_valid() {
  local rules=/usr/lib/udev/rules.d/70-r4.rules
  grep -q 'MODE="0660"' "$rules"
  # udevadm has `verify` since systemd 254.
  ! udevadm verify --help >/dev/null || udevadm verify "$rules"
}
step 'udev rules' udev_rules_are_valid
wireshark_knows_it() {
  # Wireshark 4.4 loads no Lua for root, and prints more columns.
  setpriv --reuid=65534 --regid=65534 --clear-groups tshark -G protocols | grep -P '\tr4(\t|$)'
}
step 'Wireshark' wireshark_knows_it

python_drives() {
  python3 -c '
import importlib.metadata, r4link
assert list(importlib.metadata.entry_points(group="pytest11", name="r4link"))
assert r4link.__file__.startswith("/usr/lib/python3"), r4link.__file__
with r4link.Board("sim:") as board:
    board.wait_active()
    board.arm()
    board.osmc(1).set(0.1)'
}
step 'python3-r4link drives a board' python_drives

in_cpp() {
  cmake -S drive -B drive/build -DCMAKE_BUILD_TYPE=Release
  cmake --build drive/build
  drive/build/drive 'sim:?node=1'
  local libraries
  read -ra libraries <<<"$(pkg-config --libs r4link)"
  g++ -o drive/shared drive/build/CMakeFiles/drive.dir/main.cpp.o "${libraries[@]}"
  ldd drive/shared | grep -q 'libr4link.so.0.2 => /lib/'
  drive/shared 'sim:?node=1'
}
step 'a C++ program is built by CMake and by pkg-config, and drives a board' in_cpp

mapfile -t packages < <(for each in ./*.deb; do dpkg-deb --field "$each" Package; done)
if [[ " ${packages[*]} " == *' r4link-doc '* ]]; then
  test -s /usr/share/doc/r4link-doc/html/index.html
  test -s /usr/share/doc/r4link-doc/html/api/board_8hpp.html
fi

# Exit code 3 is accepted: the demo's bounds hold only on an idle machine, and integration/test_demo.py asserts them.
demo() {
  r4 demo >demo.txt || [[ $? == 3 ]] || return 1
  [[ $(grep -cE '^  (in process|UDP|serial)  .* (ok|NOT OK)$' demo.txt) == 3 ]]
}
step 'r4 demo' demo

step 'purge' dpkg --force-unsafe-io --purge "${packages[@]}"
