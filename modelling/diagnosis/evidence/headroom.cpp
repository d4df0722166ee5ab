#include "modelling/diagnosis/evidence/headroom.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include "modelling/diagnosis/data/series.hpp"

namespace thermocomp::diagnosis {
namespace {

/// Penalties over the count of rows; columns have spread 1.
constexpr std::array<double, 6> penalties = {1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0};
constexpr std::size_t blocks_min = 3;
/// Time constants of the lag bank.
const std::vector<double> lags_s = {0.0, 900.0, 5400.0};
/// As many rows of the longest recording as are looked at.
constexpr Eigen::Index rows_max = 3000;

struct Products {
  Eigen::MatrixXd square;
  Eigen::VectorXd right;
  double rows{0.0};
};

Products& operator+=(Products& sum, const Products& other) {
  sum.square += other.square;
  sum.right += other.right;
  sum.rows += other.rows;
  return sum;
}

/// Sum over the left-out blocks of squares that every penalty leaves.
struct Left {
  std::array<double, penalties.size()> squares{};
};

/// @param fitted  what the gains come from
/// @param judged  blocks that are predicted
Left left_of(const Products& fitted, const Products& judged, double judged_squares) {
  Left left;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(fitted.square);
  const Eigen::VectorXd turned = parts.eigenvectors().transpose() * fitted.right;
  for (std::size_t i = 0; i < penalties.size(); ++i) {
    const Eigen::VectorXd gains =
        parts.eigenvectors() *
        (turned.array() / (parts.eigenvalues().array() + penalties[i] * fitted.rows)).matrix();
    left.squares[i] =
        judged_squares - 2.0 * gains.dot(judged.right) + gains.dot(judged.square * gains);
  }
  return left;
}

/// What the model leaves, each run's mean taken off; 0 where missing.
Column centred(const StackedRows& rows, const OutputEvidence& evidence) {
  Column values = evidence.measured_residual();
  for (const Block& run : rows.runs) {
    const Eigen::Index count = run.end - run.begin;
    const auto present = evidence.present().segment(run.begin, count);
    const auto of_run = values.segment(run.begin, count).array();
    const double mean =
        present.select(of_run, 0.0).sum() / std::max(1.0, static_cast<double>(present.count()));
    values.segment(run.begin, count) = present.select(of_run - mean, 0.0);
  }
  return values;
}

}  // namespace

Eigen::MatrixXd lag_bank(const MeasuredData& data, const StackedRows& rows) {
  std::vector<Column> columns;
  const auto add = [&](auto values_of, double power) {
    Panel all(rows.time_s.size(), std::ssize(lags_s));
    for (std::size_t i = 0; i < data.runs.size(); ++i) {
      const MeasuredRun& run = data.runs[i];
      const Block& block = rows.runs[i];
      const Column values = Column(values_of(run)).array().pow(power);
      Panel whole(run.rows(), all.cols());
      whole.col(0) = values;
      Panel late(run.rows(), all.cols() - 1);
      lagged(run.time_s, values, {lags_s.begin() + 1, lags_s.end()}, late);
      whole.rightCols(late.cols()) = late;
      auto part = all.middleRows(block.begin, block.end - block.begin);
      part = whole.bottomRows(block.end - block.begin);
      const Eigen::RowVectorXd mean = part.colwise().mean();
      part.rowwise() -= mean;
    }
    for (Eigen::Index i = 0; i < all.cols(); ++i) {
      const double spread =
          all.col(i).norm() / std::sqrt(static_cast<double>(std::max<Eigen::Index>(1, all.rows())));
      if (spread > 1e-9) columns.emplace_back(all.col(i) / spread);
    }
  };
  for (std::size_t i = 0; i < data.model.inputs.size(); ++i)
    add([i](const MeasuredRun& run) -> const Column& { return run.inputs_K[i]; }, 1.0);
  for (std::size_t i = 0; i < data.others.size(); ++i)
    add([i](const MeasuredRun& run) -> const Column& { return run.others_K[i]; }, 1.0);
  for (std::size_t i = 0; i < data.signals.size(); ++i)
    for (const double power : {1.0, 2.0})
      add([i](const MeasuredRun& run) -> const Column& { return run.signals[i]; }, power);
  Eigen::MatrixXd bank(rows.time_s.size(), std::ssize(columns));
  for (std::size_t i = 0; i < columns.size(); ++i)
    bank.col(static_cast<Eigen::Index>(i)) = columns[i];
  return bank;
}

double predictable_share(const StackedRows& rows, const OutputEvidence& evidence,
                         const Eigen::MatrixXd& bank) {
  const Column remainder = centred(rows, evidence);
  const Eigen::Index apart = 1 + (remainder.size() - 1) / rows_max;
  std::vector<Products> of_block;
  std::vector<double> squares;
  for (const Block& block : rows.blocks) {
    std::vector<Eigen::Index> present;
    for (Eigen::Index row = block.begin; row < block.end; row += apart)
      if (evidence.present()[row]) present.push_back(row);
    const Eigen::MatrixXd columns = bank(present, Eigen::all);
    const Eigen::VectorXd values = remainder(present);
    of_block.push_back({columns.transpose() * columns, columns.transpose() * values,
                        static_cast<double>(present.size())});
    squares.push_back(values.squaredNorm());
  }
  if (of_block.size() < blocks_min || bank.cols() == 0) return 0.0;
  Products all{Eigen::MatrixXd::Zero(bank.cols(), bank.cols()), Eigen::VectorXd::Zero(bank.cols()),
               0.0};
  for (const Products& block : of_block) all += block;
  double before = 0.0;
  double after = 0.0;
  std::vector<Left> left;
  for (std::size_t i = 0; i < of_block.size(); ++i) {
    const Products others{all.square - of_block[i].square, all.right - of_block[i].right,
                          all.rows - of_block[i].rows};
    left.push_back(left_of(others, of_block[i], squares[i]));
  }
  for (std::size_t i = 0; i < of_block.size(); ++i) {
    // The penalty that the other blocks, left out in turn, are predicted best with.
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < penalties.size(); ++k) {
      double sum = 0.0;
      for (std::size_t j = 0; j < of_block.size(); ++j)
        if (j != i) sum += left[j].squares[k];
      if (!(sum < least)) continue;
      least = sum;
      best = k;
    }
    before += squares[i];
    after += left[i].squares[best];
  }
  return before > 0 ? std::clamp(1.0 - after / before, 0.0, 1.0) : 0.0;
}

Headroom headroom(double noise_share, double carried, double predictable) {
  Headroom of;
  of.noise = std::clamp(noise_share, 0.0, 1.0);
  of.named = std::clamp(carried, 0.0, 1.0) * (1.0 - of.noise);
  of.predictable = std::clamp(predictable - of.named, 0.0, 1.0 - of.noise - of.named);
  of.not_recorded = std::max(0.0, 1.0 - of.noise - of.named - of.predictable);
  return of;
}

}  // namespace thermocomp::diagnosis
