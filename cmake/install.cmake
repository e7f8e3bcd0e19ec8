# What `cmake --install` copies, in two components: the programs, and what other programs are built with.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# ---- programs, with pages and completion that they write themselves
install(TARGETS afterglow afterglow-view RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
if(AFTERGLOW_FAST_PROGRAMS)
    cmake_path(SET fast_destination NORMALIZE ${CMAKE_INSTALL_BINDIR}/${fast_folder})
    install(TARGETS afterglow_fast afterglow-view_fast RUNTIME DESTINATION ${fast_destination} COMPONENT programs)
endif()

find_program(GZIP gzip REQUIRED)
set(written "")
foreach(program afterglow afterglow-view)
    set(page ${CMAKE_BINARY_DIR}/manual/${program}.1)
    set(completion ${CMAKE_BINARY_DIR}/completion/${program})
    add_custom_command(OUTPUT ${page} ${page}.gz ${completion}
        COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_BINARY_DIR}/manual ${CMAKE_BINARY_DIR}/completion
        COMMAND ${program} --manual > ${page}
        COMMAND ${GZIP} -9nkf ${page} # no name and time inside: the same bytes each time
        COMMAND ${program} --completion > ${completion}
        DEPENDS ${program} VERBATIM)
    list(APPEND written ${page} ${completion})
    install(FILES ${page}.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs)
    install(FILES ${completion} DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT programs)
endforeach()
add_custom_target(manual ALL DEPENDS ${written})

install(FILES README.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/afterglow COMPONENT programs)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/afterglow COMPONENT programs PATTERN example EXCLUDE)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/afterglow RENAME copyright COMPONENT programs)

# ---- libraries and headers
foreach(library core basis transport)
    set_target_properties(afterglow_${library}${portable} PROPERTIES
        EXPORT_NAME ${library} OUTPUT_NAME afterglow_${library})
    install(TARGETS afterglow_${library}${portable} EXPORT AfterglowTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
    install(DIRECTORY ${library} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/afterglow COMPONENT development
        FILES_MATCHING PATTERN "*.h"
        PATTERN "embree.h" EXCLUDE # of surface.cpp alone
        PATTERN "command_*" EXCLUDE PATTERN "cli_options.h" EXCLUDE # of the programs
        PATTERN "manual.h" EXCLUDE PATTERN "processor.h" EXCLUDE PATTERN "program.h" EXCLUDE)
endforeach()
# Headers name each other as "core/scene.h".
target_include_directories(afterglow_core${portable} INTERFACE
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/afterglow>)
target_compile_definitions(afterglow_core${portable} INTERFACE "$<INSTALL_INTERFACE:${portable_eigen}>")
target_compile_features(afterglow_core${portable} INTERFACE cxx_std_20)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/Afterglow)
install(EXPORT AfterglowTargets NAMESPACE afterglow:: DESTINATION ${package} COMPONENT development)
configure_package_config_file(cmake/AfterglowConfig.cmake.in ${CMAKE_BINARY_DIR}/AfterglowConfig.cmake
    INSTALL_DESTINATION ${package})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/AfterglowConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/AfterglowConfig.cmake ${CMAKE_BINARY_DIR}/AfterglowConfigVersion.cmake
    DESTINATION ${package} COMPONENT development)
install(DIRECTORY docs/example DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/afterglow/docs COMPONENT development)

# ---- Debian packages: `cpack -G DEB`
set(CPACK_PACKAGE_NAME afterglow)
set(CPACK_PACKAGE_VENDOR "Afterglow")
set(CPACK_PACKAGE_CONTACT "The Afterglow developers <afterglow@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Precomputed indirect light for static scenes")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_COMPONENTS_ALL programs development)
set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION
    "Computes the indirect light of a scene ahead of time, so that it can be had in an instant for any light and from any viewpoint. This package has the programs afterglow and afterglow-view.")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "Computes the indirect light of a scene ahead of time, so that it can be had in an instant for any light and from any viewpoint. This package has static libraries and headers.")
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME afterglow)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SUGGESTS "python3-matplotlib") # draws the figures of `afterglow chart`
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libafterglow-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libeigen3-dev, libembree-dev, libopenexr-dev, libtbb-dev, libtinyobjloader-dev, libxxhash-dev, pkg-config")
include(CPack)
