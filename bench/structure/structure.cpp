// The block matrix of a hollow column (eight blocks, nine rows) as computed by `thermocomp
// structure`, compared with solving block by block and with CalculiX on the same mesh.
//
//   bench_structure ELEMENT X_MM Y_MM Z_MM [calculix] [direct] [petsc1] [petsc2] [petsc_alone]
//
// ELEMENT tet4 or tet10, the lengths an element's largest edges. petsc1, petsc2: also by PETSc, on
// one and two ranks; petsc_alone: without the factorisation. Prints lines NAME VALUE UNIT. Exit
// status 0: agreed (or nothing was compared), 1: did not, 77: a program for comparison is missing.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <sys/resource.h>

#include "config/text/printable_text.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::structure;

constexpr double agreement_max = 5e-7;  ///< relative to the largest entry; CalculiX prints 7 digits
constexpr double adjoint_max = 1e-9;
constexpr int exit_disagrees = 1;
constexpr int exit_nothing_to_compare = 77;
constexpr double petsc_max = 1e-6;
constexpr std::array<Vec3, 3> points_mm{{{300, 0, 300}, {300, 0, 900}, {300, 0, 1500}}};

using Rows = std::vector<std::vector<double>>;

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double peak_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Processor time of this process, or of its children waited for.
double processor_s(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds_of = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
}

std::string column_text(const std::string& element, const std::array<std::string, 3>& size_mm) {
  std::string text = R"(format = 1
[[material]]
name = "cast_iron"
youngs_modulus_GPa = 110.0
poisson_ratio = 0.25
expansion_um_per_m_K = 11.0
[[support]]
on = { z_mm = [0, 0] }
[[division]]
part = "column"
y_mm = [125, 250, 375]
z_mm = [900]
names = ["b1_degC", "b2_degC", "b3_degC", "b4_degC", "b5_degC", "b6_degC", "b7_degC", "b8_degC"]
[[part]]
name = "column"
material = "cast_iron"
)";
  text.append("element = \"").append(element).append("\"\nsize_mm = [");
  text.append(size_mm[0]).append(", ").append(size_mm[1]).append(", ").append(size_mm[2]);
  text.append(R"(]
[[part.box]]
from_mm = [0, 0, 0]
to_mm = [600, 500, 1800]
[[part.box]]                             # these add nothing but planes through the points
from_mm = [0, 0, 0]
to_mm = [300, 500, 300]
[[part.box]]
from_mm = [0, 0, 900]
to_mm = [300, 500, 1500]
[[part.box]]
from_mm = [40, 40, 0]
to_mm = [560, 460, 1760]
cut = true
)");
  for (std::size_t p = 0; p < points_mm.size(); ++p) {
    for (const char* axis : {"x", "y", "z"}) {
      text.append("[[output]]\nname = \"").append(axis).append(std::to_string(p)).append("_um\"\n");
      text.append("direction = \"")
          .append(axis)
          .append("\"\ntool = { part = \"column\", at_mm = [");
      text.append(number_text(points_mm[p][0])).append(", ");
      text.append(number_text(points_mm[p][1])).append(", ");
      text.append(number_text(points_mm[p][2])).append("] }\n");
    }
  }
  return text;
}

/// One block 1 K warm. Quadratic elements: temperatures of the corners, and their mean at the
/// middle of edges, so that CalculiX's four points integrate the load exactly too.
Rows block_fields(const Structure& structure) {
  const Mesh& mesh = structure.mesh;
  Rows fields(structure.block_names.size(), std::vector<double>(mesh.nodes_m.size(), 0.0));
  for (std::size_t node = 0; node < mesh.nodes_m.size(); ++node) {
    fields[structure.block_of_node[node]][node] = 1.0;
  }
  for (const Element& element : mesh.elements) {
    const ShapeInfo& info = shape_info(element.shape);
    const auto nodes = mesh.nodes_of(element);
    for (std::size_t e = 0; info.nodes > info.corners && e < info.edges.size(); ++e) {
      for (auto& field : fields) {
        field[nodes[info.corners + e]] =
            0.5 * (field[nodes[info.edges[e][0]]] + field[nodes[info.edges[e][1]]]);
      }
    }
  }
  return fields;
}

/// Entries in um/K, shape (rows)(blocks).
Rows by_adjoint(const Rows& sensitivities, const Rows& fields) {
  Rows matrix;
  for (const auto& row : sensitivities) {
    auto& entries = matrix.emplace_back();
    for (const auto& field : fields) {
      double sum = 0.0;
      for (std::size_t node = 0; node < field.size(); ++node) sum += 1e6 * row[node] * field[node];
      entries.push_back(sum);
    }
  }
  return matrix;
}

Rows by_direct(const Structure& structure, const Statics& statics, const Rows& fields) {
  Rows matrix(structure.rows.size());
  for (const auto& field : fields) {
    const auto displacement_m = statics.displacement_m(field);
    for (std::size_t row = 0; row < matrix.size(); ++row) {
      matrix[row].push_back(1e6 * structure.rows[row].of(displacement_m));
    }
  }
  return matrix;
}

/// Largest difference relative to the largest entry.
double disagreement(const Rows& a, const Rows& b) {
  double most = 0.0;
  double apart = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < a[i].size(); ++j) {
      most = std::max(most, std::fabs(a[i][j]));
      // Written so that NaN counts as a difference.
      if (!(std::fabs(a[i][j] - b[i][j]) <= apart)) apart = std::fabs(a[i][j] - b[i][j]);
    }
  }
  return apart / most;
}

// -------------------------------------------------------------------- CalculiX

/// CalculiX reads 20 characters per field.
std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12e", value);
  return text;
}

Index node_at(const Mesh& mesh, const Vec3& place_m) {
  for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
    if (length(mesh.nodes_m[node] - place_m) < 1e-6) return node;
  }
  std::fprintf(stderr,
               "bench_structure: no node at a point of the outputs; choose other lengths\n");
  std::exit(2);
}

void write_deck(const std::filesystem::path& path, const Structure& structure, const Rows& fields) {
  const Mesh& mesh = structure.mesh;
  std::ofstream deck(path);
  deck << "*NODE, NSET=ALL\n";
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    deck << i + 1;
    for (const double x : mesh.nodes_m[i]) deck << ", " << short_number(x);
    deck << "\n";
  }
  const bool quadratic = mesh.elements.front().shape == Shape::tet10;
  deck << "*ELEMENT, TYPE=" << (quadratic ? "C3D10" : "C3D4") << ", ELSET=BODY\n";
  for (std::size_t i = 0; i < mesh.elements.size(); ++i) {
    deck << i + 1;
    for (const Index node : mesh.nodes_of(mesh.elements[i])) deck << ", " << node + 1;
    deck << "\n";
  }
  deck << "*MATERIAL, NAME=IRON\n*ELASTIC\n110e9, 0.25\n*EXPANSION, ZERO=0\n1.1e-5\n"
          "*SOLID SECTION, ELSET=BODY, MATERIAL=IRON\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\n"
          "ALL, 0\n*BOUNDARY\n";
  for (Index node = 0; node < mesh.nodes_m.size(); ++node) {
    if (structure.reduction.is_held(node, 0)) deck << node + 1 << ", 1, 3\n";
  }
  deck << "*NSET, NSET=POINTS\n";
  for (const Vec3& point : points_mm) deck << node_at(mesh, 1e-3 * point) + 1 << "\n";
  for (const auto& field : fields) {
    deck << "*STEP\n*STATIC\n*TEMPERATURE\n";
    for (std::size_t node = 0; node < field.size(); ++node) {
      deck << node + 1 << ", " << short_number(field[node]) << "\n";
    }
    deck << "*NODE PRINT, NSET=POINTS\nU\n*END STEP\n";
  }
}

/// The displacements of the points step by step, as rows and blocks [um].
Rows read_results(const std::filesystem::path& path, const Structure& structure) {
  Rows matrix(structure.rows.size());
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    unsigned node = 0;
    Vec3 u_m{};
    if (std::sscanf(line.c_str(), "%u %lf %lf %lf", &node, &u_m[0], &u_m[1], &u_m[2]) != 4) {
      continue;
    }
    for (std::size_t p = 0; p < points_mm.size(); ++p) {
      if (node_at(structure.mesh, 1e-3 * points_mm[p]) + 1 != node) continue;
      for (std::size_t c = 0; c < 3; ++c) matrix[3 * p + c].push_back(1e6 * u_m[c]);
    }
  }
  for (auto& row : matrix) row.resize(structure.block_names.size(), NAN);
  return matrix;
}

/// Runs CalculiX in its own folder. @return its entries, and its time in `took_s`
Rows by_calculix(const Structure& structure, const Rows& fields, double& took_s) {
  std::string pattern =
      (std::filesystem::temp_directory_path() / "thermocomp_calculix_XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) std::exit(2);
  const std::filesystem::path folder(pattern);
  write_deck(folder / "column.inp", structure, fields);
  const double began_s = seconds();
  const std::string command =
      std::string("cd ").append(pattern).append(" && ccx column > ccx.log 2>&1");
  const int status = std::system(command.c_str());
  took_s = seconds() - began_s;
  if (status != 0) std::fprintf(stderr, "bench_structure: ccx ended with status %d\n", status);
  Rows matrix = read_results(folder / "column.dat", structure);
  std::filesystem::remove_all(folder);
  return matrix;
}

bool has(const std::vector<std::string>& words, const char* word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

/// The sensitivities, with the time from the structure file's text to the model.
struct Solved {
  Structure structure;
  std::unique_ptr<Statics> statics;
  Rows sensitivities;
  double took_s{0.0};
  double processor_s{0.0};
};

std::unique_ptr<Solved> solve(const StructureSpec& spec, const SolverChoice& choice) {
  const double began_s = seconds();
  const double processor_began_s = processor_s(RUSAGE_SELF);
  // The solver refers to the structure, which must not move any more.
  auto solved = std::unique_ptr<Solved>(
      new Solved{build_structure(spec, [](std::string_view) {}), nullptr, {}});
  const Structure& structure = solved->structure;
  solved->statics = std::make_unique<Statics>(structure.mesh, structure.material_of_part,
                                              structure.reduction, structure.springs, choice);
  solved->sensitivities = solved->statics->sensitivities(structure.rows);
  static_cast<void>(block_model(spec, structure, solved->sensitivities));
  solved->took_s = seconds() - began_s;
  solved->processor_s = processor_s(RUSAGE_SELF) - processor_began_s;
  return solved;
}

bool by_petsc(const StructureSpec& spec, int ranks, const Rows* reference) {
  const auto solved = solve(spec, {Backend::petsc, ranks});
  std::fprintf(stderr, "%s", solved->statics->solver().report().c_str());
  std::printf("petsc_%d_ranks_nodes %zu nodes\npetsc_%d_ranks_time %.1f s\n", ranks,
              solved->structure.mesh.nodes_m.size(), ranks, solved->took_s);
  std::printf("petsc_%d_ranks_memory_of_this_process %.0f MB\n", ranks, peak_MB());
  if (reference == nullptr) return true;
  const double apart =
      disagreement(*reference, by_adjoint(solved->sensitivities, block_fields(solved->structure)));
  std::printf("petsc_%d_ranks_against_cholmod %.2g ratio\n", ranks, apart);
  return apart <= petsc_max;
}

bool compare(const Solved& own, const Rows& matrix, const Rows& fields, bool calculix,
             bool direct) {
  bool agreed = true;
  if (direct) {
    const double apart = disagreement(matrix, by_direct(own.structure, *own.statics, fields));
    std::printf("adjoint_against_direct %.2g ratio\n", apart);
    agreed = agreed && apart <= adjoint_max;
  }
  if (calculix) {
    double calculix_s = 0.0;
    const double others_s = processor_s(RUSAGE_CHILDREN);
    const Rows theirs = by_calculix(own.structure, fields, calculix_s);
    const double apart = disagreement(matrix, theirs);
    std::printf("time_calculix %.2f s\n", calculix_s);
    std::printf("disagreement_with_calculix %.2g ratio\n", apart);
    std::printf("processor_time_over_calculix %.3f ratio\n",
                own.processor_s / (processor_s(RUSAGE_CHILDREN) - others_s));
    std::printf("time_over_calculix %.3f ratio\n", own.took_s / calculix_s);
    agreed = agreed && apart <= agreement_max;
  }
  return agreed;
}

int run(const std::vector<std::string>& words) {
  const bool calculix = has(words, "calculix");
  if (calculix && std::system("command -v ccx > /dev/null") != 0) {
    std::printf("SKIPPED CalculiX (ccx) is not installed\n");
    return exit_nothing_to_compare;
  }
  const StructureSpec spec =
      parse_structure(column_text(words[0], {words[1], words[2], words[3]}), "column.toml");
  bool agreed = true;
  Rows matrix;
  const bool alone = has(words, "petsc_alone");
  if (!alone) {
    const auto own = solve(spec, {});
    std::printf("%s_nodes %zu nodes\n", words[0].c_str(), own->structure.mesh.nodes_m.size());
    std::printf("time_own %.2f s\nprocessor_time_own %.2f s\nmemory_own %.0f MB\n", own->took_s,
                own->processor_s, peak_MB());
    const Rows fields = block_fields(own->structure);
    matrix = by_adjoint(own->sensitivities, fields);
    agreed = compare(*own, matrix, fields, calculix, has(words, "direct"));
  }
  for (const int ranks : {1, 2}) {
    if (!has(words, ranks == 1 ? "petsc1" : "petsc2")) continue;
    agreed = by_petsc(spec, ranks, alone ? nullptr : &matrix) && agreed;
  }
  return agreed ? 0 : exit_disagrees;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 4 || (words[0] != "tet4" && words[0] != "tet10")) {
    std::fprintf(stderr,
                 "usage: bench_structure tet4|tet10 X_MM Y_MM Z_MM [calculix] [direct] "
                 "[petsc1] [petsc2] [petsc_alone]\n");
    return 2;
  }
  try {
    return run(words);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_structure: %s\n", error.what());
    return 2;
  }
}
