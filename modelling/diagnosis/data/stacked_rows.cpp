#include "modelling/diagnosis/data/stacked_rows.hpp"

#include <algorithm>
#include <cmath>

namespace thermocomp::diagnosis {
namespace {

constexpr std::size_t blocks_wanted = 8;

}  // namespace

StackedRows stacked_rows(const MeasuredData& data) {
  StackedRows rows;
  Eigen::Index total = 0;
  for (const MeasuredRun& run : data.runs) total += run.rows() - run.begin;
  rows.time_s.resize(total);
  Eigen::Index at = 0;
  const double block_rows =
      std::max(block_rows_min, static_cast<double>(total) / static_cast<double>(blocks_wanted));
  for (const MeasuredRun& run : data.runs) {
    const Eigen::Index count = run.rows() - run.begin;
    rows.time_s.segment(at, count) = run.time_s.tail(count);
    rows.runs.push_back({at, at + count});
    const auto parts = std::max<Eigen::Index>(
        1, static_cast<Eigen::Index>(std::lround(static_cast<double>(count) / block_rows)));
    for (Eigen::Index part = 0; part < parts; ++part)
      rows.blocks.push_back({at + count * part / parts, at + count * (part + 1) / parts});
    at += count;
  }
  return rows;
}

}  // namespace thermocomp::diagnosis
