#include <algorithm>
#include <cmath>

#include "modelling/identification/families/families.hpp"
#include "modelling/identification/printed.hpp"
#include "modelling/series/series.hpp"

namespace thermocomp::series {
namespace {

using identification::Fold;
using identification::MeasuredTests;
using identification::printed;

constexpr Eigen::Index rows_min = 3;

double log_mean(const std::vector<double>& values_um) {
  double sum = 0.0;
  for (const double each : values_um) sum += std::log(std::max(each, 1e-30));
  return sum / static_cast<double>(values_um.size());
}

RunFile part_of(const RunFile& run, const Eigen::VectorXd& time_s, const Fold& fold) {
  const auto row_at = [&](Eigen::Index row) {
    const std::vector<double>& all_s = run.time_s();
    return static_cast<std::size_t>(std::lower_bound(all_s.begin(), all_s.end(), time_s[row]) -
                                    all_s.begin());
  };
  RunFile part = run;
  part.selected_begin = row_at(fold.begin);
  part.selected_end = row_at(fold.end - 1) + 1;
  return part;
}

}  // namespace

bool PriorJudgement::holds() const {
  for (std::size_t o = 0; o < prior_um.size(); ++o)
    if (!(prior_um[o] < none_um[o])) return false;
  return prior_um.empty() ||
         log_mean(prior_um) < log_mean(none_um) + std::log(1.0 - identification::less_than_none);
}

bool PriorJudgement::own_is_better() const {
  return !prior_um.empty() && log_mean(own_um) < log_mean(prior_um);
}

std::string PriorJudgement::text(const std::vector<std::string>& outputs) const {
  if (prior_um.empty()) return "too few rows to compare the prior with the machine's own fit\n";
  std::string text;
  for (std::size_t o = 0; o < outputs.size(); ++o)
    text += outputs[o] + printed(
                             ": RMS of left-out data: with the prior %.3g um, own fit %.3g um, no "
                             "model %.3g um\n",
                             prior_um[o], own_um[o], none_um[o]);
  return text;
}

PriorJudgement judged(const Series& prior, const std::vector<RunFile>& runs,
                      const MeasuredTests& tests, const ThermalModel& own,
                      const std::string& prior_name) {
  PriorJudgement judgement;
  for (const std::string& name : tests.outputs) {
    const MadeFrom::Output& output = own.made_from->outputs.at(name);
    judgement.own_um.push_back(output.left_out_rms_um);
    judgement.none_um.push_back(output.no_model_rms_um);
  }
  const MeasuredTests parts = tests.runs.size() > 1 ? tests : identification::in_halves(tests);
  std::vector<double> squares(tests.outputs.size(), 0.0);
  double rows = 0.0;
  for (const Fold& out : parts.folds) {
    if (out.end - out.begin < rows_min) return judgement;
    std::vector<RunFile> rest;
    for (const Fold& each : parts.folds)
      if (&each != &out)
        rest.push_back(part_of(runs[tests.given[each.run]], tests.runs[each.run].time_s, each));
    std::vector<std::string> notes;
    const Statistics machine =
        statistics_of(rest, "the machine", tests.outputs, prior.columns.taus_s, notes);
    MeasuredTests one = parts;
    one.folds = {out};
    const std::vector<double> left_um =
        remainders_um(one, adapted(prior, machine, prior_name).model);
    const auto count = static_cast<double>(out.end - out.begin);
    for (std::size_t o = 0; o < squares.size(); ++o) squares[o] += count * left_um[o] * left_um[o];
    rows += count;
  }
  for (const double each : squares) judgement.prior_um.push_back(std::sqrt(each / rows));
  return judgement;
}

}  // namespace thermocomp::series
