# SPDX-License-Identifier: GPL-3.0-or-later
# The installed library, in three forms of the same objects:
#   r4link::r4link   libr4link.a: include/r4link without async_*.hpp. Only symbols with R4LINK_API are global. The
#                    library's Asio is local, so it does not conflict with an Asio of the program.
#   r4link::shared   libr4link.so: the same as a shared library
#   r4link::asio     libr4link-asio.a: also AsyncBoard and async_discover(). This form uses the program's Asio.
#
# A program links one of these libraries, by find_package(r4link), or by pkg-config r4link and r4link-asio.
include(CMakePackageConfigHelpers)

get_property(layers GLOBAL PROPERTY R4_LAYERS)
set(objects)
foreach(layer IN LISTS layers)
  list(APPEND objects $<FILTER:$<TARGET_OBJECTS:${layer}>,EXCLUDE,[.]gch$>)  # without the precompiled header
endforeach()
set(needed fmt::fmt PkgConfig::libserialport PkgConfig::libnl-route PkgConfig::libdeflate
    PkgConfig::libzstd)

# With COMDAT groups the linker could use a copy from another object instead of the local symbol.
set(joined ${PROJECT_BINARY_DIR}/r4link.o)
add_custom_command(
  OUTPUT ${joined}
  COMMAND ${CMAKE_CXX_COMPILER} -r -nostdlib -Wl,--force-group-allocation -o ${joined} ${objects}
  COMMAND ${CMAKE_OBJCOPY} --localize-hidden ${joined}
  DEPENDS ${objects} COMMAND_EXPAND_LISTS VERBATIM)
add_library(r4link STATIC ${joined})
set_source_files_properties(${joined} PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
add_library(r4link_shared SHARED ${objects})
set_target_properties(r4link_shared PROPERTIES EXPORT_NAME shared OUTPUT_NAME r4link
                      VERSION ${PROJECT_VERSION}
                      SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
target_link_options(r4link_shared PRIVATE -Wl,--no-undefined -Wl,--as-needed)
add_library(r4link_asio STATIC ${objects})
set_target_properties(r4link_asio PROPERTIES EXPORT_NAME asio OUTPUT_NAME r4link-asio)
target_compile_definitions(r4link_asio INTERFACE ${R4_ASIO_DEFINITIONS})

foreach(target r4link r4link_shared r4link_asio)
  set_target_properties(${target} PROPERTIES LINKER_LANGUAGE CXX)
  target_compile_features(${target} INTERFACE cxx_std_20)
  target_include_directories(${target} INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(${target} PUBLIC Threads::Threads PRIVATE ${needed})
endforeach()
add_library(r4link::r4link ALIAS r4link)
add_library(r4link::shared ALIAS r4link_shared)
add_library(r4link::asio ALIAS r4link_asio)

r4_install(TARGETS r4link r4link_shared r4link_asio EXPORT r4link-targets
           LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
r4_install(DIRECTORY include/r4link DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/r4link)
r4_install(EXPORT r4link-targets NAMESPACE r4link:: DESTINATION ${package})
configure_package_config_file(cmake/r4link-config.cmake.in r4link-config.cmake
                              INSTALL_DESTINATION ${package})
write_basic_package_version_file(r4link-config-version.cmake COMPATIBILITY SameMinorVersion)
r4_install(FILES ${PROJECT_BINARY_DIR}/r4link-config.cmake
                 ${PROJECT_BINARY_DIR}/r4link-config-version.cmake DESTINATION ${package})

list(TRANSFORM R4_ASIO_DEFINITIONS PREPEND "-D" OUTPUT_VARIABLE asio_flags)
list(JOIN asio_flags " " asio_flags)
file(RELATIVE_PATH prefix_from_pc /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
foreach(name r4link r4link-asio)
  configure_file(cmake/${name}.pc.in ${name}.pc @ONLY)
  r4_install(FILES ${PROJECT_BINARY_DIR}/${name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endforeach()
