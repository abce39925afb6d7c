# SPDX-License-Identifier: GPL-3.0-or-later
# Toolchain file for Debian's cross compiler. R4_ARCH in the environment is arm64, armhf or amd64. The libraries of
# R4_ARCH are installed beside this machine's libraries (apt-get install libfmt-dev:arm64).
# `tools/on debian13/arm64 tools/build` sets R4_ARCH and this file.
set(CMAKE_SYSTEM_NAME Linux)
if("$ENV{R4_ARCH}" STREQUAL "arm64")
  set(CMAKE_SYSTEM_PROCESSOR aarch64)
  set(triplet aarch64-linux-gnu)
elseif("$ENV{R4_ARCH}" STREQUAL "armhf")
  set(CMAKE_SYSTEM_PROCESSOR armv7l)
  set(triplet arm-linux-gnueabihf)
elseif("$ENV{R4_ARCH}" STREQUAL "amd64")
  set(CMAKE_SYSTEM_PROCESSOR x86_64)
  set(triplet x86_64-linux-gnu)
else()
  message(FATAL_ERROR "R4_ARCH=$ENV{R4_ARCH} is not an architecture that is known: arm64, armhf or amd64")
endif()
set(CMAKE_C_COMPILER ${triplet}-gcc)
set(CMAKE_CXX_COMPILER ${triplet}-g++)
set(ENV{PKG_CONFIG_LIBDIR} /usr/lib/${triplet}/pkgconfig:/usr/share/pkgconfig)
