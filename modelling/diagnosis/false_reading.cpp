#include "modelling/diagnosis/false_reading.hpp"

#include <algorithm>

#include "modelling/diagnosis/series.hpp"

namespace thermocomp::diagnosis {
namespace {

double value_of(const std::map<std::string, double>& values, const std::string& name) {
  const auto found = values.find(name);
  return found == values.end() ? 0.0 : found->second;
}

double gain_of(const TermSpec& term, const std::string& name, const std::string& output) {
  const auto found = term.per_output.find(name);
  return found == term.per_output.end() ? 0.0 : value_of(found->second, output);
}

/// Adds what one term makes of the errors.
void add_answer(const TermSpec& term, const std::string& output, const Column& time_s,
                const Panel& errors_K, Panel& answer_um) {
  const bool late = term.kind == "thermal_lag";
  const double gain =
      gain_of(term, "gain_um_per_K", output) + gain_of(term, "delta_um_per_K", output);
  if (gain == 0.0) return;
  Panel filtered = errors_K;
  const double tau_s = value_of(term.shared, "tau_s");
  if (tau_s > 0) {
    const std::vector<double> taus_s(static_cast<std::size_t>(errors_K.cols()), tau_s);
    lag_each(time_s, taus_s, filtered);
  }
  answer_um += gain * filtered;
  if (late) answer_um -= gain * errors_K;
}

bool is_linear(const TermSpec& term) {
  return term.kind == "thermal_lag" || term.kind == "wrong_coefficient";
}

}  // namespace

bool has_terms_of(const ThermalModel& model, std::size_t input) {
  return std::any_of(model.terms.begin(), model.terms.end(), [&](const TermSpec& term) {
    return is_linear(term) && term.subject == model.inputs[input];
  });
}

void answer_to_errors(const MeasuredData& data, const MeasuredRun& run, std::size_t output,
                      std::size_t input, Panel& errors_K) {
  Panel answer_um = data.coefficient(run, output, input).asDiagonal() * errors_K;
  for (const TermSpec& term : data.model.terms)
    if (is_linear(term) && term.subject == data.model.inputs[input])
      add_answer(term, data.model.outputs[output], run.time_s, errors_K, answer_um);
  errors_K = std::move(answer_um);
}

double coefficient_of_group(const ThermalModel& model, std::size_t output,
                            const std::vector<bool>& alike) {
  double sum = 0.0;
  for (std::size_t input = 0; input < alike.size(); ++input)
    if (alike[input]) sum += model.matrix_um_per_K[output][input];
  return sum;
}

}  // namespace thermocomp::diagnosis
