# SPDX-License-Identifier: GPL-3.0-or-later
# r4_portable_layer(NAME FILES...) and r4_host_layer(NAME FILES...) build a layer as an OBJECT library.
# cmake/library.cmake joins the objects of all layers into the library.

# Asio without Boost, compiled once (transports/asio.cpp). Headers that come before Asio decide whether Asio detects
# std::aligned_alloc, so object files could differ in how they free handler memory. The last definition switches the
# detection off. A program that links r4link::asio needs all these definitions.
set(R4_ASIO_DEFINITIONS ASIO_STANDALONE ASIO_SEPARATE_COMPILATION ASIO_NO_DEPRECATED
    ASIO_DISABLE_STD_ALIGNED_ALLOC)

# The warnings for targets of this project. Headers of other projects are system headers.
function(r4_warnings target)
  # clang's -Wconversion includes -Wsign-conversion, and clang reports a deprecation inside libstdc++'s stable_sort().
  set(warnings -Wall -Wextra -Wconversion -Wshadow)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    list(APPEND warnings -Wno-sign-conversion -Wno-deprecated-declarations)
  endif()
  # On 32-bit ARM, GCC reports at each std::sort that the calling convention differs from GCC 6.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_SYSTEM_PROCESSOR MATCHES "^arm")
    list(APPEND warnings -Wno-psabi)
  endif()
  target_compile_options(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:${warnings}>")
endfunction()

# Finds the package that an option needs. `needs_it` and `debian` are for the error message.
macro(r4_find_optional option package needs_it debian)
  find_package(${package} CONFIG QUIET)
  if(NOT ${package}_FOUND)
    message(FATAL_ERROR "${package} was not found, and ${needs_it} needs it.\n"
            "  fix: install it (Debian and Ubuntu: apt-get install ${debian}), "
            "or build without ${needs_it}: cmake -D${option}=OFF")
  endif()
endmacro()

# Calls install() only if R4_INSTALL is on: a project that includes the tree decides what it installs.
function(r4_install)
  if(R4_INSTALL)
    install(${ARGV})
  endif()
endfunction()

# Host code: C++20, with the tree's root on the include path ("protocol/datagram/crc32.hpp").
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
  # A symbol that is unique in the process (STB_GNU_UNIQUE) cannot be local to the library.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
  # -fno-semantic-interposition: no program replaces functions of the shared library, so the compiler may inline them.
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON
                        CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_compile_options(${target} PRIVATE -fno-semantic-interposition)
  set_property(GLOBAL APPEND PROPERTY R4_LAYERS ${target})
endfunction()

# r4_unity_by_room(TARGET FILES...): compiles FILES of one room (folder) as one source, which takes 40 % less time. So
# names that are local to a file must be unique in their room. Each other file of TARGET is compiled alone.
function(r4_unity_by_room target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${R4_UNITY} UNITY_BUILD_MODE GROUP)
  foreach(source IN LISTS ARGN)
    cmake_path(GET source PARENT_PATH room)
    cmake_path(RELATIVE_PATH room BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
    string(MAKE_C_IDENTIFIER ${room} group)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
  endforeach()
endfunction()

# Code that also compiles for the board: C++14 of GCC 7, without exceptions and RTTI.
function(r4_portable_layer target)
  r4_layer(${target} ${ARGN})
  if(TARGET ${target})
    set_target_properties(${target} PROPERTIES CXX_STANDARD 14 CXX_STANDARD_REQUIRED ON
                          CXX_EXTENSIONS ON)
    target_compile_options(${target} PRIVATE -fno-exceptions -fno-rtti)
  endif()
endfunction()

# Code that only a host runs: C++20 with standalone Asio.
function(r4_host_layer target)
  r4_layer(${target} ${ARGN})
  if(TARGET ${target})
    set_target_properties(${target} PROPERTIES CXX_STANDARD 20 CXX_STANDARD_REQUIRED ON
                          CXX_EXTENSIONS OFF)
    # Without ASIO_DISABLE_VISIBILITY the library would export Asio's symbols.
    target_compile_definitions(${target} PRIVATE ${R4_ASIO_DEFINITIONS} ASIO_DISABLE_VISIBILITY)
    target_link_libraries(${target} PRIVATE Threads::Threads)
    # These headers are compiled once. Each file must also include the headers that it uses, for clang-tidy.
    target_precompile_headers(${target} PRIVATE <algorithm> <asio/io_context.hpp> <chrono> <functional>
                              <memory> <optional> <string> <vector>)
    r4_unity_by_room(${target} ${ARGN})
  endif()
endfunction()
