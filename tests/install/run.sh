#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# The installed library is enough for a program outside the tree. Usage: run.sh SOURCE BUILD
# Installs BUILD into a new prefix, copies docs/examples elsewhere, builds drive with find_package and
# with pkg-config and teleop with find_package, runs them, and what the documentation shows, and
# compiles every installed header.
set -euo pipefail

source_tree=$(realpath "$1")
build_tree=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
prefix=$work/prefix
cxx=$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' "$build_tree/CMakeCache.txt")

cmake --install "$build_tree" --prefix "$prefix" >"$work/install.log" 2>&1 || {
  tail -n 5 "$work/install.log"
  exit 1
}
cp -r "$source_tree/docs/examples/drive" "$source_tree/docs/examples/teleop" "$work"
cd "$work/drive"

# check NAME COMMAND...: the program must end well and say what the README promises.
check() {
  local name=$1
  shift
  "$@" >"$work/out" 2>&1 || {
    cat "$work/out"
    echo "install: $name failed"
    exit 1
  }
  for words in 'board sim-1' 'OSMC 1 at 1000 forward' 'motor 1 has turned by [1-9]' \
    'link: safe, reason stop' ' us round trip'; do
    grep -q "$words" "$work/out" || {
      cat "$work/out"
      echo "install: $name did not print '$words'"
      exit 1
    }
  done
  echo "install: $name: $(grep ' us round trip' "$work/out")"
}

cmake -B build -DCMAKE_CXX_COMPILER="$cxx" -DCMAKE_PREFIX_PATH="$prefix" >"$work/cmake.log"
cmake --build build >>"$work/cmake.log" || {
  cat "$work/cmake.log"
  exit 1
}
check find_package build/drive

cmake -S ../teleop -B ../teleop/build -DCMAKE_CXX_COMPILER="$cxx" -DCMAKE_PREFIX_PATH="$prefix" >"$work/cmake.log"
cmake --build ../teleop/build >>"$work/cmake.log" || {
  cat "$work/cmake.log"
  exit 1
}
R4=$build_tree/r4 /usr/bin/python3 "$source_tree/tests/install/teleop.py" ../teleop/build/teleop

PKG_CONFIG_PATH=$(dirname "$(find "$prefix" -name r4link.pc)")
export PKG_CONFIG_PATH
read -ra flags <<<"$(pkg-config --cflags --libs r4link)"
"$cxx" -std=c++20 -O1 main.cpp "${flags[@]}" -o drive
check pkg-config ./drive sim:?node=1

# program_of PAGE: the C++ that the page shows, as a whole program.
program_of() {
  awk '/^```/ { inside = /cpp/; next } inside' "$1" >shown.txt
  grep '^#include' shown.txt
  echo 'int main() {'
  grep -v '^#include' shown.txt
  echo '}'
}

# The program in README.md drives a simulated robot, whose motors have supply only while relay 1 is
# closed.
mkfifo "$work/board"
"$build_tree/r4" sim --json --duration 30 udp://127.0.0.1:0 >"$work/board" &
board=$!
exec 3<"$work/board"
read -r listening <&3
cat <&3 >"$work/events" &
events=$!
url=${listening#*\"host_url\":\"}
url="${url%%\"*}?listen=0"
program_of "$source_tree/README.md" | sed "s,udp://192.168.0.125,$url," >readme.cpp
"$cxx" -std=c++20 -O1 readme.cpp "${flags[@]}" -o readme
./readme
kill "$board"
wait "$board" "$events"
if ! grep '"osmc":\[\[358,1\]' "$work/events" | grep -q '"supply":true'; then
  cut -c 1-200 "$work/events"
  echo 'install: the program in README.md drives a motor that has no supply'
  exit 1
fi
echo 'install: README.md drives a motor'

program_of "$source_tree/docs/simulation.md" >simulation.cpp
"$cxx" -std=c++20 -O1 simulation.cpp "${flags[@]}" -o simulation
./simulation || {
  echo 'install: the program in docs/simulation.md did not see what it says'
  exit 1
}

status=0
./drive fax:1 >/dev/null 2>"$work/err" || status=$?
if [[ $status != 2 ]] || ! grep -q 'udp://HOST' "$work/err"; then
  echo "install: 'drive fax:1' ended with $status: $(cat "$work/err")"
  exit 1
fi

# Every installed header, in one program.
(cd "$prefix/include" && find r4link -name '*.hpp' | sort | sed 's/.*/#include <&>/') >all.cpp
read -ra flags <<<"$(pkg-config --cflags r4link)"
"$cxx" -std=c++20 -fsyntax-only "${flags[@]}" all.cpp || {
  echo "install: an installed header does not compile"
  exit 1
}
echo "install: $(wc -l <all.cpp) headers"
