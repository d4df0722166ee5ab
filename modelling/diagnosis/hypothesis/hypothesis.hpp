/// Hypotheses of what is wrong: a cause with a subject, and the displacement that it would explain.
#pragma once

#include <algorithm>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/data/panel.hpp"
#include "modelling/diagnosis/data/stacked_rows.hpp"
#include "modelling/diagnosis/hypothesis/parameter.hpp"

namespace thermocomp::diagnosis {

/// The shape parameters' values, in their order.
using Shape = std::vector<double>;
using Shapes = std::vector<Shape>;

/// How the columns of a hypothesis enter the displacement.
enum class Form {
  own_gains,    ///< each output has gains of its own
  shared_gain,  ///< one gain for all outputs; the column of an output carries its coefficient
  no_gain,      ///< nothing is free but the shape
};

/// One shape parameter of a hypothesis, searched over a grid.
struct ShapeParameter {
  std::string name;
  std::vector<double> grid;  ///< ascending
  bool logarithmic{false};   ///< refined between grid points on a logarithmic scale
  bool discrete{false};      ///< not refined
};

struct Hypothesis {
  std::string cause{};
  std::string subject{};
  Form form{Form::own_gains};
  std::vector<ShapeParameter> shape{};
  std::vector<std::string> gains{};     ///< names of the gains, one a column
  std::optional<std::size_t> output{};  ///< acts on this output alone
  std::optional<std::size_t> run{};     ///< a fault of this run alone
  /// Displacement of an output over the stacked rows, the columns of one shape after those of
  /// another: shape (rows, width() shapes).
  std::function<Panel(const Shapes& shapes, std::size_t output)> columns{};
  /// What is physically possible of a gain; empty: everything is.
  std::function<Interval(std::size_t output)> bounds{};

  /// Cause that explains, at the subject `simpler_subject`, all that this one does where what it
  /// adds is nothing; empty: none.
  std::string simpler_cause{};
  std::string simpler_subject{};

  // Of a fault of one reading:
  std::optional<std::size_t> sensor{};  ///< the input
  /// Its error for a gain of 1 [K] over the stacked rows, one column a shape.
  std::function<Panel(const Shapes& shapes)> errors_K{};
  bool shrinks_reading{false};  ///< the error is in proportion to the reading

  /// Columns for one shape: as many as gains, or one.
  [[nodiscard]] Eigen::Index width() const { return std::max<Eigen::Index>(1, std::ssize(gains)); }
};

/// Parameters that are fitted: of its shape those that are not discrete, and the gains of an
/// output.
[[nodiscard]] std::size_t free_parameters(const Hypothesis& hypothesis);

/// Every point of the grid of its shape; one without values where it has no shape.
[[nodiscard]] Shapes grid_of(const Hypothesis& hypothesis);

/// The first parameter of each shape.
[[nodiscard]] std::vector<double> firsts_of(const Shapes& shapes);

/// Every cause (causes/cause.hpp) with every subject that it can have in these data.
[[nodiscard]] std::vector<Hypothesis> hypotheses(const MeasuredData& data, const StackedRows& rows);

}  // namespace thermocomp::diagnosis
