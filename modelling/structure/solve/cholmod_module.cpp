// thermocomp-cholmod.so: Cholesky factors by CHOLMOD. Uses only headers of the loading program.
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <malloc.h>
#include <string>
#include <suitesparse/cholmod.h>
#include <unistd.h>

#include "modelling/structure/elements/sparse.hpp"

namespace thermocomp::structure {
namespace {

/// CHOLMOD uses four threads and OpenBLAS one per processor. On a busy computer their mutual
/// waiting takes several times as long as the work. So OpenMP adapts its threads, and OpenBLAS uses
/// one if the load exceeds the processors. Both are looked up at run time, since the system chooses
/// CHOLMOD's libraries.
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

/// A factor's blocks of tens of MB are used again by the next one. As the C library does it, each
/// would be mapped and cleared anew: half of the time of small models.
void keep_freed_memory() {
  ::mallopt(M_MMAP_THRESHOLD, 1 << 30);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
}

[[noreturn]] void refuse(int status) {
  if (status == CHOLMOD_OUT_OF_MEMORY || status == CHOLMOD_TOO_LARGE) {
    throw FactorisationError(
        "the model is too large to be factorised on this computer; use a coarser mesh");
  }
  if (status == CHOLMOD_NOT_POSDEF) {
    throw FactorisationError("the matrix is singular: a part is not held, or too weakly");
  }
  throw FactorisationError("CHOLMOD failed with status " + std::to_string(status));
}

class CholmodFactor : public CholeskyFactor {
 public:
  explicit CholmodFactor(Index size) : size_(size) {
    static const bool prepared = (leave_processors_to_others(), keep_freed_memory(), true);
    static_cast<void>(prepared);
    cholmod_start(&common_);
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_METIS;
    common_.postorder = 1;
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.print = 0;
    common_.quick_return_if_not_posdef = 1;
  }
  ~CholmodFactor() override {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  CholmodFactor(const CholmodFactor&) = delete;
  CholmodFactor& operator=(const CholmodFactor&) = delete;

  void factorise(const SparseSymmetric& matrix) {
    // CHOLMOD only reads the arrays; int and Index have the same representation below 2^31.
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
    factor_ = cholmod_analyze(&view, &common_);
    if (factor_ == nullptr) refuse(common_.status);
    cholmod_factorize(&view, factor_, &common_);
    if (common_.status != CHOLMOD_OK) refuse(common_.status);
  }

  void solve(std::span<double> right_sides) override {
    cholmod_dense given{};
    given.nrow = given.d = size_;
    given.ncol = right_sides.size() / size_;
    given.nzmax = right_sides.size();
    given.x = right_sides.data();
    given.xtype = CHOLMOD_REAL;
    given.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* solution = cholmod_solve(CHOLMOD_A, factor_, &given, &common_);
    if (solution == nullptr) refuse(common_.status);
    std::memcpy(right_sides.data(), solution->x, right_sides.size() * sizeof(double));
    cholmod_free_dense(&solution, &common_);
  }

  double reciprocal_condition() override { return cholmod_rcond(factor_, &common_); }

  [[nodiscard]] double size_MB() const override {
    return static_cast<double>(factor_->xsize) * sizeof(double) / 1e6;
  }

 private:
  cholmod_common common_{};
  cholmod_factor* factor_{nullptr};
  Index size_;
};

std::unique_ptr<CholeskyFactor> factorise(const SparseSymmetric& matrix) {
  auto factor = std::make_unique<CholmodFactor>(matrix.size());
  factor->factorise(matrix);
  return factor;
}

}  // namespace
}  // namespace thermocomp::structure

const thermocomp::structure::CholmodFunctions thermocomp_cholmod_functions{
    &thermocomp::structure::factorise};
