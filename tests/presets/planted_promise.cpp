// Breaks one chosen promise of the fuzz targets, which must end the program with its text.
#include <cstdio>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tests/fuzz/common/fuzz.hpp"
#include "tests/fuzz/common/model_properties.hpp"

using namespace thermocomp;

namespace {

const fuzz::NamedText files[] = {{"a.toml", "x = 1\ny = 2\n"}};
const Problem good{"a.toml", 2, "y", "2", "must be less"};

ThermalModel model() {
  ThermalModel model;
  model.inputs = {"t_degC"};
  model.outputs = {"z_um"};
  model.reference_degC = {20.0};
  model.matrix_um_per_K = {{5.0}};
  return model;
}

void refuse_with(Problem problem) {
  fuzz::check_problems({good, std::move(problem)}, files);
}

/// @return false: no such promise
bool break_promise(std::string_view name) {
  if (name == "none") {
    fuzz::check_problems({good}, files);
    fuzz::check_same(model(), model());
    fuzz::check_steps(model());
  } else if (name == "no_problem") {
    fuzz::check_problems({}, files);
  } else if (name == "file_that_nobody_read") {
    refuse_with({"b.toml", 1, "x", "1", "must be less"});
  } else if (name == "line_that_is_not_there") {
    refuse_with({"a.toml", 4, "x", "1", "must be less"});
  } else if (name == "no_rule") {
    refuse_with({"a.toml", 1, "x", "1", ""});
  } else if (name == "key_without_value") {
    refuse_with({"a.toml", 1, "x", "", "must be less"});
  } else if (name == "other_gain") {
    ThermalModel other = model();
    other.matrix_um_per_K[0][0] += 1e-15;
    fuzz::check_same(model(), other);
  } else if (name == "term_that_was_lost") {
    ThermalModel other = model();
    other.terms.emplace_back();
    fuzz::check_same(other, model());
  } else {
    return false;
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && break_promise(argv[1])) return 0;
  std::fprintf(stderr, "usage: planted_promise none|NAME\n");
  return 2;
}
