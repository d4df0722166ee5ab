#include "modelling/diagnosis/data/panel.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <type_traits>
#include <utility>

namespace thermocomp::diagnosis {
namespace {

template <std::size_t lanes>
[[gnu::always_inline]] inline void add_lanes(const double* from, Eigen::Index rows,
                                             Eigen::Index stride, Eigen::Index apart,
                                             double* sums) {
  std::array<double, lanes> sum{};
  const double* beyond = from + apart;
  for (Eigen::Index row = 0; row < rows; ++row, from += stride, beyond += stride)
    for (std::size_t lane = 0; lane < lanes; ++lane) sum[lane] += from[lane] * beyond[lane];
  for (std::size_t lane = 0; lane < lanes; ++lane) sums[lane] = sum[lane];
}

/// Products of the first `count` columns with those `apart` columns further.
THERMOCOMP_VECTORISED void add_products(const double* from, Eigen::Index rows, Eigen::Index stride,
                                        Eigen::Index count, Eigen::Index apart, double* sums) {
  side_by_side(
      count, [&](auto lanes, Eigen::Index at) __attribute__((always_inline)) {
        add_lanes<lanes()>(from + at, rows, stride, apart, sums + at);
      });
}

/// Rows of which what is read more than once stays in the processor's nearest memory.
constexpr Eigen::Index rows_near = 64;

/// Neighbouring columns that are reckoned as one.
template <std::size_t lanes>
using Lanes [[gnu::vector_size(lanes * sizeof(double))]] = double;

/// A part of a panel's columns.
struct Strip {
  const double* first{nullptr};
  Eigen::Index stride{0};  ///< from row to row
};

/// Calls `with` for each number below `count`, a constant each: what it indexes stays in registers.
template <std::size_t count, class With>
[[gnu::always_inline]] inline void for_each_below(With with) {
  [&]<std::size_t... i>(std::index_sequence<i...>) __attribute__((always_inline)) {
    (with(std::integral_constant<std::size_t, i>{}), ...);
  }
  (std::make_index_sequence<count>{});
}

/// Adds the products of `height` columns of a and `parts` times `lanes` columns of b.
template <std::size_t height, std::size_t parts, std::size_t lanes>
[[gnu::always_inline]] inline void multiply_part(Strip a, Strip b, Eigen::Index rows,
                                                 double* products, Eigen::Index stride) {
  using Some = Lanes<lanes>;
  // Few sums would each wait for its last addition: then some rows have sums of their own.
  constexpr std::size_t chains = height * parts < 4 ? 4 : 1;
  constexpr auto at_once = static_cast<Eigen::Index>(chains);
  Some sums[chains * height * parts] = {};
  const auto add = [&](Eigen::Index row, auto chain) __attribute__((always_inline)) {
    Some of_b[parts];
    const double* const from_a = a.first + row * a.stride;
    const double* const from_b = b.first + row * b.stride;
    for_each_below<parts>([&](auto part) __attribute__((always_inline)) {
      std::memcpy(&of_b[part], from_b + part * lanes, sizeof(Some));
    });
    for_each_below<height * parts>([&](auto i) __attribute__((always_inline)) {
      sums[chain * height * parts + i] += from_a[i / parts] * of_b[i % parts];
    });
  };
  Eigen::Index row = 0;
  for (; row + at_once <= rows; row += at_once)
    for_each_below<chains>([&](auto chain) __attribute__((always_inline)) {
      add(row + static_cast<Eigen::Index>(chain()), chain);
    });
  for (; row < rows; ++row) add(row, std::integral_constant<std::size_t, 0>{});
  for_each_below<height * parts>([&](auto i) __attribute__((always_inline)) {
    double* const to = products + static_cast<Eigen::Index>(i / parts) * stride +
                       static_cast<Eigen::Index>(i % parts * lanes);
    Some sum;
    std::memcpy(&sum, to, sizeof(Some));
    for_each_below<chains>([&](auto chain) __attribute__((always_inline)) {
      sum += sums[chain * height * parts + i];
    });
    std::memcpy(to, &sum, sizeof(Some));
  });
}

/// The same for any number of columns of b.
template <std::size_t height, std::size_t parts, std::size_t lanes>
[[gnu::always_inline]] inline void multiply_strip(Strip a, Strip b, Eigen::Index columns,
                                                  Eigen::Index rows, double* products) {
  constexpr auto one = static_cast<Eigen::Index>(lanes);
  constexpr auto wide = static_cast<Eigen::Index>(lanes * parts);
  Eigen::Index at = 0;
  const auto of_b = [&] { return Strip{b.first + at, b.stride}; };
  for (; at + wide <= columns; at += wide)
    multiply_part<height, parts, lanes>(a, of_b(), rows, products + at, columns);
  for (; at + one <= columns; at += one)
    multiply_part<height, 1, lanes>(a, of_b(), rows, products + at, columns);
  if constexpr (lanes > 4)
    for (; at + 4 <= columns; at += 4)
      multiply_part<height, 1, 4>(a, of_b(), rows, products + at, columns);
  if constexpr (lanes > 2)
    for (; at + 2 <= columns; at += 2)
      multiply_part<height, 1, 2>(a, of_b(), rows, products + at, columns);
  for (; at < columns; ++at) multiply_part<height, 1, 1>(a, of_b(), rows, products + at, columns);
}

/// a' b, row by row, by a processor that reckons with so many lanes as one and has room for
/// 6 times `parts` sums of them.
template <std::size_t lanes, std::size_t parts>
[[gnu::always_inline]] inline void multiply_in_lanes(Strip a, Eigen::Index columns_of_a, Strip b,
                                                     Eigen::Index columns_of_b, Eigen::Index rows,
                                                     double* products) {
  for (Eigen::Index done = 0; done < rows; done += rows_near) {
    const Eigen::Index now = std::min(rows_near, rows - done);
    const Strip of_b{b.first + done * b.stride, b.stride};
    Eigen::Index at = 0;
    const auto of_a = [&] { return Strip{a.first + done * a.stride + at, a.stride}; };
    const auto to = [&] { return products + at * columns_of_b; };
    for (; at + 6 <= columns_of_a; at += 6)
      multiply_strip<6, parts, lanes>(of_a(), of_b, columns_of_b, now, to());
    for (; at + 3 <= columns_of_a; at += 3)
      multiply_strip<3, 2 * parts, lanes>(of_a(), of_b, columns_of_b, now, to());
    for (; at + 2 <= columns_of_a; at += 2)
      multiply_strip<2, 3 * parts, lanes>(of_a(), of_b, columns_of_b, now, to());
    for (; at < columns_of_a; ++at)
      multiply_strip<1, 4 * parts, lanes>(of_a(), of_b, columns_of_b, now, to());
  }
}

#ifdef THERMOCOMP_IN_VERSIONS
#define THERMOCOMP_VERSION(instructions, lanes, parts)                                      \
  [[gnu::target(instructions)]] void multiply(Strip a, Eigen::Index columns_of_a, Strip b,  \
                                              Eigen::Index columns_of_b, Eigen::Index rows, \
                                              double* products) {                           \
    multiply_in_lanes<lanes, parts>(a, columns_of_a, b, columns_of_b, rows, products);      \
  }
THERMOCOMP_VERSION("default", 2, 2)
THERMOCOMP_VERSION("arch=x86-64-v3", 4, 2)
THERMOCOMP_VERSION("arch=x86-64-v4", 8, 2)
#else
void multiply(Strip a, Eigen::Index columns_of_a, Strip b, Eigen::Index columns_of_b,
              Eigen::Index rows, double* products) {
  multiply_in_lanes<2, 2>(a, columns_of_a, b, columns_of_b, rows, products);
}
#endif

}  // namespace

// Rows are narrow and many: put together from a few columns at a time, in place, the products take
// a third of the time of a BLAS, which copies both panels first.
Eigen::MatrixXd cross_products(const Panel& a, const Panel& b, Eigen::Index begin,
                               Eigen::Index end) {
  if (b.cols() < a.cols()) return cross_products(b, a, begin, end).transpose();
  Panel products = Panel::Zero(a.cols(), b.cols());
  multiply({a.data() + begin * a.cols(), a.cols()}, a.cols(),
           {b.data() + begin * b.cols(), b.cols()}, b.cols(), end - begin, products.data());
  return products;
}

Eigen::MatrixXd neighbour_products(const Panel& panel, Eigen::Index width, Eigen::Index begin,
                                   Eigen::Index end) {
  Panel products = Panel::Zero(width, panel.cols());
  if (width == panel.cols() && width > 1) {
    const Eigen::MatrixXd all = cross_products(panel, panel, begin, end);
    for (Eigen::Index apart = 0; apart < width; ++apart)
      products.row(apart).head(width - apart) = all.diagonal(apart);
    return products;
  }
  for (Eigen::Index apart = 0; apart < std::min(width, panel.cols()); ++apart)
    add_products(panel.data() + begin * panel.cols(), end - begin, panel.cols(),
                 panel.cols() - apart, apart, products.row(apart).data());
  return products;
}

}  // namespace thermocomp::diagnosis
