/// What thermocomp-cholmod.so offers to the program that loads it. Only that module is linked with
/// CHOLMOD: it brings a BLAS and eight further libraries, which take more of the time of a start
/// than all else, and few commands have a matrix to factorise.
/// Program and module come from one build; what is thrown on one side is caught on the other.
#pragma once

#include <memory>

#include "modelling/structure/elements/sparse.hpp"

namespace thermocomp::structure {

struct CholmodFunctions {
  /// @pre the matrix has a row
  /// @throws FactorisationError as the constructor of Cholesky
  std::unique_ptr<CholeskyFactor> (*factorise)(const SparseSymmetric& matrix);
};

}  // namespace thermocomp::structure

/// The one name that is looked up.
extern "C" const thermocomp::structure::CholmodFunctions thermocomp_cholmod_functions;
