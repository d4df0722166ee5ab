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

/// What a hypothesis pays that contains a simpler one as a special case.
inline constexpr double special_case_handicap = 20.0;

struct ReadingShare {
  std::size_t input{0};
  double weight{0.0};
};

/// A cause with its subject, by name.
struct Named {
  std::string cause;
  std::string subject;
};

struct Hypothesis {
  std::string cause{};
  std::string subject{};
  Form form{Form::own_gains};
  std::vector<ShapeParameter> shape{};
  std::vector<std::string> gains{};     ///< names of the gains, one a column
  std::optional<std::size_t> output{};  ///< acts on this output alone
  std::optional<std::size_t> run{};     ///< a fault of this run alone
  std::optional<std::size_t> sensor{};  ///< a fault of the reading of this input
  /// 2 ln L that it must gain beyond others: for what contains a simpler cause as a special case.
  double handicap{0.0};
  /// The simpler one, which explains all that this one does where what it adds is nothing.
  std::optional<Named> special_case{};
  /// Least share of the RMS with which it is clear by itself, where likelihood shall not make it
  /// so; 0: as others.
  double clear_share{0.0};
  bool in_every_output{false};  ///< an output without its share speaks against it
  /// Writes the columns for an output over the stacked rows, those of one shape after those of
  /// another.
  std::function<void(const Shapes& shapes, std::size_t output, PanelPart into)> write_columns{};
  Eigen::Index rows{0};  ///< of all columns
  /// How the same columns come from others that many hypotheses share; both may be empty.
  /// Of the model's calm readings: how much of which for an output.
  std::function<std::vector<ReadingShare>(std::size_t output)> of_readings{};
  /// Of a column of the output: it counts from the shape's one time on in `run`, before it is zero.
  /// Hypotheses of one cause and run have the same times.
  std::function<Column(std::size_t output)> from_onset{};
  /// Hypotheses of one pattern have the same form, price and grid and the same columns, each times
  /// its scale for the output; empty: it shares its columns with none.
  std::string pattern{};
  std::function<double(std::size_t output)> scale{};
  /// Whether a gain is physically possible; empty: all are.
  std::function<bool(double gain, std::size_t output)> possible{};

  /// Columns for one shape: as many as gains, or one.
  [[nodiscard]] Eigen::Index width() const { return std::max<Eigen::Index>(1, std::ssize(gains)); }
  /// What write_columns writes, shape (rows, shapes times width).
  [[nodiscard]] Panel columns(const Shapes& shapes, std::size_t of_output) const {
    Panel all(rows, width() * std::ssize(shapes));
    write_columns(shapes, of_output, all);
    return all;
  }
};

/// Every point of the grid of its shape; one without values where it has no shape.
[[nodiscard]] Shapes grid_of(const Hypothesis& hypothesis);
/// One of them.
[[nodiscard]] Shape point_of_grid(const Hypothesis& hypothesis, std::size_t index);

/// The first parameter of each shape.
[[nodiscard]] std::vector<double> firsts_of(const Shapes& shapes);

/// Columns that are made for one shape at a time.
/// @param make  Eigen::MatrixXd(const Shape&, std::size_t output)
template <class Make>
[[nodiscard]] std::function<void(const Shapes&, std::size_t, PanelPart)> one_by_one(Make make) {
  return [make](const Shapes& shapes, std::size_t output, PanelPart into) {
    const Eigen::Index width = into.cols() / std::ssize(shapes);
    for (std::size_t i = 0; i < shapes.size(); ++i)
      into.middleCols(width * static_cast<Eigen::Index>(i), width) = make(shapes[i], output);
  };
}

/// Every cause (causes/cause.hpp) with every subject that it can have in these data.
[[nodiscard]] std::vector<Hypothesis> hypotheses(const MeasuredData& data, const StackedRows& rows);

}  // namespace thermocomp::diagnosis
