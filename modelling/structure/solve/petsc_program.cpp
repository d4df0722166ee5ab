// thermocomp-petsc FOLDER: solves the system in thermocomp-modelling's file under mpirun, by
// conjugate gradients with smoothed aggregation and rigid body modes. Every rank maps the file and
// takes its rows. Exit status 0: all right sides converged.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <numeric>
#include <petscksp.h>
#include <span>
#include <string>
#include <unistd.h>
#include <vector>

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "modelling/structure/solve/petsc_file.hpp"

namespace {

using thermocomp::structure::SystemHeader;

/// The smoother is Jacobi under Chebyshev, since SOR breaks down on these matrices.
constexpr const char* options =
    "-ksp_type cg -ksp_rtol 1e-8 -ksp_max_it 2000 -ksp_norm_type unpreconditioned -pc_type gamg "
    "-pc_gamg_threshold 0.02 -mg_levels_ksp_type chebyshev -mg_levels_pc_type jacobi "
    "-mg_levels_ksp_max_it 3";

class MappedFile {
 public:
  explicit MappedFile(const std::string& path) {
    const int file = ::open(path.c_str(), O_RDONLY);
    struct stat about {};
    if (file < 0 || ::fstat(file, &about) != 0 || about.st_size == 0) return;
    bytes_ = static_cast<std::size_t>(about.st_size);
    data_ = ::mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, file, 0);
    ::close(file);
    if (data_ == MAP_FAILED) data_ = nullptr;
  }
  ~MappedFile() {
    if (data_ != nullptr) ::munmap(data_, bytes_);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  [[nodiscard]] bool is_there() const { return data_ != nullptr; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// The next `count` values.
  template <class T>
  std::span<const T> take(std::size_t count) {
    const auto* begin = static_cast<const char*>(data_) + at_;
    at_ += count * sizeof(T);
    return {reinterpret_cast<const T*>(begin), count};
  }

 private:
  void* data_{nullptr};
  std::size_t bytes_{0};
  std::size_t at_{0};
};

struct System {
  SystemHeader header;
  std::span<const std::uint64_t> column_start;
  std::span<const std::uint32_t> row;
  std::span<const double> value;
  std::span<const std::uint32_t> place;
  std::span<const double> coordinates_m;
};

System system_in(MappedFile& file) {
  System system;
  system.header = file.take<SystemHeader>(1)[0];
  system.column_start = file.take<std::uint64_t>(system.header.size + 1);
  system.row = file.take<std::uint32_t>(system.header.entries);
  system.value = file.take<double>(system.header.entries);
  system.place = file.take<std::uint32_t>(system.header.size);
  system.coordinates_m = file.take<double>(3 * system.header.nodes);
  return system;
}

/// Rows of this rank over all nodes' components, so that blocks of three stay complete; held or
/// tied unknowns have a row with only a diagonal.
struct LocalRows {
  PetscInt first{0};
  PetscInt end{0};
  std::vector<PetscInt> start;
  std::vector<PetscInt> column;
  std::vector<double> value;

  [[nodiscard]] bool has(PetscInt row) const { return row >= first && row < end; }
};

/// Calls action(row, column, value) for this rank's entries, columns increasing in a row.
template <class Action>
void each_entry(const System& system, const LocalRows& rows, const Action& action) {
  for (std::size_t free = 0; free < system.header.size; ++free) {
    const auto column = static_cast<PetscInt>(system.place[free]);
    for (std::uint64_t k = system.column_start[free]; k < system.column_start[free + 1]; ++k) {
      const auto row = static_cast<PetscInt>(system.place[system.row[k]]);
      if (rows.has(row)) action(row, column, system.value[k]);
      if (row != column && rows.has(column)) action(column, row, system.value[k]);
    }
  }
}

LocalRows rows_of_rank(const System& system, int rank, int ranks) {
  const auto nodes = static_cast<PetscInt>(system.header.nodes);
  LocalRows rows;
  rows.first = 3 * (nodes / ranks * rank + std::min(rank, nodes % ranks));
  rows.end = rows.first + 3 * (nodes / ranks + (rank < nodes % ranks ? 1 : 0));
  rows.start.assign(static_cast<std::size_t>(rows.end - rows.first) + 1, 0);
  each_entry(system, rows, [&](PetscInt row, PetscInt, double) {
    ++rows.start[static_cast<std::size_t>(row - rows.first) + 1];
  });
  std::vector<bool> alone(rows.start.size() - 1, false);
  for (std::size_t i = 0; i < alone.size(); ++i) {
    alone[i] = rows.start[i + 1] == 0;
    if (alone[i]) rows.start[i + 1] = 1;
  }
  std::partial_sum(rows.start.begin(), rows.start.end(), rows.start.begin());
  rows.column.resize(static_cast<std::size_t>(rows.start.back()));
  rows.value.resize(rows.column.size());
  double greatest = 1.0;
  std::vector<PetscInt> next(rows.start.begin(), rows.start.end() - 1);
  each_entry(system, rows, [&](PetscInt row, PetscInt column, double value) {
    const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(row - rows.first)]++);
    rows.column[at] = column;
    rows.value[at] = value;
    greatest = std::max(greatest, value);
  });
  for (std::size_t i = 0; i < alone.size(); ++i) {
    if (!alone[i]) continue;
    const auto at = static_cast<std::size_t>(rows.start[i]);
    rows.column[at] = rows.first + static_cast<PetscInt>(i);
    rows.value[at] = greatest;
  }
  return rows;
}

PetscErrorCode make_matrix(const System& system, const LocalRows& rows, Mat& matrix) {
  PetscFunctionBeginUser;
  PetscCall(MatCreate(PETSC_COMM_WORLD, &matrix));
  const PetscInt local = rows.end - rows.first;
  PetscCall(MatSetSizes(matrix, local, local, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(matrix, MATAIJ));
  PetscCall(MatSetBlockSize(matrix, 3));
  PetscCall(MatSeqAIJSetPreallocationCSR(matrix, rows.start.data(), rows.column.data(),
                                         rows.value.data()));
  PetscCall(MatMPIAIJSetPreallocationCSR(matrix, rows.start.data(), rows.column.data(),
                                         rows.value.data()));
  PetscCall(MatSetOption(matrix, MAT_SPD, PETSC_TRUE));
  Vec coordinates = nullptr;
  PetscCall(VecCreateMPI(PETSC_COMM_WORLD, local, PETSC_DETERMINE, &coordinates));
  PetscCall(VecSetBlockSize(coordinates, 3));
  PetscScalar* values = nullptr;
  PetscCall(VecGetArray(coordinates, &values));
  for (PetscInt i = 0; i < local; ++i) {
    const auto row = static_cast<std::size_t>(rows.first) + static_cast<std::size_t>(i);
    values[i] = system.coordinates_m[row];
  }
  PetscCall(VecRestoreArray(coordinates, &values));
  MatNullSpace motions = nullptr;
  PetscCall(MatNullSpaceCreateRigidBody(coordinates, &motions));
  PetscCall(MatSetNearNullSpace(matrix, motions));
  PetscCall(MatNullSpaceDestroy(&motions));
  PetscCall(VecDestroy(&coordinates));
  PetscFunctionReturn(0);
}

/// Unknowns of this rank: places begin..end of the full numbering.
struct LocalUnknowns {
  std::size_t begin{0};
  std::size_t end{0};
};
LocalUnknowns unknowns_of(const System& system, const LocalRows& rows) {
  const auto at = [&](PetscInt place) {
    return static_cast<std::size_t>(std::lower_bound(system.place.begin(), system.place.end(),
                                                     static_cast<std::uint32_t>(place)) -
                                    system.place.begin());
  };
  return {at(rows.first), at(rows.end)};
}

/// Solves one right side and writes the solution over it in the file `out`.
PetscErrorCode solve_one(KSP solver, const System& system, const LocalRows& rows,
                         std::span<const double> right_side, std::size_t index, int out,
                         bool& good) {
  PetscFunctionBeginUser;
  Mat matrix = nullptr;
  PetscCall(KSPGetOperators(solver, &matrix, nullptr));
  Vec b = nullptr;
  Vec x = nullptr;
  PetscCall(MatCreateVecs(matrix, &x, &b));
  const LocalUnknowns own = unknowns_of(system, rows);
  PetscScalar* values = nullptr;
  PetscCall(VecGetArray(b, &values));
  for (std::size_t i = own.begin; i < own.end; ++i) {
    values[static_cast<PetscInt>(system.place[i]) - rows.first] = right_side[i];
  }
  PetscCall(VecRestoreArray(b, &values));
  PetscCall(KSPSolve(solver, b, x));
  KSPConvergedReason reason{};
  PetscInt iterations = 0;
  PetscCall(KSPGetConvergedReason(solver, &reason));
  PetscCall(KSPGetIterationNumber(solver, &iterations));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "right side %zu: %d iterations, %s\n", index + 1,
                        static_cast<int>(iterations), KSPConvergedReasons[reason]));
  good = good && reason > 0;
  const PetscScalar* found = nullptr;
  PetscCall(VecGetArrayRead(x, &found));
  std::vector<double> own_values;
  for (std::size_t i = own.begin; i < own.end; ++i) {
    own_values.push_back(found[static_cast<PetscInt>(system.place[i]) - rows.first]);
  }
  PetscCall(VecRestoreArrayRead(x, &found));
  const auto bytes = own_values.size() * sizeof(double);
  const auto where = (index * system.header.size + own.begin) * sizeof(double);
  good = good && ::pwrite(out, own_values.data(), bytes, static_cast<off_t>(where)) ==
                     static_cast<ssize_t>(bytes);
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&b));
  PetscFunctionReturn(0);
}

PetscErrorCode solve_all(const std::string& folder, bool& good) {
  PetscFunctionBeginUser;
  int rank = 0;
  int ranks = 1;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  MappedFile file(folder + "/system");
  MappedFile sides(folder + "/right_sides");
  PetscCheck(file.is_there() && sides.is_there(), PETSC_COMM_WORLD, PETSC_ERR_FILE_OPEN,
             "no system in %s", folder.c_str());
  const System system = system_in(file);
  PetscCheck(system.header.magic == SystemHeader::expected_magic, PETSC_COMM_WORLD,
             PETSC_ERR_FILE_UNEXPECTED, "not a system of thermocomp");
  LocalRows rows = rows_of_rank(system, rank, ranks);
  Mat matrix = nullptr;
  PetscCall(make_matrix(system, rows, matrix));
  rows.column = {};
  rows.value = {};
  KSP solver = nullptr;
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &solver));
  PetscCall(KSPSetOperators(solver, matrix, matrix));
  PetscCall(KSPSetFromOptions(solver));
  const int out = ::open((folder + "/solutions").c_str(), O_WRONLY | O_CREAT, 0600);
  good = out >= 0;
  const std::size_t count = sides.bytes() / sizeof(double) / system.header.size;
  for (std::size_t i = 0; i < count; ++i) {
    const auto side = sides.take<double>(system.header.size);
    PetscCall(solve_one(solver, system, rows, side, i, out, good));
  }
  if (out >= 0) ::close(out);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  double peak_MB = static_cast<double>(usage.ru_maxrss) / 1024.0;
  MPI_Allreduce(MPI_IN_PLACE, &peak_MB, 1, MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "memory of all ranks %.0f MB\n", peak_MB));
  PetscCall(KSPDestroy(&solver));
  PetscCall(MatDestroy(&matrix));
  PetscFunctionReturn(0);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: mpirun -n RANKS thermocomp-petsc FOLDER\n");
    return 2;
  }
  if (PetscInitialize(&argc, &argv, nullptr, nullptr) != 0) return 2;
  bool good = false;
  // PETSC_OPTIONS from the environment come later and take precedence.
  const char* more = std::getenv("PETSC_OPTIONS");
  const bool failed = PetscOptionsInsertString(nullptr, options) != 0 ||
                      (more != nullptr && PetscOptionsInsertString(nullptr, more) != 0) ||
                      solve_all(argv[1], good) != 0;
  PetscFinalize();
  return failed || !good ? 1 : 0;
}
