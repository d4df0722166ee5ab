#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <sstream>
#include <unistd.h>
#include <vector>

#include <sys/wait.h>
#include <system_error>

#include "estimator/checks.hpp"
#include "modelling/structure/solve/linear_solver.hpp"
#include "modelling/structure/solve/petsc_file.hpp"

namespace thermocomp::structure {
namespace {

namespace fs = std::filesystem;

constexpr const char* program_name = "thermocomp-petsc";

/// Searches beside this program, then in PATH.
fs::path find_program(const std::string& name) {
  std::error_code error;
  std::vector<fs::path> folders{fs::read_symlink("/proc/self/exe", error).parent_path()};
  const char* path = std::getenv("PATH");
  std::istringstream list(path != nullptr ? path : "");
  for (std::string folder; std::getline(list, folder, ':');) folders.emplace_back(folder);
  for (const fs::path& folder : folders) {
    if (!folder.empty() && ::access((folder / name).c_str(), X_OK) == 0) return folder / name;
  }
  throw FactorisationError("the solver petsc needs the program " + name +
                           ", which is not installed");
}

template <class T>
void put(std::ofstream& file, const T* values, std::size_t count) {
  file.write(reinterpret_cast<const char*>(values),
             static_cast<std::streamsize>(count * sizeof(T)));
}

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Runs a program to its end. @return its exit status; -1 if ended by a signal
int run(const std::vector<std::string>& words, const fs::path& log) {
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = ::fork();
  if (child < 0) throw FactorisationError("cannot start a program: no process left");
  if (child == 0) {
    // Open MPI refuses to run as root without both variables.
    ::setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 0);
    ::setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 0);
    ::setenv("OMP_NUM_THREADS", "1", 0);
    ::setenv("OPENBLAS_NUM_THREADS", "1", 0);
    ::setenv("OMPI_MCA_mpi_yield_when_idle", "1", 0);  // leaves the processors to other programs
    const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (out < 0 || ::dup2(out, 1) < 0 || ::dup2(out, 2) < 0) ::_exit(127);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

PetscSolver::PetscSolver(const SparseSymmetric& matrix, const Mesh& mesh,
                         const Reduction& reduction, int ranks)
    : program_(find_program(program_name)), ranks_(ranks), size_(matrix.size()) {
  static_cast<void>(find_program("mpirun"));
  std::string pattern = (fs::temp_directory_path() / "thermocomp_petsc_XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) {
    throw FactorisationError("cannot make a folder below " + fs::temp_directory_path().string());
  }
  folder_ = pattern;
  std::ofstream file(folder_ / "system", std::ios::binary);
  const SystemHeader header{SystemHeader::expected_magic, matrix.size(), matrix.row.size(),
                            mesh.nodes_m.size()};
  put(file, &header, 1);
  const std::vector<std::uint64_t> starts(matrix.column_start.begin(), matrix.column_start.end());
  put(file, starts.data(), starts.size());
  put(file, matrix.row.data(), matrix.row.size());
  put(file, matrix.value.data(), matrix.value.size());
  const std::vector<Index> places = reduction.places_of_free();
  put(file, places.data(), places.size());
  put(file, mesh.nodes_m.data(), mesh.nodes_m.size());
  file.close();
  if (!file) {
    fs::remove_all(folder_);
    throw FactorisationError("cannot write the system below " + folder_.parent_path().string() +
                             "; TMPDIR names another place");
  }
}

PetscSolver::~PetscSolver() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

void PetscSolver::solve(std::span<double> right_sides) const {
  if (size_ == 0) return;
  THERMOCOMP_ENSURE(right_sides.size() % size_ == 0);
  {
    std::ofstream file(folder_ / "right_sides", std::ios::binary);
    put(file, right_sides.data(), right_sides.size());
    file.close();
    if (!file) throw FactorisationError("cannot write right sides to " + folder_.string());
  }
  const fs::path log = folder_ / "log";
  const int status = run({find_program("mpirun").string(), "--oversubscribe", "-n",
                          std::to_string(ranks_), program_.string(), folder_.string()},
                         log);
  output_ = text_of(log);
  if (status != 0) {
    throw FactorisationError("thermocomp-petsc failed (status " + std::to_string(status) +
                             "): " + output_.substr(0, 2000));
  }
  std::ifstream file(folder_ / "solutions", std::ios::binary);
  file.read(reinterpret_cast<char*>(right_sides.data()),
            static_cast<std::streamsize>(right_sides.size_bytes()));
  if (!file) throw FactorisationError("thermocomp-petsc gave no solution: " + output_);
}

std::string PetscSolver::report() const {
  return "solved by PETSc on " + std::to_string(ranks_) + " MPI ranks\n" + output_;
}

}  // namespace thermocomp::structure
