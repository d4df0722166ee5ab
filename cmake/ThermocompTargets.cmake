# What every target of the project shares, and the functions that make targets.

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
  # count relative to them, and the compiler speaks one language to all. SLOPPINESS: what
  # ccache wants before it caches anything that uses a precompiled header.
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env --unset=LANG --unset=LC_ALL --unset=LC_CTYPE --unset=LC_MESSAGES
    CCACHE_BASEDIR=${CMAKE_SOURCE_DIR} CCACHE_NOHASHDIR=1
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${CCACHE})
endif()

set(THERMOCOMP_SANITIZE "" CACHE STRING "Sanitizers, as for -fsanitize= (address,undefined or thread)")
option(THERMOCOMP_COVERAGE "Instrument for gcovr" OFF)
option(THERMOCOMP_PRECOMPILED "Read headers that all use from a precompiled file" ON)
option(THERMOCOMP_FUZZ "Build the fuzz targets instead of the tests (clang with libFuzzer)" OFF)

add_library(thermocomp_flags INTERFACE)
# -ffp-contract=off: replay must give the same bits whichever build made the history.
target_compile_options(thermocomp_flags INTERFACE
  -Wall -Wextra -Wpedantic -Werror -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast
  -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align -Wformat=2 -Wimplicit-fallthrough
  -ffp-contract=off)
# GCC collects its garbage only above 500 MB, which few files reach: an eighth of the time of compiling.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(thermocomp_flags INTERFACE "SHELL:--param ggc-min-heapsize=512000")
endif()
# The packages are hardened as Debian does it, and what is tested is what is installed: every release
# build has these flags, and debian/rules adds none.
if(CMAKE_BUILD_TYPE STREQUAL "Release")
  target_compile_options(thermocomp_flags INTERFACE
    -fstack-protector-strong -D_FORTIFY_SOURCE=2 -ffile-prefix-map=${CMAKE_SOURCE_DIR}=.)
  target_link_options(thermocomp_flags INTERFACE -Wl,-z,relro -Wl,-z,now)
  # Type information beside the machine code, for scripts/check-odr.sh alone: no program is linked with it. Tests have
  # it too: the index of such a library names functions that it does not define, and an object without types
  # (Debian's libCatch2WithMain.a) that needs one of these includes its members twice.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(thermocomp_flags INTERFACE -flto -ffat-lto-objects)
    target_link_options(thermocomp_flags INTERFACE -fno-lto)
  endif()
endif()
if(THERMOCOMP_SANITIZE)
  target_compile_options(thermocomp_flags INTERFACE
    -fsanitize=${THERMOCOMP_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  # Half of the time of compiling. The address sanitizer finds null pointers and overruns as well; alignment,
  # dynamic types and overflowing pointers are left to the night's asan-ubsan-all.
  if(THERMOCOMP_SANITIZE MATCHES "address" AND DEFINED THERMOCOMP_MODELLING AND NOT THERMOCOMP_MODELLING)
    target_compile_options(thermocomp_flags INTERFACE
      -fno-sanitize=null,object-size,vptr,alignment,nonnull-attribute,returns-nonnull-attribute,pointer-overflow)
  endif()
  target_link_options(thermocomp_flags INTERFACE -fsanitize=${THERMOCOMP_SANITIZE})
  # GCC 12 warns wrongly about uninitialised values and bounds once the sanitizers have rewritten the
  # code; the release build has these warnings.
  target_compile_options(thermocomp_flags INTERFACE
    -Wno-maybe-uninitialized -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow)
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

# Headers of the C++ library and of others, read once for all files instead of once a file: a quarter
# of the time of compiling a test. Never headers of ours, so that the include folders below still hold. A file must name
# what it uses all the same: the preset debug and clang-tidy read the files without these.
# GCC only: it alone builds what is tested and installed.
set(THERMOCOMP_STD_HEADERS
  <algorithm> <array> <atomic> <chrono> <cmath> <cstddef> <cstdint> <cstring> <filesystem>
  <functional> <limits> <map> <memory> <optional> <set> <span> <stdexcept> <string> <string_view>
  <utility> <variant> <vector>)

# thermocomp_precompiled(NAME HEADERS header... [LINKS target...] [OPTIONS option...]): what
# thermocomp_use_precompiled names.
function(thermocomp_precompiled name)
  if(NOT THERMOCOMP_PRECOMPILED OR NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    return()
  endif()
  cmake_parse_arguments(arg "" "" "HEADERS;LINKS;OPTIONS" ${ARGN})
  set(empty ${CMAKE_BINARY_DIR}/precompiled/${name}.cpp)
  file(CONFIGURE OUTPUT ${empty} CONTENT "// Only here for the headers.\n")
  add_library(${name} OBJECT ${empty})
  target_link_libraries(${name} PRIVATE thermocomp_flags ${arg_LINKS})
  # -fpch-preprocess: for ccache, here and below.
  target_compile_options(${name} PRIVATE -fpch-preprocess ${arg_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${arg_HEADERS})
endfunction()

# thermocomp_use_precompiled(TARGET NAME). The options of TARGET must be those of NAME: GCC silently
# goes on with the optimisation options that the header was made with. Where a file or a target has
# options of its own, set its property SKIP_PRECOMPILE_HEADERS or DISABLE_PRECOMPILE_HEADERS.
function(thermocomp_use_precompiled target name)
  if(TARGET ${name})
    target_precompile_headers(${target} REUSE_FROM ${name})
    target_compile_options(${target} PRIVATE -fpch-preprocess)
  endif()
endfunction()

thermocomp_precompiled(thermocomp_precompiled_std HEADERS ${THERMOCOMP_STD_HEADERS})

# Command lines, files and texts run once, and the compiler spends a quarter of its time on making
# them fast.
if(CMAKE_BUILD_TYPE STREQUAL "Release")
  set(THERMOCOMP_RUNS_ONCE -O1)
  # Tests compare more than they compute, and a third of the time of compiling them made them fast.
  set(THERMOCOMP_TEST_OPTIONS -Og)
endif()
thermocomp_precompiled(thermocomp_precompiled_runs_once
  HEADERS ${THERMOCOMP_STD_HEADERS} <CLI/CLI.hpp> <nlohmann/json.hpp> OPTIONS ${THERMOCOMP_RUNS_ONCE})

# Sixteen files of a target are compiled as one: more than three tenths of the time of compiling. So a name of an
# anonymous namespace occurs once in a target. The preset debug and clang-tidy read each file by itself.
option(THERMOCOMP_TOGETHER "All but Debug: compile the files of a target together" ON)
if(THERMOCOMP_TOGETHER AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug" AND NOT THERMOCOMP_FUZZ)
  set(CMAKE_UNITY_BUILD ON)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE 16)
  # GCC takes the members of a file's own types for those of a header.
  target_compile_options(thermocomp_flags INTERFACE -Wno-subobject-linkage)
endif()

# thermocomp_include_folders(TARGET [VISIBILITY] FOLDER...): headers of FOLDER become visible as
# "FOLDER/name.hpp" to TARGET and to whoever links it - and to nobody else. Each target gets an
# include root of its own with links to its folders, so that including a header of a library that
# is not linked does not compile.
function(thermocomp_include_folders target visibility)
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

# thermocomp_library(NAME INCLUDE_FOLDERS folder... SOURCES file... LINKS target... [RUNS_ONCE | MODELLING])
function(thermocomp_library name)
  cmake_parse_arguments(arg "RUNS_ONCE;MODELLING" "" "INCLUDE_FOLDERS;SOURCES;LINKS;PRIVATE_LINKS" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC ${arg_LINKS} PRIVATE thermocomp_flags ${arg_PRIVATE_LINKS})
  thermocomp_include_folders(${name} PUBLIC ${arg_INCLUDE_FOLDERS})
  if(arg_RUNS_ONCE)
    target_compile_options(${name} PRIVATE ${THERMOCOMP_RUNS_ONCE})
    thermocomp_use_precompiled(${name} thermocomp_precompiled_runs_once)
  elseif(arg_MODELLING)
    target_compile_options(${name} PRIVATE ${THERMOCOMP_MODELLING_OPTIONS})
    thermocomp_use_precompiled(${name} thermocomp_precompiled_modelling)
  else()
    thermocomp_use_precompiled(${name} thermocomp_precompiled_std)
  endif()
endfunction()

# thermocomp_program(NAME SOURCES file... LINKS target...)
function(thermocomp_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE thermocomp_flags ${arg_LINKS})
  thermocomp_use_precompiled(${name} thermocomp_precompiled_std)
endfunction()

# What a test takes of the places that ./test.sh gives ctest, two per CPU (property PROCESSORS): one
# that computes takes two, one that mostly waits for devices and times takes one - but with sanitizers
# it computes as well. A guest has one CPU, on which its devices, daemon and test must all keep their times.
set(THERMOCOMP_COMPUTES 2)
set(THERMOCOMP_GUEST 2)
set(THERMOCOMP_COMPUTES_ON_TWO 4)
set(THERMOCOMP_WAITS 1)
if(THERMOCOMP_SANITIZE)
  set(THERMOCOMP_WAITS 2)
endif()

# thermocomp_test(NAME SOURCES file... LINKS target... [TIMEOUT s] [LABELS label...]
#                 [ARGUMENTS argument...] [SLOW] [WAITS])
# One Catch2 program and one ctest entry; ARGUMENTS are Catch2's, to select tests. All but those that
# are SLOW are a part of ./test.sh --quick. WAITS: the program waits for nearly all of its time, with
# sanitizers too, and takes one place.
function(thermocomp_test name)
  cmake_parse_arguments(arg "SLOW;WAITS" "TIMEOUT" "SOURCES;LINKS;LABELS;ARGUMENTS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE thermocomp_flags thermocomp_catch_main ${arg_LINKS})
  target_compile_options(${name} PRIVATE ${THERMOCOMP_TEST_OPTIONS})
  thermocomp_use_precompiled(${name} thermocomp_precompiled_catch)
  add_test(NAME ${name} COMMAND ${name} ${arg_ARGUMENTS})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 900)
  endif()
  if(NOT arg_SLOW)
    list(APPEND arg_LABELS quick)
    if(NOT TARGET quick_tests)
      add_custom_target(quick_tests)
    endif()
    add_dependencies(quick_tests ${name})
  endif()
  set(places ${THERMOCOMP_COMPUTES})
  if(arg_WAITS)
    set(places 1)
    set_tests_properties(${name} PROPERTIES COST 300)
  endif()
  set_tests_properties(${name} PROPERTIES
    TIMEOUT ${arg_TIMEOUT} PROCESSORS ${places} LABELS "${arg_LABELS}")
endfunction()
