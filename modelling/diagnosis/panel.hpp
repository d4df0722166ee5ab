/// Columns side by side, for what is done to many of them at once.
#pragma once

#include <Eigen/Core>

/// Compiled for several instruction sets, of which the processor's best is taken at start. Not
/// under sanitizers: the choice is made before they are ready.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define THERMOCOMP_IN_VERSIONS
#define THERMOCOMP_VECTORISED \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define THERMOCOMP_VECTORISED
#endif

namespace thermocomp::diagnosis {

/// The values of a row lie next to each other.
using Panel = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Rows or columns of one, to be written.
using PanelPart = Eigen::Ref<Panel, 0, Eigen::OuterStride<>>;

/// a' b of the rows [begin, end), shape (a.cols(), b.cols()).
[[nodiscard]] Eigen::MatrixXd cross_products(const Panel& a, const Panel& b, Eigen::Index begin,
                                             Eigen::Index end);
/// Products of each column with itself and those after it over the rows [begin, end), shape
/// (width, panel.cols()): row d holds column' (column + d); 0 where there is none.
[[nodiscard]] Eigen::MatrixXd neighbour_products(const Panel& panel, Eigen::Index width,
                                                 Eigen::Index begin, Eigen::Index end);

}  // namespace thermocomp::diagnosis
