# SPDX-License-Identifier: GPL-3.0-or-later
# The installed library: target r4link::r4link, find_package(r4link) and pkg-config r4link.
include(CMakePackageConfigHelpers)

get_property(layers GLOBAL PROPERTY R4_LAYERS)
if(NOT layers)
  return()
endif()
add_library(r4link STATIC)
add_library(r4link::r4link ALIAS r4link)
foreach(layer IN LISTS layers)
  target_sources(r4link PRIVATE $<TARGET_OBJECTS:${layer}>)
endforeach()
set_target_properties(r4link PROPERTIES LINKER_LANGUAGE CXX)
target_compile_features(r4link PUBLIC cxx_std_20)
target_include_directories(r4link INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                           $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_compile_definitions(r4link PUBLIC ${R4_ASIO_DEFINITIONS})
target_link_libraries(r4link PUBLIC Threads::Threads
                      PRIVATE fmt::fmt PkgConfig::libserialport PkgConfig::libnl-route
                              PkgConfig::libdeflate)

install(TARGETS r4link EXPORT r4link-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY protocol transports firmware host
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/r4link
        FILES_MATCHING PATTERN "*.hpp" PATTERN "firmware/ports/giga" EXCLUDE
        PATTERN "firmware/ports/m7" EXCLUDE)
install(EXPORT r4link-targets NAMESPACE r4link::
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/r4link)

configure_package_config_file(cmake/r4link-config.cmake.in r4link-config.cmake
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/r4link)
write_basic_package_version_file(r4link-config-version.cmake COMPATIBILITY SameMinorVersion)
list(TRANSFORM R4_ASIO_DEFINITIONS PREPEND "-D" OUTPUT_VARIABLE asio_flags)
list(JOIN asio_flags " " asio_flags)
file(RELATIVE_PATH prefix_from_pc /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/r4link.pc.in r4link.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/r4link-config.cmake
              ${PROJECT_BINARY_DIR}/r4link-config-version.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/r4link)
install(FILES ${PROJECT_BINARY_DIR}/r4link.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
