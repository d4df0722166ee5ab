#include "modelling/identification/tiebar_command.hpp"

#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/output_file.hpp"
#include "modelling/identification/gate_machine.hpp"
#include "modelling/identification/printed.hpp"

namespace thermocomp::identification {
namespace {

struct Options {
  std::string geometry;
  std::string curves;
  std::optional<double> ratio;
  bool json{false};
};

void write(const std::string& destination, const std::string& text) {
  cli::OutputFile file(destination);
  file.stream() << text;
  file.commit();
}

int run(const Options& options) {
  const GateMachine machine = load_gate_machine(options.geometry);
  const TieCoefficients k = tie_coefficients(machine);
  if (!options.curves.empty()) write(options.curves, design_curves_svg(machine));
  nlohmann::ordered_json json{{"Ki_um_per_K", k.ki_um_per_K}, {"Kc_um_per_K", k.kc_um_per_K}};
  std::string text = printed("Ki = %.6g um/K\nKc = %.6g um/K\n", k.ki_um_per_K, k.kc_um_per_K);
  text += printed("l / l4 = %.4g, km / kc = %.4g\n",
                  machine.working_height_mm / machine.tie_height_mm, stiffness_ratio(machine));
  if (options.ratio) {
    const BestHeight best = best_tie_height(machine, *options.ratio);
    json["best_tie_height_mm"] = best.tie_height_mm;
    json["displacement_um_per_K"] = best.displacement_um_per_K;
    text += printed(
        "theta_C / (theta_A - theta_B) = %.4g: smallest displacement, %.3g um/K, with "
        "the tie at %.5g mm\n",
        *options.ratio, best.displacement_um_per_K, best.tie_height_mm);
  }
  write("-", options.json ? json.dump(2) + "\n" : text);
  return 0;
}

}  // namespace

void add_tiebar_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub =
      app.add_subcommand("tiebar", "the two coefficients of a gate-shaped machine with a tie bar");
  sub->add_option("GEOMETRY.toml", options->geometry, "dimensions and materials")->required();
  sub->add_option("--ratio", options->ratio,
                  "theta_C / (theta_A - theta_B): where the tie displaces least")
      ->check(CLI::Range(-1e3, 1e3));
  sub->add_option("--curves", options->curves, "Ki and Kc over l / l4 (SVG)");
  sub->add_flag("--json", options->json, "the answer for a program");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::identification
