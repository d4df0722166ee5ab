#include "modelling/diagnosis/panel.hpp"

#include <algorithm>
#include <array>

#ifdef THERMOCOMP_WITH_CBLAS
#include <cblas.h>
#include <dlfcn.h>
#endif

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
  Eigen::Index at = 0;
  for (; at + 16 <= count; at += 16) add_lanes<16>(from + at, rows, stride, apart, sums + at);
  for (; at + 4 <= count; at += 4) add_lanes<4>(from + at, rows, stride, apart, sums + at);
  for (; at < count; ++at) add_lanes<1>(from + at, rows, stride, apart, sums + at);
}

#ifdef THERMOCOMP_WITH_CBLAS
/// These products are so small that threads would wait for each other longer than they work, where
/// others want the processors too many times as long. Found at run time, since which BLAS there is
/// is the system's choice.
void work_alone() {
  using SetNumber = void (*)(int);
  if (void* found = ::dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))
    reinterpret_cast<SetNumber>(found)(1);
}
#endif

}  // namespace

Eigen::MatrixXd cross_products(const Panel& a, const Panel& b, Eigen::Index begin,
                               Eigen::Index end) {
#ifdef THERMOCOMP_WITH_CBLAS
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(a.cols(), b.cols());
  if (products.size() == 0 || begin == end) return products;
  static const bool alone = (work_alone(), true);
  static_cast<void>(alone);
  // Row by row the panels are a' and b'; so b' a by rows is a' b by columns.
  const auto size = [](Eigen::Index count) { return static_cast<int>(count); };
  if (b.cols() == 1)
    cblas_dgemv(CblasColMajor, CblasNoTrans, size(a.cols()), size(end - begin), 1.0,
                a.data() + begin * a.cols(), size(a.cols()), b.data() + begin, 1, 0.0,
                products.data(), 1);
  else
    cblas_dgemm(CblasColMajor, CblasNoTrans, CblasTrans, size(a.cols()), size(b.cols()),
                size(end - begin), 1.0, a.data() + begin * a.cols(), size(a.cols()),
                b.data() + begin * b.cols(), size(b.cols()), 0.0, products.data(), size(a.cols()));
  return products;
#else
  return a.middleRows(begin, end - begin).transpose() * b.middleRows(begin, end - begin);
#endif
}

Eigen::MatrixXd neighbour_products(const Panel& panel, Eigen::Index width, Eigen::Index begin,
                                   Eigen::Index end) {
  Panel products = Panel::Zero(width, panel.cols());
  for (Eigen::Index apart = 0; apart < std::min(width, panel.cols()); ++apart)
    add_products(panel.data() + begin * panel.cols(), end - begin, panel.cols(),
                 panel.cols() - apart, apart, products.row(apart).data());
  return products;
}

}  // namespace thermocomp::diagnosis
