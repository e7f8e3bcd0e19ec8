# From the folder of a program to that of its faster twin, before and after installation.
set(fast_folder "../lib/afterglow/x86-64-v3")

# Adds a program of the folder's variant and calls its target `program`. The one that people and tests
# start is the portable one; the faster has the same name in a folder where only the portable looks.
macro(afterglow_program name)
    if(kind STREQUAL "portable")
        set(program ${name})
        file(RELATIVE_PATH folder ${CMAKE_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
        set(folder ${CMAKE_BINARY_DIR}/${folder})
    else()
        set(program ${name}_fast)
        set(folder ${CMAKE_BINARY_DIR}/lib/afterglow/x86-64-v3)
    endif()
    add_executable(${program} ${ARGN})
    set_target_properties(${program} PROPERTIES OUTPUT_NAME ${name} RUNTIME_OUTPUT_DIRECTORY ${folder})
    if(kind STREQUAL "portable" AND AFTERGLOW_FAST_PROGRAMS)
        add_dependencies(${name} ${name}_fast)
    endif()
endmacro()
