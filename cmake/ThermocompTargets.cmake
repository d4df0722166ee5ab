# What every target of the project shares, and the two functions that make targets.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

find_program(CCACHE ccache)
if(CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # A copy of the tree finds what this one compiled, and the other way round: paths below the sources
  # count relative to them, and the compiler speaks one language to all.
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env --unset=LANG --unset=LC_ALL --unset=LC_CTYPE --unset=LC_MESSAGES
    CCACHE_BASEDIR=${CMAKE_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${CCACHE})
endif()

set(THERMOCOMP_SANITIZE "" CACHE STRING "Sanitizers, as for -fsanitize= (address,undefined or thread)")
option(THERMOCOMP_COVERAGE "Instrument for gcovr" OFF)
option(THERMOCOMP_FUZZ "Build the fuzz targets instead of the tests (clang with libFuzzer)" OFF)

add_library(thermocomp_flags INTERFACE)
# -ffp-contract=off: replay must give the same bits whichever build made the history.
target_compile_options(thermocomp_flags INTERFACE
  -Wall -Wextra -Wpedantic -Werror -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast
  -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align -Wformat=2 -Wimplicit-fallthrough
  -ffp-contract=off)
# The packages are hardened as Debian does it, and what is tested is what is installed: every release
# build has these flags, and debian/rules adds none.
if(CMAKE_BUILD_TYPE STREQUAL "Release")
  target_compile_options(thermocomp_flags INTERFACE
    -fstack-protector-strong -D_FORTIFY_SOURCE=2 -ffile-prefix-map=${CMAKE_SOURCE_DIR}=.)
  target_link_options(thermocomp_flags INTERFACE -Wl,-z,relro -Wl,-z,now)
endif()
if(THERMOCOMP_SANITIZE)
  target_compile_options(thermocomp_flags INTERFACE
    -fsanitize=${THERMOCOMP_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(thermocomp_flags INTERFACE -fsanitize=${THERMOCOMP_SANITIZE})
  # GCC 12 warns wrongly about uninitialised values once the sanitizers have rewritten the code.
  target_compile_options(thermocomp_flags INTERFACE -Wno-maybe-uninitialized)
endif()
if(THERMOCOMP_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "THERMOCOMP_FUZZ needs clang++: libFuzzer is a part of it")
  endif()
  # Besides what `undefined` stands for: a number that does not fit the integer it is turned into,
  # and the checked operators of the standard library.
  target_compile_options(thermocomp_flags INTERFACE
    -fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow -fno-sanitize-recover=all
    -fno-omit-frame-pointer)
  target_compile_definitions(thermocomp_flags INTERFACE _GLIBCXX_ASSERTIONS)
endif()
if(THERMOCOMP_COVERAGE)
  target_compile_options(thermocomp_flags INTERFACE --coverage)
  target_link_options(thermocomp_flags INTERFACE --coverage)
endif()

# thermocomp_rooms(TARGET [VISIBILITY] FOLDER...): headers of FOLDER become visible as
# "FOLDER/name.hpp" to TARGET and to whoever links it - and to nobody else. Each target gets an
# include root of its own with links to its folders, so that including a header of a library that
# is not linked does not compile.
function(thermocomp_rooms target visibility)
  set(root ${CMAKE_BINARY_DIR}/include-roots/${target})
  # Begun anew in each configuration, before the first link: a link to a folder that an earlier
  # layout left would lead what is done below it into the sources.
  get_property(begun GLOBAL PROPERTY thermocomp_root_begun_${target})
  if(NOT begun)
    file(REMOVE_RECURSE ${root})  # removes links, never follows them
    set_property(GLOBAL PROPERTY thermocomp_root_begun_${target} TRUE)
  endif()
  foreach(path ${ARGN})
    get_filename_component(parent ${root}/${path} DIRECTORY)
    file(MAKE_DIRECTORY ${parent})
    file(CREATE_LINK ${CMAKE_SOURCE_DIR}/${path} ${root}/${path} SYMBOLIC)
  endforeach()
  target_include_directories(${target} ${visibility} ${root})
endfunction()

# thermocomp_library(NAME ROOMS folder... SOURCES file... LINKS target...)
function(thermocomp_library name)
  cmake_parse_arguments(arg "" "" "ROOMS;SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC ${arg_LINKS} PRIVATE thermocomp_flags ${arg_PRIVATE_LINKS})
  thermocomp_rooms(${name} PUBLIC ${arg_ROOMS})
endfunction()

# thermocomp_program(NAME SOURCES file... LINKS target...)
function(thermocomp_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE thermocomp_flags ${arg_LINKS})
endfunction()

# thermocomp_test(NAME SOURCES file... LINKS target... [TIMEOUT s] [LABELS label...]
#                 [ARGUMENTS argument...])
# One Catch2 program and one ctest entry; ARGUMENTS are Catch2's, to select tests.
function(thermocomp_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LINKS;LABELS;ARGUMENTS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE thermocomp_flags thermocomp_catch_main ${arg_LINKS})
  add_test(NAME ${name} COMMAND ${name} ${arg_ARGUMENTS})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  set_tests_properties(${name} PROPERTIES TIMEOUT ${arg_TIMEOUT} LABELS "${arg_LABELS}")
endfunction()
