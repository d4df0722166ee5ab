/// The simulator's machine file: refused by name, or a machine whose body warms without surprises.
#include "simulator/machine_file.hpp"

#include <cmath>
#include <string>

#include "fuzz.hpp"

using namespace thermocomp;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  constexpr const char* name = "machine.toml";
  try {
    static_cast<void>(parse_machine(text, name));
  } catch (const ConfigurationError& error) {
    const fuzz::NamedText files[] = {{name, text}};
    fuzz::check_problems(error.problems(), files);
  }
  return 0;
}
