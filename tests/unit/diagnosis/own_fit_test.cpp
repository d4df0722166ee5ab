// Whether a model's coefficients come from the rows that it is diagnosed with.
#include "modelling/diagnosis/evidence/own_fit.hpp"

#include <cmath>
#include <random>
#include <string>

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

constexpr Eigen::Index inputs = 5;
constexpr Eigen::Index rows_a_run = 150;
constexpr Eigen::Index runs = 2;

/// Rises that walk about, and a displacement that they make but for a slow cause of its own.
struct Rows {
  Eigen::MatrixXd rises_K{rows_a_run * runs, inputs};
  Eigen::VectorXd displacement_um{rows_a_run * runs};

  explicit Rows(unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    for (Eigen::Index row = 0; row < rises_K.rows(); ++row) {
      const Eigen::Index of_run = row % rows_a_run;
      for (Eigen::Index input = 0; input < inputs; ++input)
        rises_K(row, input) =
            of_run == 0 ? 0.0 : rises_K(row - 1, input) + 0.02 + 0.1 * noise(random);
      displacement_um[row] = 3.0 * rises_K(row, 0) - 2.0 * rises_K(row, 3) +
                             2.0 * std::sin(0.03 * static_cast<double>(of_run)) + noise(random);
      if (of_run == 0) displacement_um[row] = 0.0;
    }
  }
};

struct Way {
  bool offsets;
  bool standardised;
};

Eigen::MatrixXd centred(Eigen::MatrixXd columns) {
  for (Eigen::Index run = 0; run < runs; ++run) {
    auto of_run = columns.middleRows(run * rows_a_run, rows_a_run);
    of_run.rowwise() -= of_run.colwise().mean().eval();
  }
  return columns;
}

Eigen::VectorXd scale_of(const Rows& rows, const Way& way) {
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(inputs);
  for (Eigen::Index input = 0; way.standardised && input < inputs; ++input) {
    const Eigen::VectorXd column = rows.rises_K.col(input);
    scale[input] = std::sqrt(column.squaredNorm() / static_cast<double>(column.size()) -
                             column.mean() * column.mean());
  }
  return scale;
}

Eigen::VectorXd fitted(const Rows& rows, const Way& way, double ridge) {
  const Eigen::VectorXd scale = scale_of(rows, way);
  Eigen::MatrixXd rises = rows.rises_K * scale.cwiseInverse().asDiagonal();
  Eigen::MatrixXd displacement = rows.displacement_um;
  if (way.offsets) rises = centred(rises);
  if (way.offsets) displacement = centred(displacement);
  Eigen::MatrixXd square = rises.transpose() * rises;
  square.diagonal().array() += ridge * static_cast<double>(rises.rows());
  return square.ldlt().solve(rises.transpose() * displacement).cwiseQuotient(scale);
}

/// The least share of the residual's squares by which a fit of these rows differs from the model.
double least_difference(const Rows& rows, const Eigen::VectorXd& coefficients) {
  double least = 1e9;
  for (const Way way : {Way{false, false}, {false, true}, {true, false}, {true, true}})
    for (double ridge = 1e-10; ridge < 3.0; ridge *= 1.1) {
      Eigen::MatrixXd apart = rows.rises_K * (fitted(rows, way, ridge) - coefficients);
      Eigen::MatrixXd left = rows.displacement_um - rows.rises_K * coefficients;
      if (way.offsets) apart = centred(apart);
      if (way.offsets) left = centred(left);
      least = std::min(least, apart.squaredNorm() / left.squaredNorm());
    }
  return least;
}

bool is_recognised(const Rows& rows, const Eigen::VectorXd& coefficients) {
  MeasuredData data;
  data.model.outputs = {"z_um"};
  data.model.matrix_um_per_K.emplace_back(coefficients.begin(), coefficients.end());
  for (Eigen::Index input = 0; input < inputs; ++input)
    data.model.inputs.push_back(std::string("t").append(std::to_string(input)).append("_degC"));
  for (Eigen::Index run = 0; run < runs; ++run) {
    MeasuredRun& of = data.runs.emplace_back();
    const Eigen::Index begin = run * rows_a_run;
    of.time_s = Column::LinSpaced(rows_a_run, 0.0, 60.0 * (rows_a_run - 1));
    for (Eigen::Index input = 0; input < inputs; ++input)
      of.inputs_K.emplace_back(rows.rises_K.col(input).segment(begin, rows_a_run));
    of.measured_um = {rows.displacement_um.segment(begin, rows_a_run)};
    of.model_um = {(rows.rises_K * coefficients).segment(begin, rows_a_run)};
  }
  return OwnFit::recognised(data, stacked_rows(data)).has_value();
}

}  // namespace

TEST_CASE("a model that was fitted to the rows is recognised, whatever the way and the ridge",
          "[diagnosis]") {
  const Rows rows(GENERATE(range(0U, 4U)));
  for (const Way way : {Way{false, false}, {false, true}, {true, false}, {true, true}})
    for (const double ridge : {0.0, 1e-6, 1e-3, 0.1, 1.0}) {
      CAPTURE(way.offsets, way.standardised, ridge);
      CHECK(is_recognised(rows, fitted(rows, way, ridge)));
    }
}

TEST_CASE("a model is recognised when, and only when, some fit of the rows is near to it",
          "[diagnosis][property]") {
  const unsigned seed = GENERATE(range(0U, 12U));
  const Rows rows(seed);
  std::mt19937_64 random(100 + seed);
  std::normal_distribution<double> noise;
  int recognised = 0;
  int refused = 0;
  const Eigen::VectorXd own = fitted(rows, {seed % 2 == 0, seed % 3 == 0}, 0.01);
  for (double change = 0.001; change < 4.0; change *= 1.5) {
    Eigen::VectorXd coefficients = own;
    for (double& each : coefficients) each += change * noise(random);
    const double difference = least_difference(rows, coefficients);
    if (difference > 0.019 && difference < 0.021) continue;
    CAPTURE(change, difference);
    CHECK(is_recognised(rows, coefficients) == (difference < 0.02));
    ++(difference < 0.02 ? recognised : refused);
  }
  CHECK(recognised > 3);
  CHECK(refused > 3);
}
