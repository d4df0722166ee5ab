// Suppression for the leak sanitizer: OpenCASCADE, which reads STEP files for Gmsh, keeps some
// tables until the process ends.

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): the sanitizer's names
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libTK";
}

extern "C" const char* __lsan_default_options() {
  return "print_suppressions=0";
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)
