# Most of the time that a file takes to compile, its headers take: where files are compiled one by one, those of
# libraries are parsed once for many of them. Not in clang's preset, which sees whether each file includes what it
# needs.
option(AFTERGLOW_PRECOMPILED_HEADERS "Parse headers of libraries once: half the time to build" ON)

# Of each variant: afterglow_headers, with CLI11 and JSON as well afterglow_program_headers; of tests
# afterglow_test_headers. Targets that take them have the same flags and at least the same definitions.
function(afterglow_add_headers name)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "LIBRARIES;HEADERS")
    if(CMAKE_UNITY_BUILD OR NOT AFTERGLOW_PRECOMPILED_HEADERS)
        return()
    endif()
    set(empty ${CMAKE_BINARY_DIR}/generated/empty.cpp)
    if(NOT EXISTS ${empty})
        file(WRITE ${empty} "")
    endif()
    add_library(${name} OBJECT EXCLUDE_FROM_ALL ${empty})
    target_link_libraries(${name} PRIVATE Eigen3::Eigen ${arg_LIBRARIES} afterglow::warnings)
    target_precompile_headers(${name} PRIVATE ${arg_HEADERS}
        <Eigen/Geometry> <algorithm> <array> <chrono> <cmath> <cstdint> <cstdio> <filesystem> <functional>
        <limits> <map> <memory> <numeric> <optional> <span> <string> <utility> <vector>)
endfunction()

# Lets the target take the headers that were parsed as `headers`, if they were.
function(afterglow_use_headers target headers)
    get_target_property(together ${target} UNITY_BUILD)
    if(TARGET ${headers} AND NOT together)
        target_precompile_headers(${target} REUSE_FROM ${headers})
    endif()
endfunction()
