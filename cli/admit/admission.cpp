#include "cli/admit/admission.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <vector>

#include "cli/model/prediction.hpp"
#include "config/text/problems.hpp"

namespace thermocomp::cli {
namespace {

/// @return the error that the model states; NaN: none
double stated_um(const ThermalModel& model, const std::string& output) {
  if (!model.made_from) return not_a_number;
  const auto found = model.made_from->outputs.find(output);
  return found == model.made_from->outputs.end() ? not_a_number : found->second.left_out_rms_um;
}

/// Sample standard deviation; NaN for fewer than two values.
double sd_of(const std::vector<double>& values) {
  double mean = 0.0;
  for (const double value : values) mean += value;
  mean /= static_cast<double>(values.size());
  double sum = 0.0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return values.size() < 2 ? not_a_number : std::sqrt(sum / static_cast<double>(values.size() - 1));
}

/// Removes the measured columns, so that predict() uses every row.
RunFile unmeasured(RunFile run, const std::vector<std::string>& outputs) {
  for (const std::string& output : outputs)
    if (const auto column = run.find(output)) {
      run.columns.erase(run.columns.begin() + static_cast<std::ptrdiff_t>(*column));
      run.values.erase(run.values.begin() + static_cast<std::ptrdiff_t>(*column));
    }
  return run;
}

/// One output of both models, in the rows that both predict.
struct Pair {
  std::vector<double> in_use_um;   ///< remainders of the measured rows
  std::vector<double> offered_um;  ///< likewise
  std::vector<double> apart_um;    ///< offered minus in use
};

const PredictedOutput& output_of(const Prediction& prediction, const std::string& name) {
  return *std::find_if(prediction.outputs.begin(), prediction.outputs.end(),
                       [&](const PredictedOutput& output) { return output.name == name; });
}

/// @pre both predictions have the output
Pair pair_of(const Prediction& in_use, const Prediction& offered, const std::string& output) {
  const PredictedOutput& one = output_of(in_use, output);
  const PredictedOutput& other = output_of(offered, output);
  Pair pair;
  std::size_t j = 0;
  for (std::size_t i = 0; i < in_use.time_s.size(); ++i) {
    while (j < offered.time_s.size() && offered.time_s[j] < in_use.time_s[i]) ++j;
    if (j == offered.time_s.size() || offered.time_s[j] > in_use.time_s[i]) continue;
    const double apart_um = other.predicted_um[j] - one.predicted_um[i];
    if (!std::isfinite(apart_um)) continue;
    pair.apart_um.push_back(apart_um);
    const double left_um = one.measured_um[i] - one.predicted_um[i];
    if (!std::isfinite(left_um)) continue;
    pair.in_use_um.push_back(left_um);
    pair.offered_um.push_back(other.measured_um[j] - other.predicted_um[j]);
  }
  return pair;
}

/// Compares the remainders at the probings. @return reason for refusal; empty: admitted
std::string judge_probed(const Pair& pair, double stated_um, std::string& found) {
  const double in_use_um = sd_of(pair.in_use_um);
  const double offered_um = sd_of(pair.offered_um);
  const double allowed_um = std::hypot(in_use_um, stated_um);
  found = fmt::format("leaves {:.2f} of {:.2f} um over {} probings", offered_um, in_use_um,
                      pair.offered_um.size());
  if (offered_um <= allowed_um) return "";
  return fmt::format("{}; with the stated error {:.2f} um are allowed", found, allowed_um);
}

/// Compares the predictions of the two models where there are too few probings.
std::string judge_unprobed(const Pair& pair, double stated_um, std::string& found) {
  constexpr double sds_max = 3.0;
  const double apart_um = sd_of(pair.apart_um);
  found = fmt::format("too few probings; the models differ by {:.2f} um", apart_um);
  if (!(stated_um > 0)) return found + ", and neither states an error";
  if (apart_um <= sds_max * stated_um) return "";
  return fmt::format("{}, more than three times the error that they state ({:.2f} um)", found,
                     stated_um);
}

}  // namespace

std::string why_not_admitted(const DaemonConfig& config, const RunFile& days,
                             const AdmissionRules& rules, std::string& found) {
  const CandidateModel& candidate = *config.candidate;
  if (!candidate.problem.empty()) return "does not fit this machine: " + candidate.problem;
  if (candidate.checksum == config.model_checksum) return "is the model in use";
  std::vector<std::string> outputs = candidate.model.outputs;
  std::vector<std::string> outputs_in_use = config.model.outputs;
  std::sort(outputs.begin(), outputs.end());
  std::sort(outputs_in_use.begin(), outputs_in_use.end());
  if (outputs != outputs_in_use)
    return fmt::format("has the outputs {}, the model in use {}", fmt::join(outputs, ", "),
                       fmt::join(outputs_in_use, ", "));
  const auto or_none = [](double um) { return std::isfinite(um) ? um : 0.0; };
  try {
    const Prediction in_use = predict(config.model, days);
    const Prediction offered = predict(candidate.model, days);
    for (const std::string& output : outputs) {
      const double one_um = stated_um(config.model, output);
      const double other_um = stated_um(candidate.model, output);
      const Pair probed = pair_of(in_use, offered, output);
      const bool is_probed = probed.offered_um.size() >= rules.probings_min;
      std::string line;
      std::string why;
      if (is_probed) {
        why = judge_probed(probed, or_none(std::fmin(one_um, other_um)), line);
      } else {
        const RunFile all = unmeasured(days, outputs);
        why = judge_unprobed(
            pair_of(predict(config.model, all), predict(candidate.model, all), output),
            std::hypot(or_none(one_um), or_none(other_um)), line);
      }
      if (!why.empty())
        return fmt::format("{} the model in use: {}: {}",
                           is_probed ? "is worse here than" : "cannot be compared here with",
                           output, why);
      found.append(found.empty() ? "" : "; ").append(output).append(": ").append(line);
    }
  } catch (const ConfigurationError& error) {
    return std::string("cannot be compared on this machine's own days: ") + error.what();
  }
  return "";
}

}  // namespace thermocomp::cli
