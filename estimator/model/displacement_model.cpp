#include "estimator/model/displacement_model.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include <Eigen/Core>

#include "estimator/checks.hpp"
#include "estimator/model/terms/term.hpp"
#include "estimator/name_index.hpp"

namespace thermocomp {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

Matrix matrix_from(const std::vector<std::vector<double>>& rows, std::size_t count,
                   std::size_t columns, const char* key) {
  require(rows.size() == count, key, static_cast<double>(rows.size()),
          "has the wrong number of rows");
  Matrix matrix(count, columns);
  for (std::size_t i = 0; i < count; ++i) {
    require(rows[i].size() == columns, key, static_cast<double>(rows[i].size()),
            "has a row of the wrong length");
    for (std::size_t j = 0; j < columns; ++j) {
      require(std::isfinite(rows[i][j]), key, rows[i][j], "must be finite");
      matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = rows[i][j];
    }
  }
  return matrix;
}

/// Rows of one guideway, one per position and output.
struct Guideway {
  std::size_t signal{0};
  std::vector<double> positions_mm;
  std::vector<std::size_t> outputs;
  std::vector<Matrix> rows_um_per_K;  ///< one per output, shape (positions, inputs)

  /// Index of the position below `position_mm`, and the share of the one above.
  [[nodiscard]] std::pair<Eigen::Index, double> place(double position_mm) const noexcept {
    const auto above = std::upper_bound(positions_mm.begin(), positions_mm.end(), position_mm);
    if (above == positions_mm.begin()) return {0, 0.0};
    if (above == positions_mm.end())
      return {static_cast<Eigen::Index>(positions_mm.size()) - 2, 1.0};
    const auto lower = above - 1;
    return {lower - positions_mm.begin(), (position_mm - *lower) / (*above - *lower)};
  }
};

Guideway guideway_from(const GuidewaySpec& spec, const ThermalModel& model,
                       const ModelColumns& columns) {
  Guideway guideway;
  guideway.signal = index_of(columns.signals, spec.axis, "guideway.axis", "is not a signal");
  guideway.positions_mm = spec.positions_mm;
  require(spec.positions_mm.size() >= 2, "guideway.positions_mm",
          static_cast<double>(spec.positions_mm.size()), "needs at least two positions");
  for (std::size_t i = 1; i < spec.positions_mm.size(); ++i)
    require(spec.positions_mm[i] > spec.positions_mm[i - 1], "guideway.positions_mm",
            spec.positions_mm[i], "must increase");
  for (const auto& [output, rows] : spec.rows_um_per_K) {
    guideway.outputs.push_back(
        index_of(model.outputs, output, "guideway.rows_um_per_K", "is not an output of the model"));
    guideway.rows_um_per_K.push_back(
        matrix_from(rows, spec.positions_mm.size(), model.inputs.size(), "guideway.rows_um_per_K"));
  }
  return guideway;
}

/// Orders by all that a term's state depends on. Gains are not part of the state, so a term with
/// new gains keeps it.
struct ByState {
  bool operator()(const TermSpec* a, const TermSpec* b) const {
    const auto key = [](const TermSpec& term) {
      return std::tie(term.kind, term.subject, term.shared, term.bank.subjects, term.bank.powers,
                      term.bank.taus_s);
    };
    return key(*a) < key(*b);
  }
};

}  // namespace

struct DisplacementModel::Equation {
  std::size_t columns{0};
  std::size_t signals{0};
  std::size_t outputs{0};
  Eigen::Index inputs{0};
  Matrix matrix_um_per_K;
  std::vector<Guideway> guideways;
  std::vector<TermSpec> term_specs;
  std::vector<std::unique_ptr<Term>> terms;
  Vector rise_K;                  ///< shape (columns); scratch
  std::vector<std::byte> states;  ///< of all terms; scratch

  void add_guideways(std::span<const double> signal_values, std::span<double> out) const noexcept {
    const auto rise = rise_K.head(inputs);
    for (const Guideway& guideway : guideways) {
      const auto [lower, share] = guideway.place(signal_values[guideway.signal]);
      for (std::size_t i = 0; i < guideway.outputs.size(); ++i) {
        const Matrix& rows = guideway.rows_um_per_K[i];
        out[guideway.outputs[i]] +=
            (1.0 - share) * rows.row(lower).dot(rise) + share * rows.row(lower + 1).dot(rise);
      }
    }
  }

  void add_guideway_slopes(std::size_t output, std::span<const double> signal_values,
                           std::span<double> slope_um_per_K) const noexcept {
    for (const Guideway& guideway : guideways) {
      const auto [lower, share] = guideway.place(signal_values[guideway.signal]);
      for (std::size_t i = 0; i < guideway.outputs.size(); ++i) {
        if (guideway.outputs[i] != output) continue;
        const Matrix& rows = guideway.rows_um_per_K[i];
        for (Eigen::Index j = 0; j < inputs; ++j)
          slope_um_per_K[static_cast<std::size_t>(j)] +=
              (1.0 - share) * rows(lower, j) + share * rows(lower + 1, j);
      }
    }
  }
};

DisplacementModel::DisplacementModel(const ThermalModel& model)
    : equation_(std::make_unique<Equation>()) {
  const ModelColumns columns(model);
  equation_->columns = columns.temperatures.size();
  equation_->signals = columns.signals.size();
  equation_->outputs = model.outputs.size();
  equation_->inputs = static_cast<Eigen::Index>(model.inputs.size());
  equation_->matrix_um_per_K = matrix_from(model.matrix_um_per_K, model.outputs.size(),
                                           model.inputs.size(), "matrix_um_per_K");
  for (const GuidewaySpec& spec : model.guideways)
    equation_->guideways.push_back(guideway_from(spec, model, columns));
  equation_->term_specs = model.terms;
  for (const TermSpec& spec : model.terms)
    equation_->terms.push_back(make_term(spec, model, columns));
  equation_->rise_K = Vector::Zero(static_cast<Eigen::Index>(equation_->columns));
  StateArchive counting;
  visit_state(counting);
  equation_->states.resize(counting.position_bytes());
}

DisplacementModel::~DisplacementModel() = default;
DisplacementModel::DisplacementModel(DisplacementModel&&) noexcept = default;
DisplacementModel& DisplacementModel::operator=(DisplacementModel&&) noexcept = default;

void DisplacementModel::restart() noexcept {
  for (auto& term : equation_->terms) term->restart();
}

void DisplacementModel::step(nanoseconds now, std::span<const double> temps_degC,
                             std::span<const double> reference_degC,
                             std::span<const double> signals,
                             std::span<double> displacement_um) noexcept {
  Equation& equation = *equation_;
  THERMOCOMP_ENSURE(temps_degC.size() == equation.columns &&
                    reference_degC.size() == equation.columns);
  THERMOCOMP_ENSURE(signals.size() == equation.signals &&
                    displacement_um.size() == equation.outputs);
  for (std::size_t i = 0; i < equation.columns; ++i)
    equation.rise_K[static_cast<Eigen::Index>(i)] = temps_degC[i] - reference_degC[i];
  const std::span<double> rise_K(equation.rise_K.data(), equation.columns);
  for (auto& term : equation.terms) term->correct_rise(now, rise_K);
  Eigen::Map<Vector> out(displacement_um.data(), static_cast<Eigen::Index>(equation.outputs));
  out.noalias() = equation.matrix_um_per_K * equation.rise_K.head(equation.inputs);
  equation.add_guideways(signals, displacement_um);
  const TermInput input{now, rise_K, signals, reference_degC};
  for (auto& term : equation.terms) term->add(input, displacement_um);
  for (auto& term : equation.terms) term->correct_displacement(displacement_um);
}

void DisplacementModel::slope(std::size_t output, std::span<const double> rise_K,
                              std::span<const double> signals,
                              std::span<double> slope_um_per_K) const noexcept {
  const Equation& equation = *equation_;
  THERMOCOMP_ENSURE(output < equation.outputs && signals.size() == equation.signals);
  THERMOCOMP_ENSURE(rise_K.size() == equation.columns && slope_um_per_K.size() == equation.columns);
  std::fill(slope_um_per_K.begin(), slope_um_per_K.end(), 0.0);
  for (Eigen::Index j = 0; j < equation.inputs; ++j)
    slope_um_per_K[static_cast<std::size_t>(j)] =
        equation.matrix_um_per_K(static_cast<Eigen::Index>(output), j);
  equation.add_guideway_slopes(output, signals, slope_um_per_K);
  const TermInput input{{}, rise_K, signals};
  for (const auto& term : equation.terms) term->add_slope(input, output, slope_um_per_K);
  for (const auto& term : equation.terms) term->add_slope_on_the_way(output, slope_um_per_K);
  for (const auto& term : equation.terms) term->correct_slope(slope_um_per_K);
}

void DisplacementModel::visit_state(StateArchive& archive) {
  for (auto& term : equation_->terms) term->visit_state(archive);
}

void DisplacementModel::copy_states(const DisplacementModel& same) noexcept {
  StateArchive save{std::span<std::byte>(equation_->states)};
  for (auto& term : same.equation_->terms) term->visit_state(save);
  StateArchive load{std::span<const std::byte>(equation_->states)};
  visit_state(load);
}

std::vector<int> DisplacementModel::plan_terms(const DisplacementModel& other) const {
  const std::vector<TermSpec>& theirs = other.equation_->term_specs;
  std::map<const TermSpec*, int, ByState> known;  // the first of duplicates
  for (std::size_t i = 0; i < theirs.size(); ++i)
    known.try_emplace(&theirs[i], static_cast<int>(i));
  std::vector<int> plan;
  for (const TermSpec& ours : equation_->term_specs) {
    const auto same = known.find(&ours);
    plan.push_back(same == known.end() ? -1 : same->second);
  }
  return plan;
}

void DisplacementModel::adopt_terms(const DisplacementModel& other,
                                    std::span<const int> plan) noexcept {
  std::vector<std::byte>& state = equation_->states;  // as large as ours for each planned term
  for (std::size_t i = 0; i < plan.size(); ++i) {
    if (plan[i] < 0) continue;
    StateArchive save{std::span<std::byte>(state)};
    other.equation_->terms[static_cast<std::size_t>(plan[i])]->visit_state(save);
    StateArchive load{std::span<const std::byte>(state.data(), save.position_bytes())};
    equation_->terms[i]->visit_state(load);
  }
}

}  // namespace thermocomp
