# SPDX-License-Identifier: GPL-3.0-or-later
# How a layer is built: r4_portable_layer(NAME FILES...) and r4_host_layer(NAME FILES...).
# Each makes an OBJECT library; cmake/library.cmake joins their objects into the library.

# Asio without Boost, its code compiled once (transports/asio.cpp). Whether Asio finds
# std::aligned_alloc depends on what was included before it: unless that is switched off, objects
# disagree on how handler memory is freed. Whoever uses r4link::asio needs all of these.
set(R4_ASIO_DEFINITIONS ASIO_STANDALONE ASIO_SEPARATE_COMPILATION ASIO_NO_DEPRECATED
    ASIO_DISABLE_STD_ALIGNED_ALLOC)

# Our warnings, for our own targets only. Asio, CLI11 and the like are system headers.
function(r4_warnings target)
  # clang has -Wsign-conversion in -Wconversion, and calls libstdc++'s own stable_sort() deprecated.
  set(warnings -Wall -Wextra -Wconversion -Wshadow)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    list(APPEND warnings -Wno-sign-conversion -Wno-deprecated-declarations)
  endif()
  # On 32-bit ARM, GCC notes in every use of std::sort that its calls are not those of GCC 6.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_SYSTEM_PROCESSOR MATCHES "^arm")
    list(APPEND warnings -Wno-psabi)
  endif()
  target_compile_options(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:${warnings}>")
endfunction()

# Finds the package that an option of ours needs. `needs_it` and `debian` are for people.
macro(r4_find_optional option package needs_it debian)
  find_package(${package} CONFIG QUIET)
  if(NOT ${package}_FOUND)
    message(FATAL_ERROR "${package} was not found, and ${needs_it} needs it.\n"
            "  fix: install it (Debian and Ubuntu: apt-get install ${debian}), "
            "or build without ${needs_it}: cmake -D${option}=OFF")
  endif()
endmacro()

# install(), unless another project has taken the tree in: it installs what it wants.
function(r4_install)
  if(R4_INSTALL)
    install(${ARGV})
  endif()
endfunction()

# Host code: C++20, the tree's root on the include path ("protocol/datagram/crc32.hpp").
function(r4_host_code target)
  r4_warnings(${target})
  target_compile_features(${target} PRIVATE cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_STANDARD 20 CXX_EXTENSIONS OFF)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/include)
endfunction()

function(r4_layer target)
  if(NOT ARGN)
    return()
  endif()
  add_library(${target} OBJECT ${ARGN})
  r4_warnings(${target})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/include)
  # A symbol that is unique in a process could not be local to the library.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  # Nobody replaces our functions from a shared library: they may be inlined nevertheless.
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON
                        CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_compile_options(${target} PRIVATE -fno-semantic-interposition)
  set_property(GLOBAL APPEND PROPERTY R4_LAYERS ${target})
endfunction()

# The files of a room are one for the compiler, which takes it 40 % less time: what is local to a file needs a name of
# its own in its room. r4_unity_by_room(TARGET FILES...): of the others each is compiled alone.
function(r4_unity_by_room target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${R4_UNITY} UNITY_BUILD_MODE GROUP)
  foreach(source IN LISTS ARGN)
    cmake_path(GET source PARENT_PATH room)
    cmake_path(RELATIVE_PATH room BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
    string(MAKE_C_IDENTIFIER ${room} group)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
  endforeach()
endfunction()

# What also compiles for the board: C++14 as GCC 7 has it, no exceptions, no RTTI.
function(r4_portable_layer target)
  r4_layer(${target} ${ARGN})
  if(TARGET ${target})
    set_target_properties(${target} PROPERTIES CXX_STANDARD 14 CXX_STANDARD_REQUIRED ON
                          CXX_EXTENSIONS ON)
    target_compile_options(${target} PRIVATE -fno-exceptions -fno-rtti)
  endif()
endfunction()

# What only a computer runs: C++20 on standalone Asio.
function(r4_host_layer target)
  r4_layer(${target} ${ARGN})
  if(TARGET ${target})
    set_target_properties(${target} PROPERTIES CXX_STANDARD 20 CXX_STANDARD_REQUIRED ON
                          CXX_EXTENSIONS OFF)
    # Asio makes itself visible otherwise, whatever the library exports.
    target_compile_definitions(${target} PRIVATE ${R4_ASIO_DEFINITIONS} ASIO_DISABLE_VISIBILITY)
    target_link_libraries(${target} PRIVATE Threads::Threads)
    # Read once instead of in every file; the files include what they need nevertheless, and clang-tidy sees
    # them without it.
    target_precompile_headers(${target} PRIVATE <algorithm> <asio/io_context.hpp> <chrono> <functional>
                              <memory> <optional> <string> <vector>)
    r4_unity_by_room(${target} ${ARGN})
  endif()
endfunction()
