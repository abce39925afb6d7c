#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Runs the commands in WITH_CAN_RUN, on Debian or Ubuntu. If this kernel supports vcan0, makes it, else installs
# the packages for the guest. WITH_CAN_OPTIONS has the options of tools/with-can.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
as_root=()
((EUID == 0)) || as_root=(sudo)

install() {
  local missing=() package
  for package in "$@"; do
    dpkg -s "$package" >/dev/null 2>&1 || missing+=("$package")
  done
  ((${#missing[@]})) || return 0
  "${as_root[@]}" apt-get -qq update
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "${missing[@]}"
}

have_vcan() { "${as_root[@]}" modprobe vcan && "${as_root[@]}" modprobe vxcan; } 2>/dev/null

read -ra options <<<"${WITH_CAN_OPTIONS-}"
install python3 iproute2
extra=linux-modules-extra-$(uname -r)
if [[ " ${options[*]} " != *' --guest '* ]] && { have_vcan || { (install "$extra") 2>/dev/null && have_vcan; }; }; then
  "${as_root[@]}" ip link add vcan0 type vcan 2>/dev/null || true
  "${as_root[@]}" ip link set vcan0 mtu 72 up
else
  install qemu-system-x86 busybox-static
fi
exec "$root/tools/with-can" "${options[@]}" bash -euo pipefail -c "$WITH_CAN_RUN"
