/// A device preset with a configuration that uses it: refusals name the file concerned; after
/// loading, the parts can be built.
///
/// Input: the text of the preset, a line "#### configuration", the text of the daemon's file.
#include <string>
#include <vector>

#include "common/fuzz.hpp"
#include "config/daemon/daemon_config.hpp"
#include "drivers/sensors/make_source.hpp"

using namespace thermocomp;

namespace {

constexpr std::string_view configuration_border = "#### configuration\n";
constexpr std::string_view model = R"(format = 1
inputs = ["t_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
)";

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// The three files, in a folder as the daemon finds them.
struct Files {
  Files() : configuration("thermocompd.toml"), scratch_model("model.toml") {
    folder = configuration.folder();
    std::filesystem::create_directory(folder / "devices");
    std::filesystem::create_symlink(preset.path(), folder / "devices" / "module.toml");
    scratch_model.write(bytes_of(model));
    std::filesystem::create_symlink(scratch_model.path(), folder / "model.toml");
  }
  fuzz::ScratchFile configuration;
  fuzz::ScratchFile scratch_model;
  fuzz::ScratchFile preset{"module.toml"};
  std::filesystem::path folder;
};

void make_sources(const DaemonConfig& config) {
  for (const BusConfig& bus : config.buses) {
    FUZZ_REQUIRE(make_source(bus)->health().units.size() == outline_of(bus).units);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Files files;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t at = text.find(configuration_border);
  const std::string preset = text.substr(0, at);
  const std::string own =
      at == std::string::npos ? "" : text.substr(at + configuration_border.size());
  files.preset.write(bytes_of(preset));
  files.configuration.write(bytes_of(own));
  try {
    make_sources(load_daemon_config(files.configuration.path()));
  } catch (const ConfigurationError& error) {
    FUZZ_REQUIRE(!error.problems().empty());
    // Problems in other files named by the configuration name those files.
    std::vector<Problem> problems = error.problems();
    const std::string preset_name = files.folder / "devices" / "module.toml";
    const std::string own_name = files.configuration.path();
    std::erase_if(problems, [&](const Problem& problem) {
      return problem.file != preset_name && problem.file != own_name;
    });
    const fuzz::NamedText named[] = {{preset_name, preset}, {own_name, own}};
    if (!problems.empty()) fuzz::check_problems(problems, named);
  }
  return 0;
}
