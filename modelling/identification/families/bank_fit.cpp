#include "modelling/identification/families/bank_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include <Eigen/Eigenvalues>

#include "estimator/model/terms/low_pass.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::identification {
namespace {

constexpr std::size_t columns_max = 600;
constexpr std::size_t parts_inside_max = 8;
constexpr std::size_t parts_inside_of_many_columns = 4;
constexpr std::size_t many_columns = 200;
constexpr std::size_t folds_enough_inside = 4;
constexpr double shortest_s = 300.0;
constexpr double ratio = 3.0;
constexpr std::size_t lags_max = 6;
constexpr int hinges_a_signal = 8;
constexpr std::size_t values_of_a_switch_max = 6;
/// A hinge counts as half of what it moves: nothing but the recording says that it is there.
constexpr double weight_of_hinge = 0.5;
// Of columns as scales() leaves them: added to a mean square, and of the correlation with the
// output.
constexpr std::array<double, 7> ridge_penalties{1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0};
constexpr std::array<double, 6> l1_prices{0.3, 0.1, 0.03, 0.01, 0.003, 0.001};
// Where nothing chooses: a column says what it stands for to 3, 5 and 10 % of the motion that
// scales() divides by, errors of that size being what a ridge of 0.001, 0.003 and 0.01 stands for;
// L1 prices alike.
constexpr std::array<double, 3> unchosen_penalties{1e-3, 3e-3, 1e-2};
constexpr std::array<double, 3> unchosen_prices{1e-2, 3e-3, 1e-3};
constexpr int l1_rounds_max = 300;
constexpr double l1_tolerance = 1e-4;
constexpr std::size_t nothing = std::numeric_limits<std::size_t>::max();

bool is_switch(const MeasuredTests& tests, Eigen::Index signal) {
  return std::all_of(tests.runs.begin(), tests.runs.end(), [&](const TestRun& run) {
    const auto column = run.signals.col(signal).array();
    return (column == 0.0 || column == 1.0).all();
  });
}

Eigen::MatrixXd ridge(const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>& solver,
                      const Eigen::MatrixXd& xy, double penalty) {
  const Eigen::VectorXd values = solver.eigenvalues().cwiseMax(0.0).array() + penalty;
  return solver.eigenvectors() *
         (values.cwiseInverse().asDiagonal() * (solver.eigenvectors().transpose() * xy));
}

/// Coordinate descent, min 1/2 w'Aw - c'w + price |w|_1, begun at `w`.
void descend(const Eigen::MatrixXd& a, const Eigen::VectorXd& c, double price, Eigen::VectorXd& w) {
  Eigen::VectorXd rest = c - a * w;
  for (int round = 0; round < l1_rounds_max; ++round) {
    double moved = 0.0;
    for (Eigen::Index j = 0; j < w.size(); ++j) {
      if (!(a(j, j) > 0)) continue;
      const double pull = rest[j] + a(j, j) * w[j];
      const double next = std::copysign(std::max(std::abs(pull) - price, 0.0), pull) / a(j, j);
      const double change = next - w[j];
      if (change == 0.0) continue;
      rest.noalias() -= change * a.col(j);
      w[j] = next;
      moved = std::max(moved, std::abs(change));
    }
    if (!(moved > l1_tolerance)) break;
  }
}

/// What the columns are multiplied by before they are fitted; 0 for what never moves.
///
/// Scaled by its own standard deviation, a place that hardly warmed in the runs is trusted with as
/// much displacement as one that did, and carries it far where it warms another day; scaled alike
/// per kelvin, a place is believed as little as it moved. Divided by the geometric mean of both,
/// measured machines are predicted best (docs/measurements.md). A signal's unit says nothing: its
/// own standard deviation stands for that of the temperatures.
/// @param deviation  standard deviation of each column
/// @param size       its RMS
Eigen::VectorXd scales(const Eigen::VectorXd& deviation, const Eigen::VectorXd& size,
                       std::size_t places, const BankColumns& columns) {
  const auto of_places = static_cast<Eigen::Index>(places);
  const auto of_all = static_cast<Eigen::Index>(columns.subjects.size());
  const auto late = static_cast<Eigen::Index>(columns.late());
  const double usual_K = std::sqrt(deviation.head(of_places).squaredNorm() /
                                   static_cast<double>(std::max<std::size_t>(places, 1)));
  Eigen::VectorXd scale = Eigen::VectorXd::Zero(deviation.size());
  for (Eigen::Index i = 0; i < deviation.size(); ++i) {
    if (!(deviation[i] > 1e-12 * size[i])) continue;
    if (i >= late) {
      scale[i] = weight_of_hinge / deviation[i];
      continue;
    }
    const Eigen::Index subject = i % of_all;
    const double kind = subject < of_places ? usual_K : deviation[subject];
    const double product = deviation[i] * kind;
    if (product > 0) scale[i] = 1.0 / std::sqrt(product);
  }
  return scale;
}

struct Rows {
  Eigen::MatrixXd x;
  Eigen::MatrixXd y;
};

/// Those in which no output is missing.
Rows complete_rows(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
  std::vector<Eigen::Index> complete;
  for (Eigen::Index row = 0; row < y.rows(); ++row)
    if (y.row(row).allFinite()) complete.push_back(row);
  return {x(complete, Eigen::all), y(complete, Eigen::all)};
}

/// Weights of penalties by what they leave: e^-8 each.
std::vector<double> weights(const std::vector<double>& left_um2) {
  const double least = *std::min_element(left_um2.begin(), left_um2.end());
  std::vector<double> result;
  double sum = 0.0;
  for (const double each : left_um2) {
    result.push_back(each > 0 ? std::pow(least / each, 4.0) : 1.0);
    sum += result.back();
  }
  for (double& each : result) each /= sum;
  return result;
}

}  // namespace

BankColumns bank_columns(const MeasuredTests& tests) {
  BankColumns bank;
  for (const std::string& place : tests.places) {
    bank.subjects.push_back(place);
    bank.powers.push_back(1.0);
  }
  for (std::size_t i = 0; i < tests.signals.size(); ++i)
    for (const double power : {1.0, 2.0}) {
      if (power > 1.5 && is_switch(tests, static_cast<Eigen::Index>(i))) continue;
      bank.subjects.push_back(tests.signals[i]);
      bank.powers.push_back(power);
    }
  double longest_s = 0.0;
  std::vector<double> steps_s;
  for (const TestRun& run : tests.runs) {
    const Eigen::Index rows = run.time_s.size();
    longest_s = std::max(longest_s, run.time_s[rows - 1] - run.time_s[0]);
    for (Eigen::Index row = 1; row < rows; ++row)
      steps_s.push_back(run.time_s[row] - run.time_s[row - 1]);
  }
  std::nth_element(steps_s.begin(),
                   steps_s.begin() + static_cast<std::ptrdiff_t>(steps_s.size() / 2),
                   steps_s.end());
  const double step_s = steps_s[steps_s.size() / 2];
  const std::size_t lags = std::min(lags_max, columns_max / bank.subjects.size());
  bank.taus_s = {0.0};
  for (double tau_s = std::max(shortest_s, 2.0 * step_s);
       tau_s <= longest_s / 2.0 && tau_s <= term_tau_s_max && bank.taus_s.size() < lags;
       tau_s *= ratio)
    bank.taus_s.push_back(std::round(tau_s));
  return bank;
}

void add_hinges(const MeasuredTests& tests, BankColumns& columns) {
  std::vector<Hinge> hinges;
  for (std::size_t i = 0; i < tests.signals.size(); ++i) {
    std::set<double> values;  // as many as tell a switch from what varies
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const TestRun& run : tests.runs)
      for (const double value : run.signals.col(static_cast<Eigen::Index>(i))) {
        low = std::min(low, value);
        high = std::max(high, value);
        if (values.size() <= values_of_a_switch_max) values.insert(value);
      }
    if (values.size() <= values_of_a_switch_max) continue;
    const double step = (high - low) / (hinges_a_signal + 1);
    for (int j = 1; j <= hinges_a_signal; ++j) hinges.push_back({tests.signals[i], low + j * step});
  }
  if (columns.late() + hinges.size() <= columns_max) columns.hinges = std::move(hinges);
}

Eigen::MatrixXd bank_of(const TestRun& run, const MeasuredTests& tests,
                        const BankColumns& columns) {
  const Eigen::Index rows = run.time_s.size();
  const auto subjects = static_cast<Eigen::Index>(columns.subjects.size());
  Eigen::MatrixXd values(rows, subjects);
  values.leftCols(run.places_K.cols()) = run.places_K;
  for (Eigen::Index i = run.places_K.cols(); i < subjects; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const auto signal = std::find(tests.signals.begin(), tests.signals.end(), columns.subjects[at]);
    values.col(i) = run.signals.col(signal - tests.signals.begin());
    if (columns.powers[at] > 1.5) values.col(i) = values.col(i).cwiseAbs2().eval();
  }
  Eigen::MatrixXd bank(rows, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t j = 0; j < columns.taus_s.size(); ++j)
    for (Eigen::Index i = 0; i < subjects; ++i) {
      LowPass late(columns.taus_s[j]);
      auto column = bank.col(static_cast<Eigen::Index>(j) * subjects + i);
      for (Eigen::Index row = 0; row < rows; ++row)
        column[row] = late.step(
            std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(run.time_s[row])),
            values(row, i));
      column.array() -= values(0, i);
    }
  auto at = static_cast<Eigen::Index>(columns.late());
  for (const Hinge& hinge : columns.hinges) {
    const auto signal = std::find(tests.signals.begin(), tests.signals.end(), hinge.signal);
    auto column = bank.col(at++);
    column = (run.signals.col(signal - tests.signals.begin()).array() - hinge.above).max(0.0);
    column.array() -= double{column[0]};
  }
  return bank;
}

TermSpec bank_term(const BankColumns& columns, const std::vector<std::string>& outputs,
                   const Eigen::MatrixXd& gains) {
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = columns.subjects;
  term.bank.powers = columns.powers;
  term.bank.taus_s = columns.taus_s;
  const std::size_t subjects = columns.subjects.size();
  for (std::size_t o = 0; o < outputs.size(); ++o) {
    const auto column = gains.col(static_cast<Eigen::Index>(o));
    auto& table = term.bank.gain_um_per_unit[outputs[o]];
    for (std::size_t i = 0; i < subjects; ++i) {
      auto& of_subject = table.emplace_back();
      for (std::size_t j = 0; j < columns.taus_s.size(); ++j)
        of_subject.push_back(column[static_cast<Eigen::Index>(j * subjects + i)]);
    }
  }
  return term;
}

std::vector<TermSpec> hinge_terms(const BankColumns& columns,
                                  const std::vector<std::string>& outputs,
                                  const Eigen::MatrixXd& gains) {
  std::vector<TermSpec> terms;
  auto row = static_cast<Eigen::Index>(columns.late());
  for (const Hinge& hinge : columns.hinges) {
    TermSpec& term = terms.emplace_back();
    term.kind = "signal_hinge";
    term.subject = hinge.signal;
    term.shared["above"] = hinge.above;
    for (std::size_t o = 0; o < outputs.size(); ++o)
      term.per_output["gain_um_per_unit"][outputs[o]] = gains(row, static_cast<Eigen::Index>(o));
    ++row;
  }
  return terms;
}

BankEquations::BankEquations(const MeasuredTests& tests, const BankColumns& columns) {
  const auto count = static_cast<Eigen::Index>(columns.size());
  for (const TestRun& run : tests.runs) rows_.push_back(bank_of(run, tests, columns));
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd squares = sum;
  const std::size_t folds = tests.folds.size();
  // With few runs, stretches of them are left out inside, else whole runs.
  const std::size_t cuts = folds < folds_enough_inside ? (parts_inside_max + folds - 1) / folds : 1;
  for (std::size_t f = 0; f < folds; ++f)
    for (std::size_t cut = 0; cut < cuts; ++cut) {
      const Fold& fold = tests.folds[f];
      const Eigen::Index length = fold.end - fold.begin;
      const auto at = [&](std::size_t i) {
        return length * static_cast<Eigen::Index>(i) / static_cast<Eigen::Index>(cuts);
      };
      const Eigen::Index begin = fold.begin + at(cut);
      const Rows part =
          complete_rows(rows_[fold.run].middleRows(begin, at(cut + 1) - at(cut)),
                        tests.runs[fold.run].outputs_um.middleRows(begin, at(cut + 1) - at(cut)));
      const Eigen::MatrixXd& x = part.x;
      const Eigen::MatrixXd& y = part.y;
      Sums& sums = pieces_.emplace_back();
      sums.xx = x.transpose() * x;
      sums.xy = x.transpose() * y;
      sums.yy = y.colwise().squaredNorm().transpose();
      sums.rows = static_cast<double>(x.rows());
      sum += x.colwise().sum().transpose();
      squares += sums.xx.diagonal();
      fold_.push_back(f);
    }
  const auto rows = static_cast<double>(tests.rows());
  const Eigen::VectorXd variance = squares / rows - (sum / rows).cwiseAbs2();
  scale_ = scales(variance.cwiseMax(0.0).cwiseSqrt(), (squares / rows).cwiseSqrt(),
                  tests.places.size(), columns);
  for (Sums& sums : pieces_) {
    sums.xx = scale_.asDiagonal() * sums.xx * scale_.asDiagonal();
    sums.xy = scale_.asDiagonal() * sums.xy;
  }
  runs_choose_ = tests.runs.size() >= folds_enough_inside;
  parts_ = std::min(columns.size() > many_columns ? parts_inside_of_many_columns : parts_inside_max,
                    pieces_.size());
  for (std::size_t i = 0; i < pieces_.size(); ++i) part_.push_back(i * parts_ / pieces_.size());
}

BankEquations::Sums BankEquations::sums_without(std::size_t left_out, std::size_t part) const {
  Sums sums;
  sums.xx = Eigen::MatrixXd::Zero(pieces_[0].xx.rows(), pieces_[0].xx.cols());
  sums.xy = Eigen::MatrixXd::Zero(pieces_[0].xy.rows(), pieces_[0].xy.cols());
  sums.yy = Eigen::VectorXd::Zero(pieces_[0].yy.size());
  for (std::size_t f = 0; f < pieces_.size(); ++f) {
    if (fold_[f] == left_out || part_[f] == part) continue;
    sums.xx += pieces_[f].xx;
    sums.xy += pieces_[f].xy;
    sums.yy += pieces_[f].yy;
    sums.rows += pieces_[f].rows;
  }
  return sums;
}

std::vector<Eigen::MatrixXd> BankEquations::ridge_path(const Sums& sums,
                                                       std::span<const double> penalties) {
  std::vector<Eigen::MatrixXd> all;
  const double rows = std::max(1.0, sums.rows);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(sums.xx / rows);
  for (const double penalty : penalties) all.push_back(ridge(solver, sums.xy / rows, penalty));
  return all;
}

std::vector<Eigen::MatrixXd> BankEquations::l1_path(const Sums& sums,
                                                    std::span<const double> prices) {
  std::vector<Eigen::MatrixXd> all;
  const double rows = std::max(1.0, sums.rows);
  const Eigen::MatrixXd xx = sums.xx / rows;
  const Eigen::MatrixXd xy = sums.xy / rows;
  Eigen::MatrixXd w = Eigen::MatrixXd::Zero(xy.rows(), xy.cols());
  for (const double price : prices) {
    for (Eigen::Index o = 0; o < w.cols(); ++o) {
      const double size_um = std::sqrt(sums.yy[o] / rows);
      if (!(size_um > 0)) continue;
      Eigen::VectorXd column = w.col(o) / size_um;
      descend(xx, xy.col(o) / size_um, price, column);
      w.col(o) = column * size_um;
    }
    all.push_back(w);
  }
  return all;
}

std::vector<Eigen::MatrixXd> BankEquations::paths(const Sums& sums) {
  std::vector<Eigen::MatrixXd> all = ridge_path(sums, ridge_penalties);
  const std::vector<Eigen::MatrixXd> sparse = l1_path(sums, l1_prices);
  all.insert(all.end(), sparse.begin(), sparse.end());
  return all;
}

Eigen::MatrixXd BankEquations::fit(std::size_t left_out) const {
  return runs_choose_ ? chosen(left_out) : unchosen(left_out);
}

bool BankEquations::lacks_more(std::size_t left_out, std::size_t part) const {
  bool lacks = false;
  bool rest = false;
  for (std::size_t f = 0; f < pieces_.size(); ++f) {
    if (fold_[f] == left_out) continue;
    (part_[f] == part ? lacks : rest) = true;
  }
  return lacks && rest;
}

Eigen::MatrixXd BankEquations::unchosen(std::size_t left_out) const {
  Eigen::MatrixXd gains = Eigen::MatrixXd::Zero(pieces_[0].xy.rows(), pieces_[0].xy.cols());
  for (const Eigen::MatrixXd& each :
       ridge_path(sums_without(left_out, nothing), unchosen_penalties))
    gains += 0.5 / static_cast<double>(unchosen_penalties.size()) * each;
  // Which of columns that go together L1 takes is chance: a mean over records tells less of it.
  Eigen::MatrixXd sparse = Eigen::MatrixXd::Zero(gains.rows(), gains.cols());
  double records = 0.0;
  for (std::size_t part = 0; part < parts_; ++part) {
    if (!lacks_more(left_out, part)) continue;
    for (const Eigen::MatrixXd& each : l1_path(sums_without(left_out, part), unchosen_prices))
      sparse += each;
    records += static_cast<double>(unchosen_prices.size());
  }
  gains += 0.5 / std::max(1.0, records) * sparse;
  return scale_.asDiagonal() * gains;
}

Eigen::MatrixXd BankEquations::chosen(std::size_t left_out) const {
  const Eigen::Index outputs = pieces_[0].xy.cols();
  std::vector<std::vector<double>> left_um2(ridge_penalties.size() + l1_prices.size());
  for (auto& each : left_um2) each.assign(static_cast<std::size_t>(outputs), 0.0);
  for (std::size_t part = 0; part < parts_; ++part) {
    const std::vector<Eigen::MatrixXd> all = paths(sums_without(left_out, part));
    for (std::size_t f = 0; f < pieces_.size(); ++f) {
      if (part_[f] != part || fold_[f] == left_out) continue;
      const Sums& own = pieces_[f];
      for (std::size_t p = 0; p < all.size(); ++p)
        for (Eigen::Index o = 0; o < outputs; ++o) {
          const auto w = all[p].col(o);
          const double error = own.yy[o] - 2.0 * w.dot(own.xy.col(o)) + w.dot(own.xx * w);
          left_um2[p][static_cast<std::size_t>(o)] += std::max(0.0, error);
        }
    }
  }
  const std::vector<Eigen::MatrixXd> all = paths(sums_without(left_out, nothing));
  Eigen::MatrixXd gains = Eigen::MatrixXd::Zero(all[0].rows(), outputs);
  for (Eigen::Index o = 0; o < outputs; ++o) {
    const auto take = [&](std::size_t begin, std::size_t end) {
      std::vector<double> left;
      for (std::size_t p = begin; p < end; ++p)
        left.push_back(left_um2[p][static_cast<std::size_t>(o)]);
      const std::vector<double> shares = weights(left);
      for (std::size_t p = begin; p < end; ++p)
        gains.col(o) += 0.5 * shares[p - begin] * all[p].col(o);
    };
    take(0, ridge_penalties.size());
    take(ridge_penalties.size(), all.size());
  }
  return scale_.asDiagonal() * gains;
}

}  // namespace thermocomp::identification
