#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# Tests the Debian packages. Usage: packages.sh SOURCE BUILD
# Makes packages of the build in BUILD, runs lintian, and installs the packages into a copy of this system. Uses the
# packages there (packages_inside.sh) and purges them. No file may remain. The copy is an overlay over the files of this
# system. An overlay needs root or user namespaces.
set -euo pipefail

source_tree=$(realpath "$1")
build_tree=$(realpath "$2")

if [[ -z "${R4_INSIDE_NAMESPACE-}" ]]; then
  "$source_tree/tools/package" --built "$build_tree"
  lintian --fail-on error,warning --tag-display-limit 0 --allow-root "$build_tree"/packed/*.changes
  echo 'packages: lintian finds nothing'
  as_root=()
  ((EUID == 0)) || as_root=(--map-root-user)
  # A new network namespace, which cannot reach the ports and boards of this network.
  R4_INSIDE_NAMESPACE=1 exec unshare "${as_root[@]}" --mount --net --pid --fork --kill-child "$0" "$@"
fi

copy=$(mktemp -d)
mount -t tmpfs tmpfs "$copy"
mkdir "$copy/changed" "$copy/work" "$copy/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$copy/changed,workdir=$copy/work" "$copy/root" || {
  echo 'packages: no overlay of / can be mounted: run as root, or where users may mount in namespaces' >&2
  exit 1
}
trap 'umount -R "$copy" && rmdir "$copy"' EXIT
for folder in tmp run dev; do
  mount -t tmpfs tmpfs "$copy/root/$folder"
done
mount -t proc proc "$copy/root/proc"
# The copy has its own devices, so that the packages cannot reach the devices of this system.
for device in null zero full random urandom; do
  touch "$copy/root/dev/$device"
  mount --bind "/dev/$device" "$copy/root/dev/$device"
done
mkdir "$copy/root/dev/pts" "$copy/root/dev/shm"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$copy/root/dev/pts"
ln -s pts/ptmx "$copy/root/dev/ptmx"
ln -s /proc/self/fd "$copy/root/dev/fd"
ip link set lo up
mkdir "$copy/root/tmp/packages"
cp "$build_tree"/packed/*.deb "$source_tree/tests/install/packages_inside.sh" "$copy/root/tmp/packages"
cp -r "$source_tree/docs/examples/drive" "$copy/root/tmp/packages"
# Small images configure dpkg to omit manual pages.
rm -f "$copy"/root/etc/dpkg/dpkg.cfg.d/*

env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 chroot "$copy/root" /tmp/packages/packages_inside.sh

# Tools of the system write lists of packages, libraries and manual pages, which may remain.
left=$(cd "$copy/changed" && find . \( -type f -o -type l \) ! -path './var/lib/dpkg/*' ! -path './var/log/*' \
  ! -path './var/cache/*' ! -path './etc/ld.so.cache' ! -path './etc/.pwd.lock' ! -path './root/*')
if [[ -n "$left" ]]; then
  printf 'packages: purging them leaves\n%s\n' "$left"
  exit 1
fi
echo 'packages: purging them leaves nothing'
