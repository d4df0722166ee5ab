# A short run of each fuzz target, built once by clang beside this build. Only with the release
# build: the targets have sanitizers of their own. Without clang the tests are skipped.
add_test(NAME fuzz_build COMMAND ${CMAKE_SOURCE_DIR}/scripts/fuzz.sh --build)
set_tests_properties(fuzz_build PROPERTIES FIXTURES_SETUP fuzz_programs PROCESSORS 2 TIMEOUT 1200
  SKIP_RETURN_CODE 77 LABELS fuzz)

file(STRINGS ${CMAKE_SOURCE_DIR}/tests/fuzz/CMakeLists.txt fuzz_lines REGEX "^fuzz_target\\(")
foreach(line ${fuzz_lines})
  string(REGEX MATCH "^fuzz_target\\(([a-z0-9_]+)" ignored "${line}")
  add_test(NAME fuzz_${CMAKE_MATCH_1}
    COMMAND ${CMAKE_SOURCE_DIR}/scripts/fuzz.sh --no-build --seconds 10 ${CMAKE_MATCH_1})
  set_tests_properties(fuzz_${CMAKE_MATCH_1} PROPERTIES FIXTURES_REQUIRED fuzz_programs
    TIMEOUT 300 SKIP_RETURN_CODE 77 LABELS fuzz)
endforeach()
