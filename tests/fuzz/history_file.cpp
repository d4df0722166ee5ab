/// A history of arbitrary bytes: read, replayed and exported like the commands do.
#include "common/fuzz.hpp"
#include "common/history_properties.hpp"

using namespace thermocomp;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::ScratchFile file("h.db");
  file.write({data, size});
  static_cast<void>(fuzz::use_history(file.path(), parse_setup));
  return 0;
}
