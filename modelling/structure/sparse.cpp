#include "modelling/structure/sparse.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <limits>
#include <suitesparse/cholmod.h>
#include <unistd.h>

#include "estimator/checks.hpp"

namespace thermocomp::structure {

SparseSymmetric SparseSymmetric::with_pattern(
    Index size, const std::function<void(Index, std::vector<Index>&)>& neighbours) {
  SparseSymmetric matrix;
  matrix.column_start.assign(1, 0);
  matrix.column_start.reserve(std::size_t{size} + 1);
  std::vector<Index> rows;
  for (Index column = 0; column < size; ++column) {
    rows.assign(1, column);
    neighbours(column, rows);
    std::sort(rows.begin(), rows.end());
    const auto last = std::unique(rows.begin(), rows.end());
    const auto first = std::lower_bound(rows.begin(), last, column);
    matrix.row.insert(matrix.row.end(), first, last);
    if (matrix.row.size() > std::size_t{std::numeric_limits<int>::max()}) {
      throw FactorisationError("the model is too large: more than 2^31 entries in its matrix");
    }
    matrix.column_start.push_back(static_cast<Index>(matrix.row.size()));
  }
  matrix.value.assign(matrix.row.size(), 0.0);
  return matrix;
}

void SparseSymmetric::add(Index row_index, Index column, double amount) {
  const auto first = row.begin() + column_start[column];
  const auto last = row.begin() + column_start[column + 1];
  const auto place = std::lower_bound(first, last, row_index);
  THERMOCOMP_ENSURE(place != last && *place == row_index);
  value[static_cast<std::size_t>(place - row.begin())] += amount;
}

void SparseSymmetric::multiply(std::span<const double> x, std::span<double> y) const {
  std::fill(y.begin(), y.end(), 0.0);
  for (Index column = 0; column < size(); ++column) {
    double sum = value[column_start[column]] * x[column];  // the diagonal comes first
    for (Index k = column_start[column] + 1; k < column_start[column + 1]; ++k) {
      sum += value[k] * x[row[k]];
      y[row[k]] += value[k] * x[column];
    }
    y[column] += sum;
  }
}

SparseSymmetric combination(double a, const SparseSymmetric& A, double b,
                            const SparseSymmetric& B) {
  THERMOCOMP_ENSURE(A.row == B.row);
  SparseSymmetric sum = A;
  for (std::size_t i = 0; i < sum.value.size(); ++i) {
    sum.value[i] = a * A.value[i] + b * B.value[i];
  }
  return sum;
}

namespace {

/// CHOLMOD asks for four threads and OpenBLAS for one a processor, whatever else runs. Where others
/// want the processors too, these threads' waiting for each other takes several times as long as
/// the work. Both are asked to take what is free; found at run time, since the libraries behind
/// CHOLMOD are the system's choice.
void leave_processors_to_others() {
  using SetNumber = void (*)(int);
  const auto set = [](const char* name, int number) {
    if (void* found = ::dlsym(RTLD_DEFAULT, name)) reinterpret_cast<SetNumber>(found)(number);
  };
  set("omp_set_dynamic", 1);
  double load = 0.0;
  const auto processors = static_cast<double>(::sysconf(_SC_NPROCESSORS_ONLN));
  if (::getloadavg(&load, 1) == 1 && load > processors) set("openblas_set_num_threads", 1);
}

}  // namespace

struct Cholesky::Parts {
  cholmod_common common{};
  cholmod_factor* factor{nullptr};
  Index size{0};

  Parts() {
    static const bool left = (leave_processors_to_others(), true);
    static_cast<void>(left);
    cholmod_start(&common);
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_METIS;
    common.postorder = 1;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.print = 0;
    common.quick_return_if_not_posdef = 1;
  }
  ~Parts() {
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;
};

namespace {

[[noreturn]] void refuse(int status) {
  if (status == CHOLMOD_OUT_OF_MEMORY || status == CHOLMOD_TOO_LARGE) {
    throw FactorisationError(
        "the model is too large to be factorised on this computer; use a coarser mesh");
  }
  if (status == CHOLMOD_NOT_POSDEF) {
    throw FactorisationError("the matrix is singular: something is not held, or hardly");
  }
  throw FactorisationError("CHOLMOD failed with status " + std::to_string(status));
}

}  // namespace

Cholesky::Cholesky(const SparseSymmetric& matrix) : parts_(std::make_unique<Parts>()) {
  parts_->size = matrix.size();
  if (matrix.size() == 0) return;
  cholmod_common* common = &parts_->common;
  // CHOLMOD reads the arrays only; int and Index have the same representation below 2^31.
  cholmod_sparse view{};
  view.nrow = view.ncol = matrix.size();
  view.nzmax = matrix.row.size();
  view.p = const_cast<Index*>(matrix.column_start.data());
  view.i = const_cast<Index*>(matrix.row.data());
  view.x = const_cast<double*>(matrix.value.data());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = view.packed = 1;
  parts_->factor = cholmod_analyze(&view, common);
  if (parts_->factor == nullptr) refuse(common->status);
  cholmod_factorize(&view, parts_->factor, common);
  if (common->status != CHOLMOD_OK) refuse(common->status);
}

Cholesky::~Cholesky() = default;
Cholesky::Cholesky(Cholesky&&) noexcept = default;
Cholesky& Cholesky::operator=(Cholesky&&) noexcept = default;

void Cholesky::solve(std::span<double> right_sides) const {
  const Index size = parts_->size;
  if (size == 0) return;
  THERMOCOMP_ENSURE(right_sides.size() % size == 0);
  cholmod_dense given{};
  given.nrow = given.d = size;
  given.ncol = right_sides.size() / size;
  given.nzmax = right_sides.size();
  given.x = right_sides.data();
  given.xtype = CHOLMOD_REAL;
  given.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* solution = cholmod_solve(CHOLMOD_A, parts_->factor, &given, &parts_->common);
  if (solution == nullptr) refuse(parts_->common.status);
  std::memcpy(right_sides.data(), solution->x, right_sides.size() * sizeof(double));
  cholmod_free_dense(&solution, &parts_->common);
}

double Cholesky::reciprocal_condition() const {
  if (parts_->size == 0) return 1.0;
  return cholmod_rcond(parts_->factor, &parts_->common);
}

double Cholesky::factor_MB() const {
  if (parts_->size == 0) return 0.0;
  return static_cast<double>(parts_->factor->xsize) * sizeof(double) / 1e6;
}

}  // namespace thermocomp::structure
