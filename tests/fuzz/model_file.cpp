/// Model files: what loads is written and read again unchanged, and can be evaluated.
#include "config/model/model_file.hpp"

#include <cmath>
#include <string>
#include <vector>

#include "common/fuzz.hpp"
#include "common/model_properties.hpp"
#include "estimator/model/displacement_model.hpp"

using namespace thermocomp;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  constexpr const char* name = "model.toml";
  const ModelReading reading = read_model_text(text, name);
  if (!reading.problems.empty()) {
    const fuzz::NamedText files[] = {{name, text}};
    fuzz::check_problems(reading.problems, files);
    return 0;
  }
  const std::string written = write_model(reading.model);
  const ModelReading again = read_model_text(written, name);
  if (!again.problems.empty()) std::fprintf(stderr, "%s\n", written.c_str());
  FUZZ_REQUIRE(again.problems.empty());
  FUZZ_REQUIRE(write_model(again.model) == written);
  fuzz::check_same(reading.model, again.model);
  fuzz::check_steps(reading.model);
  return 0;
}
