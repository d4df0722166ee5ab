#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "modelling/identification/printed.hpp"
#include "modelling/series/series.hpp"

namespace thermocomp::series {
namespace {

using identification::printed;
using Json = nlohmann::ordered_json;

constexpr std::size_t parts_named = 3;

/// Share of the prior variance of a prediction removed by the rows.
double learned_of(const OutputSeries& output, const Eigen::MatrixXd& moment,
                  const Coefficients& b) {
  return 1.0 - (b.covariance * moment).trace() / (output.covariance * moment).trace();
}

}  // namespace

std::string adapted_text(const Series& series, const Statistics& machine, const Adapted& adapted,
                         const PriorJudgement& judgement, bool json) {
  Json all;
  std::string text = printed("%.3g h of %zu runs, prior of %zu machines\n", machine.time_s / 3600.0,
                             machine.runs.size(), series.machines.size());
  all["hours"] = machine.time_s / 3600.0;
  all["machines"] = series.machines.size();
  for (const auto& [name, b] : adapted.coefficients) {
    const MadeFrom::Output& stated = adapted.model.made_from->outputs.at(name);
    const double learned = learned_of(series.outputs.at(name), series.moment, b);
    text += name + printed(
                       ": the runs remove %.0f %% of the prior variance; expected error in new "
                       "rows %.3g um, without a model %.3g um\n",
                       100.0 * learned, stated.left_out_rms_um, stated.no_model_rms_um);
    all["outputs"][name] = {{"settled", learned},
                            {"expected_rms_um", stated.left_out_rms_um},
                            {"no_model_rms_um", stated.no_model_rms_um}};
  }
  for (std::size_t o = 0; o < judgement.prior_um.size(); ++o) {
    Json& output = all["outputs"][machine.outputs[o]];
    output["left_out_rms_um"] = judgement.prior_um[o];
    output["own_left_out_rms_um"] = judgement.own_um[o];
  }
  text += judgement.text(machine.outputs);
  return json ? all.dump(2) + "\n" : text;
}

std::string comparison_text(const std::vector<Comparison>& comparisons) {
  std::string text;
  for (const Comparison& each : comparisons) {
    const Departure& departure = each.departure;
    text +=
        "\n" + each.output +
        printed(
            ": differs from its sisters by %.3g times the usual distance (%.0f directions); one "
            "sister in %.3g differs as much%s\n",
            std::sqrt(departure.distance2 / std::max(departure.freedom, 1.0)), departure.freedom,
            1.0 / std::max(departure.probability, 1e-9), departs(each) ? ": it departs" : "");
    for (std::size_t i = 0; i < std::min(parts_named, departure.parts.size()); ++i)
      if (departs(each))
        text += printed("  %-24s explains %.0f %%, effect differs by %.3g um\n",
                        departure.parts[i].name.c_str(), 100.0 * departure.parts[i].share,
                        departure.parts[i].effect_um);
    text += printed("  residual: %.3g um", each.remainder_um);
    text += each.median_um > 0.0 ? printed(", of the sisters %.3g um (median)\n", each.median_um)
                                 : ", of fewer than three sisters no usual one is known\n";
  }
  return text;
}

std::string comparison_json(const std::vector<Comparison>& comparisons) {
  if (comparisons.empty()) return "";
  Json all = Json::object();
  for (const Comparison& each : comparisons) {
    Json parts = Json::array();
    for (const Departure::Part& part : each.departure.parts)
      parts.push_back(
          {{"subject", part.name}, {"share", part.share}, {"effect_um", part.effect_um}});
    all[each.output] = {{"departs", departs(each)},
                        {"distance", std::sqrt(each.departure.distance2)},
                        {"directions", each.departure.freedom},
                        {"probability", each.departure.probability},
                        {"false_alarm", each.false_alarm},
                        {"subjects", parts},
                        {"remainder_um", each.remainder_um},
                        {"sisters_um", each.median_um > 0.0 ? Json(each.median_um) : Json(nullptr)},
                        {"remainder_deviations", each.deviations}};
  }
  return all.dump();
}

}  // namespace thermocomp::series
