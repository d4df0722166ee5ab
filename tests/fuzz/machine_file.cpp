/// The simulator's machine file: refused with a named cause, or a machine whose body can warm.
#include "simulator/files/machine_file.hpp"

#include <cmath>
#include <string>
#include <vector>

#include "common/fuzz.hpp"

using namespace thermocomp;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  constexpr const char* name = "machine.toml";
  try {
    static_cast<void>(parse_machine(text, name));
  } catch (const ConfigurationError& error) {
    // The body is another file, which does not exist here; its problems name it.
    std::vector<Problem> problems = error.problems();
    FUZZ_REQUIRE(!problems.empty());
    std::erase_if(problems, [&](const Problem& problem) { return problem.file != name; });
    if (problems.empty()) return 0;
    const fuzz::NamedText files[] = {{name, text}};
    fuzz::check_problems(problems, files);
  }
  return 0;
}
