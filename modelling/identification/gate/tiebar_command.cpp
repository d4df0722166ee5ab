#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "modelling/command_line.hpp"
#include "modelling/identification/gate/gate_file.hpp"
#include "modelling/identification/gate/tie_course.hpp"
#include "modelling/identification/gate/tied_columns.hpp"
#include "modelling/identification/printed.hpp"
#include "report/files.hpp"

namespace thermocomp::identification {
namespace {

using Json = nlohmann::ordered_json;

struct TiebarOptions {
  std::string geometry;
  std::string curves;
  std::optional<double> ratio;
  std::vector<std::string> course;
  std::string columns;
  bool optimise{false};
  std::string picture;
  bool json{false};
};

struct Answer {
  Json json;
  std::string text;
};

void add_one_tie(const TiebarOptions& options, const TiedColumns& columns, Answer& answer) {
  const TiedCoefficients k = tied_coefficients(columns);
  if (!options.curves.empty()) cli::write_file(options.curves, design_curves_svg(columns));
  answer.json = {{"Ki_um_per_K", k.ki_um_per_K}, {"Kc_um_per_K", k.kc_um_per_K.front()}};
  answer.text = printed("Ki = %.6g um/K\nKc = %.6g um/K\n", k.ki_um_per_K, k.kc_um_per_K.front());
  answer.text +=
      printed("l / l4 = %.4g, km / kc = %.4g\n",
              columns.working_height_mm / columns.ties.front().height_mm, stiffness_ratio(columns));
  if (!options.ratio) return;
  const BestHeight best = best_tie_height(columns, *options.ratio);
  answer.json["best_tie_height_mm"] = best.tie_height_mm;
  answer.json["displacement_um_per_K"] = best.displacement_um_per_K;
  answer.text += printed(
      "theta_C / (theta_A - theta_B) = %.4g: smallest displacement, %.3g um/K, with "
      "the tie at %.5g mm\n",
      *options.ratio, best.displacement_um_per_K, best.tie_height_mm);
}

/// Ki, then one line per tie.
Answer ties_answer(const TiedColumns& columns) {
  const TiedCoefficients k = tied_coefficients(columns);
  Answer answer{{{"Ki_um_per_K", k.ki_um_per_K}, {"ties", Json::array()}},
                printed("Ki = %.6g um/K\n", k.ki_um_per_K)};
  for (std::size_t j = 0; j < columns.ties.size(); ++j) {
    const Tie& tie = columns.ties[j];
    answer.json["ties"].push_back({{"height_mm", tie.height_mm},
                                   {"area_mm2", tie.area_mm2},
                                   {"Kc_um_per_K", k.kc_um_per_K[j]}});
    answer.text += printed("Kc = %.6g um/K of tie %zu at %.5g mm (l / l4 = %.4g), %.5g mm^2\n",
                           k.kc_um_per_K[j], j + 1, tie.height_mm,
                           columns.working_height_mm / tie.height_mm, tie.area_mm2);
  }
  return answer;
}

void add_courses(const TiebarOptions& options, const GateFile& file, Answer& answer) {
  std::vector<std::string> notes;
  const std::vector<TieCourse> courses =
      tie_courses(file, cli::RunLoader(options.columns).load(options.course), notes);
  for (const std::string& note : notes) std::fprintf(stderr, "%s\n", note.c_str());
  std::optional<TiedColumns> best;
  if (options.optimise) best = best_ties(file, courses);
  TiedColumns free = file.columns;
  free.ties.clear();
  answer.text += "\nswing of the displacement, um\n   no tie  as drawn";
  answer.text += best ? "      best\n" : "\n";
  answer.json["courses"] = Json::array();
  for (const TieCourse& course : courses) {
    const double none_um = swing_um({course}, tied_coefficients(free));
    const double drawn_um = swing_um({course}, tied_coefficients(file.columns));
    Json json{{"run", course.name}, {"swing_without_um", none_um}, {"swing_drawn_um", drawn_um}};
    answer.text += printed("%9.2f %9.2f", none_um, drawn_um);
    if (best) {
      json["swing_best_um"] = swing_um({course}, tied_coefficients(*best));
      answer.text += printed(" %9.2f", swing_um({course}, tied_coefficients(*best)));
    }
    answer.text.append("  ").append(course.name).append("\n");
    answer.json["courses"].push_back(std::move(json));
  }
  if (best) {
    const Answer ties = ties_answer(*best);
    answer.json["best"] = ties.json;
    answer.text +=
        "\nbest ties, if the temperature of each does not change with its place:\n" + ties.text;
  }
  if (!options.picture.empty())
    cli::write_file(options.picture, tie_picture(file, courses, best ? &*best : nullptr));
}

int run_tiebar(const TiebarOptions& options) {
  const GateFile file = load_gate_file(options.geometry);
  Answer answer;
  if (file.columns.ties.size() == 1) {
    add_one_tie(options, file.columns, answer);
  } else {
    if (options.ratio || !options.curves.empty())
      throw std::runtime_error("--ratio and --curves are for one tie; " + options.geometry +
                               " has several: --course RUN.csv --optimise");
    answer = ties_answer(file.columns);
  }
  if (!options.course.empty()) add_courses(options, file, answer);
  cli::write_file("-", options.json
                           ? answer.json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
                           : answer.text);
  return 0;
}

}  // namespace

void add_tiebar_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<TiebarOptions>();
  CLI::App* sub =
      app.add_subcommand("tiebar", "coefficients of a gate-shaped machine with tie bars");
  sub->add_option("GEOMETRY.toml", options->geometry, "dimensions and materials")->required();
  sub->add_option("--ratio", options->ratio,
                  "theta_C / (theta_A - theta_B): where the tie displaces least")
      ->check(CLI::Range(-1e3, 1e3));
  sub->add_option("--curves", options->curves, "Ki and Kc over l / l4 (SVG)");
  CLI::Option* course = sub->add_option("--course", options->course,
                                        "measured temperatures, RUN.csv[@T0:T1]: the displacement "
                                        "that they cause")
                            ->type_name("RUN.csv");
  sub->add_option("--columns", options->columns, cli::columns_help)->needs(course);
  sub->add_flag("--optimise", options->optimise,
                "places and areas of the ties that minimise the displacement of the worst course")
      ->needs(course);
  sub->add_option("--picture", options->picture, "the courses without ties, as drawn, best (SVG)")
      ->needs(course);
  sub->add_flag("--json", options->json, "result as JSON");
  sub->callback([options, &action] { action = [options] { return run_tiebar(*options); }; });
}

}  // namespace thermocomp::identification
