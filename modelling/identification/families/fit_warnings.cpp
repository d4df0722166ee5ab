/// Warnings of a fit: what its runs cannot show, and where its model is not to be trusted.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "config/text/printable_text.hpp"
#include "modelling/identification/families/families.hpp"
#include "modelling/identification/printed.hpp"

namespace thermocomp::identification {
namespace {

/// A run is decisive if its RMS is so many times that of all others; its difference must exceed the
/// others by this share of a column's range. Both set by hand.
constexpr double decides_from = 2.0;
constexpr double differs_from = 0.25;

/// Column of a run as recorded: temperatures, then signals.
Eigen::VectorXd recorded(const TestRun& run, std::size_t column) {
  const Eigen::Index rows = run.time_s.size() - run.begin;
  const auto at = static_cast<Eigen::Index>(column);
  const Eigen::Index places = run.places_K.cols();
  if (at >= places) return run.signals.col(at - places).tail(rows);
  return run.places_K.col(at).tail(rows).array() + run.reference_degC[at];
}

/// Greatest difference of a run from the others, as "; it starts at spindle_rpm = 10000, the others
/// at 0"; empty: none recorded.
std::string difference_of(const MeasuredTests& tests, std::size_t run) {
  struct View {
    const char* words;
    const char* of_others;
    double (*of)(const Eigen::VectorXd&);
  };
  const std::array<View, 3> views{
      View{"starts at", "at", [](const Eigen::VectorXd& values) { return values[0]; }},
      View{"goes up to", "to", [](const Eigen::VectorXd& values) { return values.maxCoeff(); }},
      View{"goes down to", "to", [](const Eigen::VectorXd& values) { return values.minCoeff(); }}};
  double most = differs_from;
  std::string text;
  for (std::size_t column = 0; column < tests.places.size() + tests.signals.size(); ++column) {
    std::vector<Eigen::VectorXd> values;
    for (const TestRun& each : tests.runs) values.push_back(recorded(each, column));
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const Eigen::VectorXd& each : values) {
      low = std::min(low, each.minCoeff());
      high = std::max(high, each.maxCoeff());
    }
    for (const auto& [words, of_others, of] : views) {
      double least = std::numeric_limits<double>::infinity();
      double largest = -least;
      for (std::size_t other = 0; other < values.size(); ++other) {
        if (other == run) continue;
        least = std::min(least, of(values[other]));
        largest = std::max(largest, of(values[other]));
      }
      const double own = of(values[run]);
      const double beyond = std::max(own - largest, least - own) / (high - low);
      if (!(beyond > most)) continue;
      most = beyond;
      const std::string& name = column < tests.places.size()
                                    ? tests.places[column]
                                    : tests.signals[column - tests.places.size()];
      text = printed("; it %s %s = %.6g, the others %s %.6g", words, name.c_str(), own, of_others,
                     least);
      if (largest > least) text += printed(" to %.6g", largest);
    }
  }
  return text;
}

/// Warns of a left-out run that causes most of the error.
void add_deciding_run(const MeasuredTests& tests, const FamilyResult& result, std::size_t output,
                      std::vector<std::string>& warnings) {
  const std::vector<double>& fold_um = result.fold_um[output];
  if (tests.runs.size() < 2) return;
  const auto worst =
      static_cast<std::size_t>(std::max_element(fold_um.begin(), fold_um.end()) - fold_um.begin());
  double squares = 0.0;
  double rows = 0.0;
  for (std::size_t f = 0; f < fold_um.size(); ++f) {
    if (f == worst) continue;
    const auto count = static_cast<double>(tests.folds[f].end - tests.folds[f].begin);
    squares += count * fold_um[f] * fold_um[f];
    rows += count;
  }
  const double others_um = std::sqrt(squares / rows);
  if (!(fold_um[worst] > decides_from * others_um)) return;
  warnings.push_back(
      tests.outputs[output] + ": " + tests.fold_name(worst) +
      printed(
          " decides: when it is left out, %s leaves %.3g um of it and %.3g um of the other runs",
          std::string(to_string(result.family)).c_str(), fold_um[worst], others_um) +
      difference_of(tests, tests.folds[worst].run));
}

}  // namespace

void add_warnings(const MeasuredTests& tests, FamiliesFit& fit) {
  if (tests.runs.size() < 2)
    fit.warnings.emplace_back(
        "judged within one run: the error on other days is unknown. Next: a run of another day "
        "with another course of speeds or loads; fit both, and each judges the other");
  const FamilyResult& chosen = fit.of_model;
  const FamilyResult& none = fit.results.front();
  for (const std::string& signal : fit.unmoved)
    fit.warnings.push_back(signal +
                           " gets no gain: it stayed at a level within each run or went one way "
                           "once, so its effect cannot be separated from that of time. Next: a run "
                           "in which it goes up and down");
  if (!tests.constant.empty())
    fit.warnings.push_back(joined(tests.constant) +
                           ": the same value in all rows, so the model does not have it and does "
                           "not notice when it changes. Next: a run in which it goes up and down");
  for (const std::string& signal : tests.gradual)
    if (tests.moved(signal) && fit.chosen == Family::lag_bank)
      fit.warnings.push_back(signal +
                             " has gains though it went one way only: every part left out is "
                             "predicted better by a tenth or more with them. A slow drift may look "
                             "the same. Next: a run in which it goes up and down");
  const auto has_gains = [&fit](std::size_t o) {
    return std::find(fit.without_gains.begin(), fit.without_gains.end(), o) ==
           fit.without_gains.end();
  };
  const FamilyResult& best = fit.chosen == Family::none ? fit.results.back() : chosen;
  for (std::size_t o = 0; o < tests.outputs.size(); ++o)
    if (has_gains(o)) add_deciding_run(tests, best, o, fit.warnings);
  if (fit.chosen == Family::none) {
    fit.warnings.emplace_back(
        fit.chosen_because == as_requested
            ? "no model, as requested: the matrix is 0"
            : "no family is better than no model on left-out data: the matrix is 0");
    return;
  }
  for (const std::size_t o : fit.without_gains)
    fit.warnings.push_back(tests.outputs[o] +
                           ": no better than without a model on left-out data: its coefficients "
                           "are 0. Next: thermocomp inspect, and fit it by itself");
  for (std::size_t o = 0; o < tests.outputs.size(); ++o)
    if (has_gains(o) && is_unfit(chosen.left_out_rms_um[o], none.left_out_rms_um[o]))
      fit.warnings.push_back(tests.outputs[o] +
                             printed(": on left-out data the model leaves %.0f %% of the RMS "
                                     "without a model; one that is fit "
                                     "for use leaves less than half. Next: thermocomp diagnose",
                                     100.0 * chosen.left_out_rms_um[o] / none.left_out_rms_um[o]));
  for (const auto& group : fit.together) {
    fit.warnings.push_back(
        joined(group) +
        " always moved together, so their gains cannot be separated. Next: a run "
        "in which they move apart, if they can");
  }
  for (std::size_t o = 0; o < tests.outputs.size(); ++o)
    for (std::size_t f = 0; f < tests.folds.size(); ++f)
      if (has_gains(o) && !(chosen.fold_um[o][f] < none.fold_um[o][f]))
        fit.warnings.push_back(tests.outputs[o] + ": on " + tests.fold_name(f) +
                               ", left out, the model is worse than no model");
}

}  // namespace thermocomp::identification
