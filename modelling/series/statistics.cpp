#include "modelling/series/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "config/text/units.hpp"
#include "estimator/types.hpp"
#include "modelling/identification/families/bank_fit.hpp"
#include "modelling/identification/measured_tests.hpp"

namespace thermocomp::series {
namespace {

constexpr double row_s_max = 3600.0;
constexpr double constant_s = 1800.0;
constexpr double penalty = 1e-4;       ///< of the remainder's fit, relative to a mean square
constexpr double ridge_of_map = 1e-3;  ///< relative to a column's mean square

[[noreturn]] void refuse(const std::string& file, const std::string& key, const std::string& rule) {
  throw ConfigurationError({Problem{file, 0, key, "", rule}});
}

std::vector<std::string> common_outputs(const std::vector<RunFile>& runs) {
  std::vector<std::string> outputs;
  for (const std::string& column : runs.front().columns)
    if (is_output(column) && std::all_of(runs.begin(), runs.end(), [&](const RunFile& run) {
          return run.find(column).has_value();
        }))
      outputs.push_back(column);
  if (outputs.empty()) refuse(runs.front().name, "", "has no displacement (*_um) or tilt (*_urad)");
  return outputs;
}

/// Columns of the files, including constant ones.
std::vector<Subject> subjects_of(const std::vector<RunFile>& runs) {
  std::vector<Subject> temperatures;
  std::vector<Subject> signals;
  for (const std::string& column : runs.front().columns) {
    if (column == "time_s" || !(is_temperature(column) || is_operating(column))) continue;
    Subject subject{column, 1.0, std::numeric_limits<double>::infinity(), 0, 0, 0, true};
    subject.high = subject.rise_high = -subject.low;
    subject.rise_low = subject.low;
    for (const RunFile& run : runs) {
      if (!run.find(column)) continue;
      double reference = not_a_number;
      const std::vector<double>& values = run.column(column);
      for (std::size_t i = 0; i < run.selected_end; ++i) {
        if (!std::isfinite(values[i])) continue;
        if (std::isnan(reference)) reference = is_temperature(column) ? values[i] : 0.0;
        if (i < run.selected_begin) continue;
        subject.low = std::min(subject.low, values[i]);
        subject.high = std::max(subject.high, values[i]);
        subject.rise_low = std::min(subject.rise_low, values[i] - reference);
        subject.rise_high = std::max(subject.rise_high, values[i] - reference);
      }
    }
    if (subject.low > subject.high) continue;  // no values
    (is_temperature(column) ? temperatures : signals).push_back(subject);
    if (is_temperature(column) || column.ends_with("_on")) continue;
    subject.power = 2.0;
    signals.push_back(subject);
  }
  temperatures.insert(temperatures.end(), signals.begin(), signals.end());
  return temperatures;
}

identification::BankColumns moving(const identification::MeasuredTests& tests, const Columns& all) {
  identification::BankColumns bank;
  const auto is_in = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  for (const Subject& subject : all.subjects) {
    if (!is_in(tests.places, subject.name) && !is_in(tests.signals, subject.name)) continue;
    bank.subjects.push_back(subject.name);
    bank.powers.push_back(subject.power);
  }
  bank.taus_s = all.taus_s;
  return bank;
}

std::vector<Eigen::Index> places_in(const identification::BankColumns& bank, const Columns& all) {
  std::vector<Eigen::Index> places;
  for (std::size_t t = 0; t < bank.taus_s.size(); ++t)
    for (std::size_t i = 0; i < bank.subjects.size(); ++i)
      places.push_back(all.find(bank.subjects[i], bank.powers[i]) +
                       static_cast<Eigen::Index>(t * all.subjects.size()));
  return places;
}

/// Time for the remainder's correlation to fall to 1/e; at least half a step.
double noise_time_of(const std::vector<Eigen::VectorXd>& left, double step_s) {
  const auto mean_product = [&](Eigen::Index lag) {
    double product = 0.0;
    double rows = 0.0;
    for (const Eigen::VectorXd& each : left) {
      if (each.size() <= lag) continue;
      product += each.head(each.size() - lag).dot(each.tail(each.size() - lag));
      rows += static_cast<double>(each.size() - lag);
    }
    return rows > 0 ? product / rows : 0.0;
  };
  Eigen::Index longest = 0;
  for (const Eigen::VectorXd& each : left) longest = std::max(longest, each.size());
  const double limit = mean_product(0) / 2.718281828459045;
  Eigen::Index lag = 1;
  while (lag < longest / 2 && mean_product(lag) > limit) lag = std::max(lag + 1, lag * 5 / 4);
  return lag == 1 ? 0.5 * step_s : static_cast<double>(lag) * step_s;
}

struct RunRows {
  Eigen::MatrixXd x;
  Eigen::MatrixXd y;
  Eigen::VectorXd seconds;
};

/// Adds the run's integrals with its constant removed.
void add(const RunRows& rows, const std::vector<Eigen::Index>& at, Statistics& statistics) {
  const Eigen::MatrixXd weighted = rows.seconds.asDiagonal() * rows.x;
  const double time_s = rows.seconds.sum();
  const Eigen::RowVectorXd sum_x = weighted.colwise().sum();
  const Eigen::RowVectorXd sum_y = rows.seconds.transpose() * rows.y;
  const double share = 1.0 / (time_s + constant_s);
  statistics.xx(at, at) += weighted.transpose() * rows.x - share * sum_x.transpose() * sum_x;
  statistics.xy(at, Eigen::all) +=
      weighted.transpose() * rows.y - share * sum_x.transpose() * sum_y;
  for (Eigen::Index o = 0; o < rows.y.cols(); ++o)
    statistics.yy[o] += rows.seconds.dot(rows.y.col(o).cwiseAbs2()) - share * sum_y[o] * sum_y[o];
  statistics.time_s += time_s;
}

void fill_noise_time(const std::vector<RunRows>& runs, const std::vector<Eigen::Index>& at,
                     Statistics& statistics) {
  const Eigen::MatrixXd xx = statistics.xx(at, at);
  const Eigen::VectorXd by = xx.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd penalised = by.asDiagonal() * xx * by.asDiagonal();
  penalised.diagonal().array() += penalty;
  const Eigen::MatrixXd b =
      by.asDiagonal() * penalised.ldlt().solve(by.asDiagonal() * statistics.xy(at, Eigen::all));
  double rows = 0.0;
  for (const RunRows& run : runs) rows += static_cast<double>(run.x.rows());
  for (Eigen::Index o = 0; o < b.cols(); ++o) {
    std::vector<Eigen::VectorXd> left;
    for (const RunRows& run : runs) {
      left.emplace_back(run.y.col(o) - run.x * b.col(o));
      left.back().array() -= left.back().mean();
    }
    statistics.noise_time_s.push_back(noise_time_of(left, statistics.time_s / rows));
  }
}

}  // namespace

Eigen::Index Columns::find(const std::string& name, double power) const {
  for (std::size_t i = 0; i < subjects.size(); ++i)
    if (subjects[i].name == name && subjects[i].power == power) return static_cast<Eigen::Index>(i);
  return -1;
}

Evidence Statistics::evidence(std::size_t output) const {
  const auto o = static_cast<Eigen::Index>(output);
  return {xx, xy.col(o), yy[o], time_s};
}

Statistics statistics_of(const std::vector<RunFile>& runs, std::string machine,
                         std::vector<std::string> outputs, const std::vector<double>& taus_s,
                         std::vector<std::string>& notes) {
  Statistics statistics;
  statistics.machine = std::move(machine);
  statistics.outputs = outputs.empty() ? common_outputs(runs) : std::move(outputs);
  identification::TestOptions options;
  options.outputs = statistics.outputs;
  options.signals = true;
  options.between_probings = true;
  const identification::MeasuredTests tests = measured_tests(runs, options);
  notes.insert(notes.end(), tests.notes.begin(), tests.notes.end());
  statistics.columns = {subjects_of(runs), taus_s};
  for (Subject& each : statistics.columns.subjects) each.moved = tests.moved(each.name);
  const identification::BankColumns bank = moving(tests, statistics.columns);
  const std::vector<Eigen::Index> at = places_in(bank, statistics.columns);
  const Eigen::Index count = statistics.columns.size();
  const auto outputs_count = static_cast<Eigen::Index>(statistics.outputs.size());
  statistics.xx = Eigen::MatrixXd::Zero(count, count);
  statistics.xy = Eigen::MatrixXd::Zero(count, outputs_count);
  statistics.yy = Eigen::VectorXd::Zero(outputs_count);
  std::vector<RunRows> all;
  for (const identification::TestRun& run : tests.runs) {
    std::vector<Eigen::Index> probed;  // from the first of the run, to which all are relative
    for (Eigen::Index row = 0; row < run.time_s.size(); ++row)
      if (run.outputs_um.row(row).allFinite()) probed.push_back(row);
    const auto rows = std::count_if(probed.begin(), probed.end(),
                                    [&run](Eigen::Index row) { return row >= run.begin; });
    RunRows& selected = all.emplace_back();
    selected.x = bank_of(run, tests, bank, probed).bottomRows(rows);
    probed.erase(probed.begin(), probed.end() - rows);
    selected.y = run.outputs_um(probed, Eigen::all);
    selected.seconds.resize(rows);
    const Eigen::VectorXd time_s = run.time_s(probed);
    for (Eigen::Index i = 0; i < rows; ++i)
      selected.seconds[i] =
          std::min(row_s_max, i + 1 < rows ? time_s[i + 1] - time_s[i] : time_s[i] - time_s[i - 1]);
    add(selected, at, statistics);
    statistics.runs.push_back(run.name);
  }
  fill_noise_time(all, at, statistics);
  return statistics;
}

Seen seen_by(const Columns& machine, const Columns& series, const Eigen::MatrixXd& moment) {
  Seen seen;
  std::vector<Eigen::Index> missing;
  for (std::size_t t = 0; t < series.taus_s.size(); ++t)
    for (std::size_t i = 0; i < series.subjects.size(); ++i) {
      const auto column = static_cast<Eigen::Index>(t * series.subjects.size() + i);
      const Eigen::Index own = machine.find(series.subjects[i].name, series.subjects[i].power);
      if (own < 0) {
        missing.push_back(column);
        continue;
      }
      seen.columns.push_back(column);
      seen.own.push_back(own + static_cast<Eigen::Index>(t * machine.subjects.size()));
    }
  if (seen.columns.empty())
    throw std::runtime_error("the machine has none of the series' temperatures and signals");
  const auto count = static_cast<Eigen::Index>(seen.columns.size());
  seen.map = Eigen::MatrixXd::Zero(count, series.size());
  for (Eigen::Index i = 0; i < count; ++i)
    seen.map(i, seen.columns[static_cast<std::size_t>(i)]) = 1.0;
  if (missing.empty()) return seen;
  const Eigen::VectorXd size = moment.diagonal().cwiseSqrt().cwiseMax(1e-12);
  const Eigen::VectorXd scale = size(seen.columns).cwiseInverse();
  Eigen::MatrixXd known =
      scale.asDiagonal() * moment(seen.columns, seen.columns) * scale.asDiagonal();
  known.diagonal().array() += ridge_of_map;
  seen.map(Eigen::all, missing) =
      scale.asDiagonal() * known.ldlt().solve(scale.asDiagonal() * moment(seen.columns, missing));
  return seen;
}

Evidence spread_out(const Evidence& evidence, const Seen& seen) {
  return {seen.map.transpose() * evidence.xx(seen.own, seen.own) * seen.map,
          seen.map.transpose() * evidence.xy(seen.own), evidence.yy, evidence.time_s};
}

}  // namespace thermocomp::series
