#include "modelling/series/series.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "config/model/model_file.hpp"
#include "config/text/units.hpp"
#include "estimator/model/displacement_model.hpp"
#include "modelling/identification/families/bank_fit.hpp"

namespace thermocomp::series {
namespace {

constexpr double usual_share = 0.1;  ///< smallest size of a temperature relative to the usual one
constexpr std::size_t left_out_max = 12;
constexpr double deviations_max = 5.0;
/// Smallest deviation of remainders, since sisters are few.
constexpr double least_deviation = 0.15;
constexpr double floor_K = 0.5;
constexpr double signal_floor = 0.05;

std::string_view stem_of(const std::string& name) {
  return std::string_view(name).substr(0, name.size() - unit_of(name).suffix.size());
}

/// @throws std::runtime_error if a name exists in both with different units
void refuse_other_units(const std::vector<std::string>& names,
                        const std::vector<std::string>& known, const std::string& machine) {
  for (const std::string& name : names)
    for (const std::string& other : known)
      if (name != other && stem_of(name) == stem_of(other) && kind_of(name) == kind_of(other))
        throw std::runtime_error(machine + ": " + name + ": the series has " + other +
                                 ", in another unit");
}

std::vector<std::string> names_of(const Columns& columns) {
  std::vector<std::string> names;
  for (const Subject& each : columns.subjects) names.push_back(each.name);
  return names;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

void widen(Subject& subject, const Subject& by) {
  subject.low = std::min(subject.low, by.low);
  subject.high = std::max(subject.high, by.high);
  subject.rise_low = std::min(subject.rise_low, by.rise_low);
  subject.rise_high = std::max(subject.rise_high, by.rise_high);
  subject.moved = subject.moved || by.moved;
}

/// All columns of any machine; temperatures first, as in a bank.
Columns columns_of_all(const std::vector<Statistics>& machines) {
  Columns all{{}, machines.front().columns.taus_s};
  for (const Statistics& machine : machines) {
    if (machine.columns.taus_s != all.taus_s)
      throw std::runtime_error(machine.machine +
                               ": its statistics have other time constants than " +
                               machines.front().machine);
    refuse_other_units(names_of(machine.columns), names_of(all), machine.machine);
    refuse_other_units(machine.outputs, machines.front().outputs, machine.machine);
    for (const std::string& output : machines.front().outputs)
      if (std::find(machine.outputs.begin(), machine.outputs.end(), output) ==
          machine.outputs.end())
        throw std::runtime_error(machine.machine + ": has no output " + output + "; it has " +
                                 joined(machine.outputs));
    for (const Subject& subject : machine.columns.subjects) {
      const Eigen::Index at = all.find(subject.name, subject.power);
      if (at < 0)
        all.subjects.push_back(subject);
      else
        widen(all.subjects[static_cast<std::size_t>(at)], subject);
    }
  }
  std::erase_if(all.subjects, [](const Subject& each) { return !each.moved; });
  std::stable_partition(all.subjects.begin(), all.subjects.end(),
                        [](const Subject& each) { return is_temperature(each.name); });
  return all;
}

/// Mean of x x' over the machines that have both columns.
Eigen::MatrixXd moment_of(const std::vector<Statistics>& machines, const Columns& all) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(all.size(), all.size());
  Eigen::MatrixXd time_s = sum;
  const Eigen::MatrixXd none = sum;
  for (const Statistics& machine : machines) {
    const Seen seen = seen_by(machine.columns, all, none);
    sum(seen.columns, seen.columns) += machine.xx(seen.own, seen.own);
    time_s(seen.columns, seen.columns).array() += machine.time_s;
  }
  return sum.array() / time_s.array().max(1e-12);
}

/// RMS of the columns with a lower bound: a tenth of the usual RMS (in quadrature) for
/// temperatures, 0.1 % of the largest value for signals.
Eigen::VectorXd sizes_of(const Eigen::MatrixXd& moment, const Columns& columns) {
  Eigen::VectorXd size = moment.diagonal().cwiseMax(0.0).cwiseSqrt();
  double usual_K = 0.0;
  double places = 0.0;
  for (std::size_t i = 0; i < columns.subjects.size(); ++i) {
    if (!is_temperature(columns.subjects[i].name)) continue;
    usual_K += std::pow(size[static_cast<Eigen::Index>(i)], 2.0);
    places += 1.0;
  }
  usual_K = usual_share * std::sqrt(usual_K / std::max(places, 1.0));
  for (Eigen::Index i = 0; i < size.size(); ++i) {
    const Subject& subject =
        columns.subjects[static_cast<std::size_t>(i) % columns.subjects.size()];
    if (is_temperature(subject.name))
      size[i] = std::max(std::hypot(size[i], usual_K), 1e-6);
    else
      size[i] = std::max(
          size[i], 1e-3 * std::pow(std::max({std::abs(subject.low), std::abs(subject.high), 1e-9}),
                                   subject.power));
  }
  return size;
}

Evidence scaled(const Evidence& evidence, const Eigen::VectorXd& size) {
  const Eigen::VectorXd by = size.cwiseInverse();
  return {by.asDiagonal() * evidence.xx * by.asDiagonal(), by.cwiseProduct(evidence.xy),
          evidence.yy, evidence.time_s};
}

double left_um(const Evidence& evidence, const Eigen::VectorXd& b) {
  const double square = evidence.yy - 2.0 * b.dot(evidence.xy) + b.dot(evidence.xx * b);
  return std::sqrt(std::max(square, 0.0) / evidence.time_s);
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// Degrees of freedom of S: the machines plus two assumed ones. Infinite for a machine's own past,
/// whose covariance comes from its rows and a stated drift.
double freedom_of(const Series& series) {
  if (!series.past_of.empty()) return std::numeric_limits<double>::infinity();
  return static_cast<double>(series.machines.size()) + 2.0;
}

std::size_t output_of(const Statistics& machine, const std::string& output) {
  const auto at = std::find(machine.outputs.begin(), machine.outputs.end(), output);
  if (at == machine.outputs.end())
    throw std::runtime_error(machine.machine + ": has no output " + output + "; it has " +
                             joined(machine.outputs));
  return static_cast<std::size_t>(at - machine.outputs.begin());
}

/// Mean square remainder of left-out machines by their sisters' mean, less the sisters' own,
/// divided by the value expected from their S; at least 1. The most likely S of few machines is too
/// small.
double widening_of(const std::vector<Evidence>& machines, const Assumed& assumed,
                   double noise_time_s) {
  if (machines.size() < 3) return 1.0;
  double left = 0.0;
  double expected = 0.0;
  for (std::size_t i = 0; i < std::min(machines.size(), left_out_max); ++i) {
    std::vector<Evidence> others = machines;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Population population = population_of(others, assumed, noise_time_s);
    const double left_of_mean_um = left_um(machines[i], population.mean);
    const Eigen::MatrixXd covariance = population.covariance + population.mean_covariance;
    left += std::max(std::pow(left_of_mean_um, 2.0) - std::pow(population.remainder_um, 2.0), 0.0);
    expected += (covariance * machines[i].xx).trace() / machines[i].time_s;
  }
  return std::max(1.0, left / expected);
}

OutputSeries output_series(const std::vector<Statistics>& machines, const std::string& output,
                           const std::vector<Seen>& seen, const Eigen::VectorXd& size,
                           double scatter) {
  std::vector<Evidence> evidences;
  double yy = 0.0;
  double time_s = 0.0;
  double noise_s2 = 0.0;
  for (std::size_t i = 0; i < machines.size(); ++i) {
    const std::size_t o = output_of(machines[i], output);
    evidences.push_back(scaled(spread_out(machines[i].evidence(o), seen[i]), size));
    yy += evidences.back().yy;
    time_s += evidences.back().time_s;
    noise_s2 += machines[i].noise_time_s[o] * machines[i].time_s;
  }
  OutputSeries series;
  series.noise_time_s = noise_s2 / time_s;
  series.displacement_um = std::sqrt(yy / time_s);
  if (!(series.displacement_um > 0)) throw std::runtime_error(output + ": is constant");
  const auto columns = static_cast<double>(size.size());
  Assumed assumed;
  assumed.mean_sd = Eigen::VectorXd::Constant(size.size(), series.displacement_um);
  assumed.scatter_sd = assumed.mean_sd * scatter / std::sqrt(columns);
  const Population population = population_of(evidences, assumed, series.noise_time_s);
  series.remainder_um = population.remainder_um;
  for (const Evidence& each : evidences)
    series.remainders_um.push_back(left_um(
        each, posterior(each, population.density(), population.mean, population.covariance).mean));
  const Eigen::VectorXd by = size.cwiseInverse();
  series.mean = by.cwiseProduct(population.mean);
  series.covariance = widening_of(evidences, assumed, series.noise_time_s) * by.asDiagonal() *
                      (population.covariance + population.mean_covariance) * by.asDiagonal();
  return series;
}

/// Features of ModelDomain over the ranges of the machine and its sisters.
void fill_domain(const Columns& columns, MadeFrom& made_from) {
  // A signal may be there by its square only.
  const auto subject = [&](const std::string& name) {
    const Eigen::Index linear = columns.find(name, 1.0);
    return columns
        .subjects[static_cast<std::size_t>(linear >= 0 ? linear : columns.find(name, 2.0))];
  };
  std::vector<double> sd;
  const auto add = [&](double low, double high, double least) {
    made_from.mean.push_back(0.5 * (low + high));
    sd.push_back(std::max(0.25 * (high - low), least));
  };
  for (const std::string& name : made_from.columns) {
    made_from.low.push_back(subject(name).low);
    made_from.high.push_back(subject(name).high);
    if (is_temperature(name)) add(subject(name).low, subject(name).high, floor_K);
  }
  for (std::size_t i = 0; i < made_from.taus_s.size(); ++i)
    for (const std::string& name : made_from.columns) {
      const Subject& each = subject(name);
      const double range = each.rise_high - each.rise_low;
      add(each.rise_low, each.rise_high,
          is_temperature(name) ? floor_K : std::max(signal_floor * range, 1e-6));
    }
  made_from.covariance.assign(sd.size(), std::vector<double>(sd.size(), 0.0));
  for (std::size_t i = 0; i < sd.size(); ++i) made_from.covariance[i][i] = sd[i] * sd[i];
  made_from.distance_max = 2.0;  // all features at a limit of their range
}

MadeFrom made_from_of(const Series& series, const Statistics& machine, const Columns& columns,
                      const ThermalModel& model, const std::string& prior_name) {
  MadeFrom made_from;
  made_from.runs = machine.runs;
  made_from.runs.push_back("prior " + prior_name);
  made_from.hours = machine.time_s / 3600.0;
  made_from.rows = static_cast<double>(machine.runs.size());
  made_from.columns = model.temperature_columns();
  for (const std::string& name : model.signal_columns()) made_from.columns.push_back(name);
  made_from.taus_s = {0.0, 900.0, 8100.0};
  while (made_from.taus_s.size() > 1 && domain_features(made_from) > domain_features_max)
    made_from.taus_s.pop_back();
  fill_domain(columns, made_from);
  for (const auto& [name, output] : series.outputs) {
    MadeFrom::Output& stated = made_from.outputs[name];
    stated.noise_time_s = output.noise_time_s;
    stated.no_model_rms_um = output.displacement_um;
    stated.freedom = std::max(1.0, machine.time_s / (2.0 * output.noise_time_s));
  }
  return made_from;
}

ThermalModel bank_of_machine(const Columns& columns, const std::vector<std::string>& outputs,
                             const Eigen::MatrixXd& gains) {
  identification::BankColumns bank;
  std::vector<std::string> places;
  for (const Subject& each : columns.subjects) {
    bank.subjects.push_back(each.name);
    bank.powers.push_back(each.power);
    if (is_temperature(each.name)) places.push_back(each.name);
  }
  bank.taus_s = columns.taus_s;
  return identification::bank_model(places, outputs, bank, gains);
}

}  // namespace

Series series_of(const std::vector<Statistics>& machines, std::optional<double> scatter) {
  if (machines.size() < 2 && !scatter)
    throw std::runtime_error(
        "one machine does not show how machines of the type differ; add a second machine or give "
        "--scatter 0.15");
  Series series;
  series.columns = columns_of_all(machines);
  series.moment = moment_of(machines, series.columns);
  const Eigen::VectorXd size = sizes_of(series.moment, series.columns);
  std::vector<Seen> seen;
  for (const Statistics& machine : machines) {
    if (std::find(series.machines.begin(), series.machines.end(), machine.machine) !=
        series.machines.end())
      throw std::runtime_error(machine.machine + ": two machines have this name");
    series.machines.push_back(machine.machine);
    series.hours += machine.time_s / 3600.0;
    if (!(machine.xx.diagonal().maxCoeff() > 0))
      throw std::runtime_error(machine.machine + ": none of its temperatures and signals changes");
    seen.push_back(seen_by(machine.columns, series.columns, series.moment));
  }
  for (const std::string& output : machines.front().outputs)
    series.outputs[output] =
        output_series(machines, output, seen, size, scatter.value_or(scatter_default));
  return series;
}

Series drifted(Series series, double drift, double years) {
  const Eigen::VectorXd size = sizes_of(series.moment, series.columns);
  for (auto& [name, output] : series.outputs) {
    const double sd_um = drift * std::sqrt(years) * output.displacement_um /
                         std::sqrt(static_cast<double>(size.size()));
    output.covariance.diagonal() += (sd_um * size.cwiseInverse()).cwiseAbs2();
  }
  return series;
}

Adapted adapted(const Series& series, const Statistics& machine, const std::string& prior_name) {
  refuse_other_units(names_of(machine.columns), names_of(series.columns), machine.machine);
  const Seen seen = seen_by(machine.columns, series.columns, series.moment);
  Columns own{{}, series.columns.taus_s};
  for (Subject subject : series.columns.subjects) {
    const Eigen::Index at = machine.columns.find(subject.name, subject.power);
    if (at < 0) continue;
    widen(subject, machine.columns.subjects[static_cast<std::size_t>(at)]);
    own.subjects.push_back(subject);
  }
  const auto count = static_cast<Eigen::Index>(machine.outputs.size());
  Eigen::MatrixXd gains(own.size(), count);
  Adapted result;
  std::vector<double> spread_um;
  std::vector<double> remainder_um;
  for (Eigen::Index o = 0; o < count; ++o) {
    const std::string& name = machine.outputs[static_cast<std::size_t>(o)];
    const auto found = series.outputs.find(name);
    if (found == series.outputs.end())
      throw std::runtime_error(prior_name + ": has no output " + name);
    const OutputSeries& output = found->second;
    const Evidence evidence = spread_out(machine.evidence(static_cast<std::size_t>(o)), seen);
    const Coefficients& b = result.coefficients[name] =
        posterior(evidence, output.density(), output.mean, output.covariance);
    gains.col(o) = seen.map * b.mean;
    remainder_um.push_back(left_um(evidence, b.mean));
    spread_um.push_back(
        std::sqrt((b.covariance * series.moment).trace() + std::pow(output.remainder_um, 2.0)));
  }
  result.model = bank_of_machine(own, machine.outputs, gains);
  MadeFrom& made_from =
      result.model.made_from.emplace(made_from_of(series, machine, own, result.model, prior_name));
  std::erase_if(made_from.outputs, [&](const auto& each) {
    return std::find(machine.outputs.begin(), machine.outputs.end(), each.first) ==
           machine.outputs.end();
  });
  for (std::size_t o = 0; o < machine.outputs.size(); ++o) {
    made_from.outputs[machine.outputs[o]].left_out_rms_um = spread_um[o];
    made_from.outputs[machine.outputs[o]].remainder_rms_um = remainder_um[o];
  }
  return result;
}

Series own_series(const Series& prior, const Statistics& machine, const std::string& prior_name,
                  double drift) {
  const Adapted own = adapted(prior, machine, prior_name);
  Series series = prior;
  series.machines.push_back(machine.machine);
  series.past_of = machine.machine;
  series.hours += machine.time_s / 3600.0;
  std::erase_if(series.outputs,
                [&](const auto& each) { return !own.coefficients.contains(each.first); });
  for (auto& [name, output] : series.outputs) {
    output.mean = own.coefficients.at(name).mean;
    output.covariance = own.coefficients.at(name).covariance;
  }
  return drifted(std::move(series), drift, 1.0);
}

std::vector<Comparison> compared(const Series& series, const Statistics& machine) {
  refuse_other_units(names_of(machine.columns), names_of(series.columns), machine.machine);
  const Seen seen = seen_by(machine.columns, series.columns, series.moment);
  std::vector<Group> groups;
  for (std::size_t i = 0; i < series.columns.subjects.size(); ++i) {
    const Subject& subject = series.columns.subjects[i];
    if (machine.columns.find(subject.name, subject.power) < 0) continue;
    if (groups.empty() || groups.back().name != subject.name) groups.push_back({subject.name, {}});
    for (std::size_t t = 0; t < series.columns.taus_s.size(); ++t)
      groups.back().columns.push_back(
          static_cast<Eigen::Index>(t * series.columns.subjects.size() + i));
  }
  std::vector<Comparison> comparisons;
  for (const auto& [name, output] : series.outputs) {
    const Evidence evidence = spread_out(machine.evidence(output_of(machine, name)), seen);
    Comparison& comparison = comparisons.emplace_back();
    comparison.output = name;
    comparison.false_alarm = false_alarms_a_night / static_cast<double>(series.outputs.size());
    comparison.departure = departure_of(evidence, output.density(), output.mean, output.covariance,
                                        freedom_of(series), groups);
    comparison.remainder_um = left_um(
        evidence, posterior(evidence, output.density(), output.mean, output.covariance).mean);
    if (output.remainders_um.size() < 3) continue;
    std::vector<double> logarithms;
    for (const double each : output.remainders_um)
      logarithms.push_back(std::log(std::max(each, 1e-9)));
    const double median = median_of(logarithms);
    for (double& each : logarithms) each = std::abs(each - median);
    comparison.median_um = std::exp(median);
    comparison.deviations = (std::log(std::max(comparison.remainder_um, 1e-9)) - median) /
                            std::max(1.4826 * median_of(logarithms), least_deviation);
  }
  return comparisons;
}

bool departs(const Comparison& comparison) {
  return comparison.departure.probability < comparison.false_alarm ||
         comparison.deviations > deviations_max;
}

Series series_of_model(const ThermalModel& model, const std::string& file, double drift,
                       double years) {
  if (!model.made_from)
    throw std::runtime_error(file + ": has no [made_from], so its error is unknown");
  Series series;
  series.machines = {file};
  series.runs = model.made_from->runs;
  series.hours = model.made_from->hours;
  series.columns.taus_s = {0.0};
  for (const TermSpec& term : model.terms) {
    if (!term.is_bank())
      throw std::runtime_error(file + ": the term " + term.kind +
                               " is not a bank; use fit --family lag_bank or a series");
    if (series.columns.taus_s.size() > 1 && series.columns.taus_s != term.bank.taus_s)
      throw std::runtime_error(file + ": its banks have different time constants");
    series.columns.taus_s = term.bank.taus_s;
  }
  if (series.columns.taus_s.front() != 0.0)
    series.columns.taus_s.insert(series.columns.taus_s.begin(), 0.0);
  const MadeFrom& made_from = *model.made_from;
  const auto add = [&](const std::string& name, double power) {
    if (series.columns.find(name, power) >= 0) return;
    const auto at = std::find(made_from.columns.begin(), made_from.columns.end(), name);
    const auto i = static_cast<std::size_t>(at - made_from.columns.begin());
    Subject subject{name, power, made_from.low.at(i), made_from.high.at(i), 0, 0, true};
    const double range = subject.high - subject.low;
    subject.rise_low = is_temperature(name) ? std::min(0.0, -0.25 * range) : subject.low;
    subject.rise_high = is_temperature(name) ? range : subject.high;
    series.columns.subjects.push_back(subject);
  };
  for (const std::string& name : model.inputs) add(name, 1.0);
  for (const TermSpec& term : model.terms)
    for (std::size_t i = 0; i < term.bank.subjects.size(); ++i)
      add(term.bank.subjects[i], term.bank.powers.empty() ? 1.0 : term.bank.powers[i]);
  std::stable_partition(series.columns.subjects.begin(), series.columns.subjects.end(),
                        [](const Subject& each) { return is_temperature(each.name); });
  const std::size_t subjects = series.columns.subjects.size();
  // A model file has no moments: assumes a uniform distribution over each column's range.
  series.moment = Eigen::MatrixXd::Zero(series.columns.size(), series.columns.size());
  for (Eigen::Index i = 0; i < series.moment.rows(); ++i) {
    const Subject& each = series.columns.subjects[static_cast<std::size_t>(i) % subjects];
    const double size = std::max(std::abs(each.rise_low), std::abs(each.rise_high)) / 2.0;
    series.moment(i, i) = std::pow(std::max(size, 1e-3), 2.0 * each.power);
  }
  const Eigen::VectorXd size = sizes_of(series.moment, series.columns);
  for (std::size_t o = 0; o < model.outputs.size(); ++o) {
    const std::string& name = model.outputs[o];
    const auto stated = made_from.outputs.find(name);
    if (stated == made_from.outputs.end())
      throw std::runtime_error(file + ": [made_from] has no output " + name);
    OutputSeries& output = series.outputs[name];
    output.mean = Eigen::VectorXd::Zero(series.columns.size());
    for (std::size_t i = 0; i < model.inputs.size(); ++i)
      output.mean[series.columns.find(model.inputs[i], 1.0)] += model.matrix_um_per_K[o][i];
    for (const TermSpec& term : model.terms) {
      const auto gains = term.bank.gain_um_per_unit.find(name);
      if (gains == term.bank.gain_um_per_unit.end()) continue;
      for (std::size_t i = 0; i < term.bank.subjects.size(); ++i)
        for (std::size_t t = 0; t < term.bank.taus_s.size(); ++t) {
          const auto tau = std::find(series.columns.taus_s.begin(), series.columns.taus_s.end(),
                                     term.bank.taus_s[t]);
          output
              .mean[series.columns.find(term.bank.subjects[i],
                                        term.bank.powers.empty() ? 1.0 : term.bank.powers[i]) +
                    (tau - series.columns.taus_s.begin()) * static_cast<Eigen::Index>(subjects)] +=
              gains->second[i][t];
        }
    }
    output.displacement_um = std::max(stated->second.no_model_rms_um, 1e-9);
    output.remainder_um = std::max(stated->second.remainder_rms_um, 1e-3);
    output.noise_time_s = std::max(stated->second.noise_time_s, 1.0);
    output.remainders_um = {output.remainder_um};
    const double left_um = stated->second.left_out_rms_um;
    const double sd_um = std::sqrt(left_um * left_um / static_cast<double>(size.size()));
    output.covariance = (sd_um * size.cwiseInverse()).cwiseAbs2().asDiagonal();
  }
  return drifted(std::move(series), drift, years);
}

}  // namespace thermocomp::series
