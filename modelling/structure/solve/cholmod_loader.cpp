#include "estimator/checks.hpp"
#include "modelling/structure/modules/module_loader.hpp"
#include "modelling/structure/solve/cholmod_module.hpp"

namespace thermocomp::structure {
namespace {

constexpr Module module{"thermocomp-cholmod.so", "factorises matrices",
                        "thermocomp_cholmod_functions", "CHOLMOD (Debian 12: libcholmod3)"};

const CholmodFunctions& cholmod() {
  // One that failed is tried again.
  static const auto& functions = *static_cast<const CholmodFunctions*>(functions_of(module));
  return functions;
}

}  // namespace

Cholesky::Cholesky(const SparseSymmetric& matrix) : size_(matrix.size()) {
  if (size_ > 0) factor_ = cholmod().factorise(matrix);
}

void Cholesky::solve(std::span<double> right_sides) const {
  if (size_ == 0) return;
  THERMOCOMP_ENSURE(right_sides.size() % size_ == 0);
  factor_->solve(right_sides);
}

double Cholesky::reciprocal_condition() const {
  return size_ == 0 ? 1.0 : factor_->reciprocal_condition();
}

double Cholesky::factor_MB() const {
  return size_ == 0 ? 0.0 : factor_->size_MB();
}

}  // namespace thermocomp::structure
