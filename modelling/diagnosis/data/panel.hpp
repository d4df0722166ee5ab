/// Columns side by side, for what is done to many of them at once.
#pragma once

#include <cstddef>
#include <type_traits>

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

using Column = Eigen::VectorXd;

/// The values of a row lie next to each other.
using Panel = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Rows or columns of one, to be written.
using PanelPart = Eigen::Ref<Panel, 0, Eigen::OuterStride<>>;

/// Calls `with(lanes, at)` for all columns: for the `lanes` ones from `at` on, a constant that is a
/// power of two. A recursion over rows waits for its own last result, however many columns run in
/// it side by side.
/// @tparam most  columns at once: what keeps much of each has no room for more in registers
template <std::size_t most = 32, class With>
[[gnu::always_inline]] inline void side_by_side(Eigen::Index columns, With with) {
  Eigen::Index at = 0;
  const auto as_many_as = [&](auto lanes) __attribute__((always_inline)) {
    constexpr auto count = static_cast<Eigen::Index>(lanes());
    for (; at + count <= columns; at += count) with(lanes, at);
  };
  if constexpr (most >= 32) as_many_as(std::integral_constant<std::size_t, 32>{});
  as_many_as(std::integral_constant<std::size_t, 16>{});
  as_many_as(std::integral_constant<std::size_t, 8>{});
  as_many_as(std::integral_constant<std::size_t, 4>{});
  as_many_as(std::integral_constant<std::size_t, 2>{});
  as_many_as(std::integral_constant<std::size_t, 1>{});
}

/// a' b of the rows [begin, end), shape (a.cols(), b.cols()).
[[nodiscard]] Eigen::MatrixXd cross_products(const Panel& a, const Panel& b, Eigen::Index begin,
                                             Eigen::Index end);
/// Products of each column with itself and those after it over the rows [begin, end), shape
/// (width, panel.cols()): row d holds column' (column + d); 0 where there is none.
[[nodiscard]] Eigen::MatrixXd neighbour_products(const Panel& panel, Eigen::Index width,
                                                 Eigen::Index begin, Eigen::Index end);

}  // namespace thermocomp::diagnosis
