#include "cli/model/covariance_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <sstream>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "config/model/model_file.hpp"
#include "config/runs/robust.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"

namespace thermocomp::cli {

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Index = Eigen::Index;

constexpr std::size_t cells_max = 50'000;  ///< rows of a run after averaging
constexpr std::size_t rows_min = 200;      ///< in all runs
constexpr Index half_rows_min = 40;        ///< too few rows show no growth of the error
constexpr int horizons = 16;
constexpr Index shortest_horizon = 4;  ///< cells
/// t(0.975, 3 degrees of freedom) / 1.96.
constexpr double small_sample = 1.624;
constexpr double hour_s = 3600.0;
constexpr std::array<double, 5> scatter_shares{1.0 / 800, 1.0 / 400, 1.0 / 200, 1.0 / 100,
                                               1.0 / 50};
constexpr std::array<double, 6> drift_shares{0.05, 0.1, 0.2, 0.4, 0.8, 1.6};

/// Half a run at equal pitch; gaps are closed.
struct Half {
  Matrix temps_degC;  ///< shape (rows, inputs)
  double pitch_s{1.0};
};

std::vector<const std::vector<double>*> columns_of(const RunFile& run,
                                                   const std::vector<std::string>& inputs) {
  std::vector<const std::vector<double>*> columns;
  std::vector<Problem> problems;
  for (const std::string& input : inputs) {
    const auto index = run.find(input);
    if (index)
      columns.push_back(&run.values[*index]);
    else
      problems.push_back({run.name, 0, input, "(missing)", "the model's input needs this column"});
  }
  if (!problems.empty()) throw ConfigurationError(problems);
  return columns;
}

double median_pitch_s(const std::vector<double>& times_s, std::size_t begin, std::size_t end) {
  std::vector<double> steps;
  for (std::size_t i = begin + 1; i < end; ++i) steps.push_back(times_s[i] - times_s[i - 1]);
  return steps.empty() ? 1.0 : median(std::move(steps));
}

/// Averages the selected rows over cells of equal length; omits cells with a missing input.
Half cells_of(const RunFile& run, const std::vector<std::string>& inputs) {
  const auto columns = columns_of(run, inputs);
  const std::vector<double>& times_s = run.time_s();
  const double begin_s = times_s[run.selected_begin];
  const double span_s = times_s[run.selected_end - 1] - begin_s;
  Half half;
  half.pitch_s = std::max(median_pitch_s(times_s, run.selected_begin, run.selected_end),
                          span_s / static_cast<double>(cells_max));
  const std::size_t count = inputs.size();
  std::vector<double> kept;
  std::vector<double> sums(count, 0.0);
  std::vector<int> counts(count, 0);
  const auto close_cell = [&] {
    if (std::all_of(counts.begin(), counts.end(), [](int each) { return each > 0; }))
      for (std::size_t i = 0; i < count; ++i) kept.push_back(sums[i] / counts[i]);
    std::fill(sums.begin(), sums.end(), 0.0);
    std::fill(counts.begin(), counts.end(), 0);
  };
  double cell = 0.0;
  for (std::size_t row = run.selected_begin; row < run.selected_end; ++row) {
    // Cells begin half a pitch early, so that rounding does not move a row between cells.
    const double its = std::floor((times_s[row] - begin_s) / half.pitch_s + 0.5);
    if (its != cell) close_cell();
    cell = its;
    for (std::size_t i = 0; i < count; ++i) {
      const double value = (*columns[i])[row];
      if (!std::isfinite(value)) continue;
      sums[i] += value;
      ++counts[i];
    }
  }
  close_cell();
  const auto rows = static_cast<Index>(kept.size() / count);
  half.temps_degC =
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
          kept.data(), rows, static_cast<Index>(count));
  return half;
}

/// Scatter matrix about the mean; zero for fewer than two rows.
Matrix scatter_of(const Matrix& rows) {
  if (rows.rows() < 2) return Matrix::Zero(rows.cols(), rows.cols());
  const Matrix centred = rows.rowwise() - rows.colwise().mean();
  return centred.transpose() * centred;
}

Matrix inverse_of(const Matrix& covariance_K2, double noise_K) {
  Matrix regular = covariance_K2;
  regular.diagonal().array() += noise_K * noise_K;
  return regular.llt().solve(Matrix::Identity(regular.rows(), regular.cols()));
}

/// Growth over time of the prediction errors in the halves left out.
struct Growths {
  std::vector<double> horizon_s;
  Matrix change_K2;  ///< shape (horizons, inputs): mean square
};

/// Errors of predicting each input from the others, in rows not used for the covariance.
Matrix errors_in(const Matrix& rows, const Matrix& precision) {
  const Matrix scaled = precision.diagonal().cwiseInverse().asDiagonal() * precision;
  return rows * scaled.transpose();
}

Growths growths_of(const std::vector<Half>& halves, double noise_K) {
  const Index inputs = halves.front().temps_degC.cols();
  double longest_s = 0.0;
  double pitch_s = 0.0;
  for (const Half& half : halves) {
    longest_s =
        std::max(longest_s, 2.0 / 3.0 * half.pitch_s * static_cast<double>(half.temps_degC.rows()));
    pitch_s = std::max(pitch_s, half.pitch_s);
  }
  Growths growths;
  Matrix sums = Matrix::Zero(horizons, inputs);
  Vector counts = Vector::Zero(horizons);
  const double shortest_s = static_cast<double>(shortest_horizon) * pitch_s;
  for (int h = 0; h < horizons; ++h)
    growths.horizon_s.push_back(shortest_s *
                                std::pow(longest_s / shortest_s, h / (horizons - 1.0)));
  for (std::size_t out = 0; out < halves.size(); ++out) {
    Matrix rest = Matrix::Zero(inputs, inputs);
    double rows = 0.0;
    for (std::size_t i = 0; i < halves.size(); ++i) {
      if (i == out) continue;
      rest += scatter_of(halves[i].temps_degC);
      rows += static_cast<double>(halves[i].temps_degC.rows());
    }
    const Matrix errors_K =
        errors_in(halves[out].temps_degC, inverse_of(rest / std::max(rows - 1.0, 1.0), noise_K));
    for (int h = 0; h < horizons; ++h) {
      const auto step = static_cast<Index>(
          std::lround(growths.horizon_s[static_cast<std::size_t>(h)] / halves[out].pitch_s));
      const Index pairs = errors_K.rows() - step;
      if (pairs <= 0 || step <= 0) continue;
      sums.row(h) += (errors_K.bottomRows(pairs) - errors_K.topRows(pairs))
                         .array()
                         .square()
                         .colwise()
                         .sum()
                         .matrix();
      counts(h) += static_cast<double>(pairs);
    }
  }
  growths.change_K2 = Matrix(horizons, inputs);
  for (int h = 0; h < horizons; ++h)
    growths.change_K2.row(h) = sums.row(h) / std::max(counts(h), 1.0);
  return growths;
}

struct Weights {
  double scatter{0.0};
  double drift{0.0};
};

/// Non-negative least squares weights of two columns for a sum of 1 in every row.
Weights weights_of(const Vector& scatter, const Vector& drift) {
  const double ss = scatter.squaredNorm();
  const double dd = drift.squaredNorm();
  const double sd = scatter.dot(drift);
  const double determinant = ss * dd - sd * sd;
  if (determinant > 1e-9 * ss * dd) {
    const Weights both{(dd * scatter.sum() - sd * drift.sum()) / determinant,
                       (ss * drift.sum() - sd * scatter.sum()) / determinant};
    if (both.scatter >= 0 && both.drift >= 0) return both;
    if (both.drift < 0) return {scatter.sum() / ss, 0.0};
  }
  return {0.0, drift.sum() / dd};
}

struct TwoParts {
  double cost{0.0};
  double scatter_s{0.0};
  double drift_s{0.0};
  Matrix variance_K2;  ///< shape (2, inputs): of scatter and drift
};

TwoParts fit_parts(const Growths& growths, double scatter_s, double drift_s) {
  TwoParts parts{0.0, scatter_s, drift_s, Matrix(2, growths.change_K2.cols())};
  for (Index input = 0; input < growths.change_K2.cols(); ++input) {
    Vector scatter(horizons);
    Vector drift(horizons);
    for (int h = 0; h < horizons; ++h) {
      // Relative, so that short and long horizons have equal weight.
      const double change_K2 = std::max(growths.change_K2(h, input), 1e-12);
      const double horizon_s = growths.horizon_s[static_cast<std::size_t>(h)];
      scatter(h) = -std::expm1(-horizon_s / scatter_s) / change_K2;
      drift(h) = -std::expm1(-horizon_s / drift_s) / change_K2;
    }
    const Weights weights = weights_of(scatter, drift);
    parts.variance_K2(0, input) = weights.scatter;
    parts.variance_K2(1, input) = weights.drift;
    const Vector sum = weights.scatter * scatter + weights.drift * drift;
    parts.cost += (sum - Vector::Ones(horizons)).squaredNorm();
  }
  return parts;
}

TwoParts best_parts(const Growths& growths, double run_s) {
  std::optional<TwoParts> best;
  for (const double scatter : scatter_shares)
    for (const double drift : drift_shares) {
      TwoParts parts = fit_parts(growths, scatter * run_s, drift * run_s);
      if (!best || parts.cost < best->cost) best = std::move(parts);
    }
  return *best;
}

void set_growth(CovarianceFit& fit, const std::vector<Half>& halves, double run_s,
                const Vector& variance_K2) {
  const TwoParts parts = best_parts(growths_of(halves, fit.growth.noise_K), run_s);
  fit.growth.scatter_time_s = parts.scatter_s;
  fit.growth.drift_time_s = parts.drift_s;
  for (Index i = 0; i < variance_K2.size(); ++i) {
    const auto factor = [&](Index part) {
      return small_sample * std::sqrt(parts.variance_K2(part, i) / variance_K2(i));
    };
    fit.growth.scatter_factor.push_back(factor(0));
    // The lower bound covers inputs that never changed in the record.
    fit.growth.drift_factor.push_back(std::max(1.0, factor(1)));
    const double scatter = fit.growth.scatter_factor.back();
    const double drift = fit.growth.drift_factor.back();
    fit.sd_1h_K.push_back(
        std::sqrt(variance_K2(i) * (scatter * scatter * -std::expm1(-hour_s / parts.scatter_s) +
                                    drift * drift * -std::expm1(-hour_s / parts.drift_s))));
  }
}

}  // namespace

CovarianceFit fit_covariance(std::span<const RunFile> runs,
                             const std::vector<std::string>& inputs) {
  CovarianceFit fit;
  const auto count = static_cast<Index>(inputs.size());
  Matrix sums = Matrix::Zero(count, count);
  std::vector<Half> halves;
  double longest_s = 0.0;
  for (const RunFile& run : runs) {
    const Half whole = cells_of(run, inputs);
    const Index rows = whole.temps_degC.rows();
    sums += scatter_of(whole.temps_degC);
    fit.rows += static_cast<std::size_t>(rows);
    fit.hours += whole.pitch_s * static_cast<double>(rows) / hour_s;
    longest_s = std::max(longest_s, whole.pitch_s * static_cast<double>(rows));
    if (rows / 2 < half_rows_min) continue;
    halves.push_back({whole.temps_degC.topRows(rows / 2), whole.pitch_s});
    halves.push_back({whole.temps_degC.bottomRows(rows - rows / 2), whole.pitch_s});
  }
  if (fit.rows < rows_min || halves.empty()) {
    throw ConfigurationError({{runs.empty() ? "covariance" : runs.front().name, 0, "rows",
                               std::to_string(fit.rows) + " with all inputs",
                               "must be at least " + std::to_string(rows_min) +
                                   " in all, and as many in one run as 80"}});
  }
  const Matrix covariance_K2 = sums / static_cast<double>(fit.rows - 1);
  for (Index i = 0; i < count; ++i) {
    auto& row = fit.matrix_K2.emplace_back();
    for (Index j = 0; j < count; ++j)
      row.push_back(0.5 * (covariance_K2(i, j) + covariance_K2(j, i)));
  }
  const Vector variance_K2 =
      inverse_of(covariance_K2, fit.growth.noise_K).diagonal().cwiseInverse();
  set_growth(fit, halves, longest_s, variance_K2);
  return fit;
}

namespace {

bool begins_table(const std::string& line) {
  const auto first = line.find_first_not_of(" \t");
  // A row of a matrix also begins with a bracket, but a table's name with a letter.
  if (first == std::string::npos || line[first] != '[') return false;
  const auto name = line.find_first_not_of("[ \t", first);
  return name != std::string::npos &&
         (std::isalpha(static_cast<unsigned char>(line[name])) != 0 || line[name] == '"');
}

}  // namespace

std::string with_covariance(const std::string& text, const ThermalModel& model) {
  std::istringstream lines(text);
  std::string kept;
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    if (begins_table(line)) inside = line.find("[covariance]") != std::string::npos;
    if (!inside) kept.append(line).append("\n");
  }
  while (kept.ends_with("\n\n")) kept.pop_back();
  kept.append("\n").append(write_covariance(model));
  // If the edited text does not parse to the same model, it is written anew, without its comments.
  const ModelReading reading = read_model_text(kept, "");
  const std::string written = write_model(model);
  return reading.problems.empty() && write_model(reading.model) == written ? kept : written;
}

}  // namespace thermocomp::cli
