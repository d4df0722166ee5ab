#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include <Eigen/SVD>

#include "config/text/units.hpp"
#include "modelling/structure/structure_model.hpp"

namespace thermocomp::structure {
namespace {

using Rows = std::vector<std::vector<double>>;

/// printf into a string.
template <class... Values>
std::string line(const char* format, Values... values) {
  char text[256];
  // The formats are literals of this file.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
  std::snprintf(text, sizeof text, format, values...);
#pragma GCC diagnostic pop
  return text;
}

std::string row_text(const std::string& title, const std::string& output,
                     const std::vector<double>& row, const ThermalModel& model) {
  const double sum = std::accumulate(row.begin(), row.end(), 0.0);
  double magnitude = 0.0;
  for (const double value : row) magnitude += std::fabs(value);
  const std::string unit(unit_of(output).symbol);
  std::string text = title;
  text.append(line(": %.4g %s/K when all is warmer by the same\n", sum, unit.c_str()));
  for (std::size_t i = 0; i < row.size(); ++i) {
    const double share = magnitude > 0.0 ? 100.0 * std::fabs(row[i]) / magnitude : 0.0;
    text.append("  ").append(model.inputs[i]);
    text.append(line(" %.5g %s/K (%.1f %%)\n", row[i], unit.c_str(), share));
  }
  return text;
}

/// Greatest over least singular value, and how many count.
std::string conditioning(const Rows& rows) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows.size()),
                         static_cast<Eigen::Index>(rows.front().size()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      matrix(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
  }
  const Eigen::VectorXd singular = Eigen::JacobiSVD<Eigen::MatrixXd>(matrix).singularValues();
  std::string text = "singular values of all rows:";
  for (const double value : singular) text.append(line(" %.3g", value));
  return text.append(line("\ncondition number: %.3g\n",
                          singular[0] / std::max(singular[singular.size() - 1], 1e-300)));
}

}  // namespace

std::string structure_report(const Structure& structure, const Statics& statics,
                             const ThermalModel& model) {
  std::string text = line("%zu nodes, %zu elements, %u unknowns; ", structure.mesh.nodes_m.size(),
                          structure.mesh.elements.size(), structure.reduction.free_size());
  text += statics.solver().report();
  std::vector<std::size_t> nodes(structure.block_names.size(), 0);
  for (const Index block : structure.block_of_node) ++nodes[block];
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    text.append("block ").append(structure.block_names[i]).append(line(": %zu nodes\n", nodes[i]));
  }
  Rows all = model.matrix_um_per_K;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    text += row_text(model.outputs[i], model.outputs[i], model.matrix_um_per_K[i], model);
  }
  for (const GuidewaySpec& guideway : model.guideways) {
    for (const auto& [output, rows] : guideway.rows_um_per_K) {
      for (std::size_t i = 0; i < rows.size(); ++i) {
        std::string name = output + " on guideway " + guideway.name;
        name.append(line(" at %g mm", guideway.positions_mm[i]));
        text += row_text(name, output, rows[i], model);
        all.push_back(rows[i]);
      }
    }
  }
  return text + conditioning(all);
}

}  // namespace thermocomp::structure
