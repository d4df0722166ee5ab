/// The state file: with any content the daemon starts, with the file's state or a warning naming
/// file and cause; a state that was read is written unchanged.
#include "daemon/state/state_file.hpp"

#include <cmath>

#include "common/fuzz.hpp"

using namespace thermocomp;

namespace {

void check_numbers(const std::map<std::string, double>& values) {
  for (const auto& [name, value] : values) FUZZ_REQUIRE(std::isfinite(value));
}

bool same(const PersistentState& a, const PersistentState& b) {
  return a.enabled == b.enabled && a.reference_degC == b.reference_degC &&
         a.model_reference_degC == b.model_reference_degC &&
         a.reference_signals == b.reference_signals && a.offset_um == b.offset_um &&
         a.held_degC == b.held_degC && a.held_signals == b.held_signals &&
         a.correction == b.correction;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::ScratchFile file("state.json");
  static const fuzz::ScratchFile copy("state.json");
  file.write({data, size});
  PersistentState fallback;
  fallback.enabled = false;
  fallback.offset_um["z"] = 12.5;
  const LoadedState loaded = load_state_file(file.path(), fallback);
  FUZZ_REQUIRE(loaded.found == loaded.warning.empty());
  FUZZ_REQUIRE(loaded.found != loaded.damaged);
  if (!loaded.found) {
    FUZZ_REQUIRE(same(loaded.state, fallback) && !loaded.reference_lost);
    FUZZ_REQUIRE(loaded.warning.find(file.path().string()) != std::string::npos);
    FUZZ_REQUIRE(!std::filesystem::exists(file.path()));
    return 0;
  }
  check_numbers(loaded.state.reference_degC);
  check_numbers(loaded.state.model_reference_degC);
  check_numbers(loaded.state.reference_signals);
  check_numbers(loaded.state.offset_um);
  check_numbers(loaded.state.held_degC);
  check_numbers(loaded.state.held_signals);
  check_numbers(loaded.state.correction);
  FUZZ_REQUIRE(save_state_file(copy.path(), loaded.state, loaded.reference_lost).empty());
  const LoadedState again = load_state_file(copy.path(), fallback);
  FUZZ_REQUIRE(again.found && same(again.state, loaded.state));
  FUZZ_REQUIRE(again.reference_lost == loaded.reference_lost);
  return 0;
}
