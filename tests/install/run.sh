#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# The installed library is enough for a program outside the tree. Usage: run.sh SOURCE BUILD
# Installs BUILD into a new prefix and copies docs/examples elsewhere. Builds and runs drive with find_package (static)
# and with pkg-config (shared), and openpodcar and teleop with find_package. Also runs programs with a separate Asio, and
# the programs in the documentation. Compiles every installed header alone, and compares the exported symbols of the
# library with exports.txt.
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
cp -r "$source_tree/docs/examples/drive" "$source_tree/docs/examples/openpodcar" "$source_tree/docs/examples/teleop" \
  "$work"
cd "$work/drive"

# tools/test gives this script only the time that other tests leave. A program that drives is late without its time.
on_time=()
if chrt --other 0 true 2>/dev/null; then on_time=(chrt --other 0); fi

# check NAME COMMAND...: the program must succeed and print the lines that the README shows.
check() {
  local name=$1
  shift
  "${on_time[@]}" "$@" >"$work/out" 2>&1 || {
    cat "$work/out"
    echo "install: $name failed"
    exit 1
  }
  for words in 'board sim-1' 'OSMC 1 at  819 forward' 'motor 1 has turned by [1-9]' \
    'link: active' ' us round trip'; do
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
R4=$build_tree/r4 "${on_time[@]}" /usr/bin/python3 "$source_tree/tests/install/teleop.py" ../teleop/build/teleop

# r4 finds the separate program of r4 ros2.
ros2=
grep -q '^R4_ROS2:BOOL=ON' "$build_tree/CMakeCache.txt" && ros2=yes
[[ -z $ros2 ]] || ROS_LOCALHOST_ONLY=1 "$prefix/bin/r4" ros2 sim: --duration 0.1 >"$work/out" 2>&1 || {
  cat "$work/out"
  echo 'install: r4 ros2 fails'
  exit 1
}
cmake -S ../openpodcar -B ../openpodcar/build -DCMAKE_CXX_COMPILER="$cxx" -DCMAKE_PREFIX_PATH="$prefix" >"$work/cmake.log"
cmake --build ../openpodcar/build >>"$work/cmake.log" || {
  cat "$work/cmake.log"
  exit 1
}
if ! echo | "${on_time[@]}" ../openpodcar/build/openpodcar 1,0 >"$work/out" 2>&1 || ! grep -q '^arrived' "$work/out"; then
  echo "install: openpodcar does not arrive: $(cat "$work/out")"
  exit 1
fi
status=2
[[ -z $ros2 ]] || {
  status=0
  ../openpodcar/build/openpodcar_ros2 fax:1 >"$work/out" 2>&1 || status=$?
}
if [[ $status != 2 ]]; then
  echo "install: 'openpodcar_ros2 fax:1' ended with $status: $(cat "$work/out")"
  exit 1
fi

cp -r "$source_tree/tests/install/own_asio" "$work"
cmake -S ../own_asio -B ../own_asio/build -DCMAKE_CXX_COMPILER="$cxx" -DCMAKE_PREFIX_PATH="$prefix" >"$work/cmake.log"
cmake --build ../own_asio/build >>"$work/cmake.log" || {
  cat "$work/cmake.log"
  exit 1
}
for program in beside shared_with; do
  if ! ../own_asio/build/$program >"$work/out" || ! grep -q 'own Asio, board sim-1' "$work/out"; then
    echo "install: a program with an Asio of its own fails: $program: $(cat "$work/out")"
    exit 1
  fi
done
echo 'install: an Asio of its own disturbs nobody'

# A project that includes the tree gets only the library, needs no library of the tools, and does not install the tree.
without=(CLI11=ON CycloneDDS=ON GTest=ON rapidcheck=ON)
cmake -G Ninja -S "$source_tree/tests/install/subproject" -B "$work/subproject" -DR4LINK_SOURCE="$source_tree" \
  -DCMAKE_CXX_COMPILER="$cxx" "${without[@]/#/-DCMAKE_DISABLE_FIND_PACKAGE_}" >"$work/cmake.log" 2>&1 ||
  {
    cat "$work/cmake.log"
    echo 'install: a project that takes the tree in needs more than the library does'
    exit 1
  }
cmake --install "$work/subproject" --prefix "$work/installed" >"$work/out"
installed=$(cd "$work/installed" && find . -type f)
if [[ $installed != ./share/robot/main.cpp ]]; then
  echo "install: a project that takes the tree in installs $installed"
  exit 1
fi
echo 'install: another project can take the tree in'

PKG_CONFIG_PATH=$(dirname "$(find "$prefix" -name r4link.pc)")
LD_LIBRARY_PATH=$(dirname "$(find "$prefix" -name libr4link.so)")
export PKG_CONFIG_PATH LD_LIBRARY_PATH
read -ra flags <<<"$(pkg-config --cflags --libs r4link)"
"$cxx" -std=c++20 -O1 main.cpp "${flags[@]}" -o drive
check pkg-config ./drive sim:?node=1

# program_of PAGE: the C++ that the page shows, as a complete program.
program_of() {
  awk '/^```/ { inside = /cpp/; next } inside' "$1" >shown.txt
  grep '^#include' shown.txt
  echo 'int main() {'
  grep -v '^#include' shown.txt
  echo '}'
}

# The programs in README.md and in the quick start drive a simulated robot, whose motors have supply only
# while relay 1 is closed.
for page in README.md docs/start/quick-start.md; do
  rm -f "$work/board"
  mkfifo "$work/board"
  "$build_tree/r4" sim --json --duration 30 udp://127.0.0.1:0 >"$work/board" &
  board=$!
  exec 3<"$work/board"
  read -r listening <&3
  cat <&3 >"$work/events" &
  events=$!
  url=${listening#*\"host_url\":\"}
  url="${url%%\"*}?listen=0"
  program_of "$source_tree/$page" | sed -E "s,udp://(192.168.0.125|127.0.0.1),$url," >page.cpp
  "$cxx" -std=c++20 -O1 page.cpp "${flags[@]}" -o page
  ./page
  kill "$board"
  wait "$board" "$events"
  if ! grep '"osmc":\[\[410,1\]' "$work/events" | grep -q '"supply":true'; then
    cut -c 1-200 "$work/events"
    echo "install: the program in $page drives a motor that has no supply"
    exit 1
  fi
  echo "install: $page drives a motor"
done

program_of "$source_tree/docs/how-to/simulation.md" >simulation.cpp
"$cxx" -std=c++20 -O1 simulation.cpp "${flags[@]}" -o simulation
./simulation || {
  echo 'install: the program in docs/how-to/simulation.md did not see what it says'
  exit 1
}

program_of "$source_tree/docs/how-to/control.md" >control.cpp
"$cxx" -std=c++20 -O1 control.cpp "${flags[@]}" -o control
if ! "${on_time[@]}" ./control >control.txt || ! grep -q '^0\.[89].* m, 0\.[45].* m/s; the loop has ended: the step' control.txt; then
  echo "install: the program in docs/how-to/control.md does not control a speed: $(cat control.txt)"
  exit 1
fi

program_of "$source_tree/docs/how-to/fleet.md" >fleet.cpp
"$cxx" -std=c++20 -O1 fleet.cpp "${flags[@]}" -o fleet
if ! "${on_time[@]}" ./fleet >fleet.txt || [[ -s fleet.txt ]]; then
  echo "install: the program in docs/how-to/fleet.md did not command its boards: $(cat fleet.txt)"
  exit 1
fi

status=0
./drive fax:1 >/dev/null 2>"$work/err" || status=$?
if [[ $status != 2 ]] || ! grep -q 'udp://HOST' "$work/err"; then
  echo "install: 'drive fax:1' ended with $status: $(cat "$work/err")"
  exit 1
fi

read -ra flags <<<"$(pkg-config --cflags r4link-asio)"
headers=0
mapfile -t installed < <(find "$prefix/include/r4link" -name '*.hpp' | sort)
for header in "${installed[@]}"; do
  echo "#include <${header#"$prefix"/include/}>" >alone.cpp
  "$cxx" -std=c++20 -Wall -Wextra -Wpedantic -Wconversion -Werror -fsyntax-only "${flags[@]}" alone.cpp || {
    echo "install: ${header#"$prefix"/include/} does not compile alone"
    exit 1
  }
  headers=$((headers + 1))
done
public=$(find "$source_tree/include/r4link" -name '*.hpp' | wc -l)
if [[ $headers != "$public" ]]; then
  echo "install: of $public public headers $headers are installed"
  exit 1
fi
if grep -rl asio "$prefix"/include/r4link | grep -vE '/async_[a-z]+\.hpp$' |
  xargs -r grep -n '#include.*asio'; then
  echo 'install: a header of the blocking API includes Asio'
  exit 1
fi
echo "install: $headers headers"

# The shared library exports only our names, and templates of the standard library, as any program does.
nm -DC --defined-only "$LD_LIBRARY_PATH/libr4link.so" | cut -d' ' -f3- |
  grep -vE '^((typeinfo|typeinfo name|vtable|guard variable) for |[a-z]+ )?std::' | LC_ALL=C sort -u >exports.txt
diff "$source_tree/tests/install/exports.txt" exports.txt || {
  echo 'install: the shared library exports other names than tests/install/exports.txt lists'
  exit 1
}
# The static library has no other names, because these could conflict with names of the program.
nm -C --defined-only -g "$LD_LIBRARY_PATH/libr4link.a" | grep -E '^[0-9a-f]+ ' | cut -d' ' -f3- |
  grep -vE '^((typeinfo|typeinfo name|vtable|guard variable) for |[a-z]+ )?std::' | LC_ALL=C sort -u >globals.txt
strangers=$(comm -13 exports.txt globals.txt)
if [[ -n "$strangers" ]]; then
  echo "install: libr4link.a has global names that libr4link.so does not export: $strangers"
  exit 1
fi
echo "install: $(wc -l <exports.txt) exports"
