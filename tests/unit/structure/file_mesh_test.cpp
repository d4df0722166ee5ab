#include "modelling/structure/mesh/file_mesh.hpp"

#include <fstream>
#include <gmsh.h>
#include <numeric>

#include "models.hpp"

using namespace thermocomp::test;

namespace {

namespace fs = std::filesystem;

/// A uniquely named file; the destructor removes it.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& ending, const std::string& text = {})
      : path_(fs::temp_directory_path() /
              ("thermocomp_" + std::to_string(::getpid()) + "_" + ending)) {
    if (!text.empty()) std::ofstream(path_) << text;
  }
  ~TemporaryFile() { fs::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

Mesh as_mesh(const FileMesh& file, const std::optional<std::string>& group = {}) {
  Mesh mesh;
  mesh.part_names = {"body"};
  mesh.groups.resize(1);
  add_part(mesh, 0, file, group, add_nodes(mesh, file, 1.0));
  drop_unused_nodes(mesh);
  return mesh;
}

double volume_of(const Mesh& mesh) {
  const auto volumes = nodal_volumes(mesh);
  return std::accumulate(volumes.begin(), volumes.end(), 0.0);
}

/// Writes a box of 0.2 x 0.3 x 0.4 m meshed by Gmsh as .msh; its surface is the group "skin".
void write_msh(const fs::path& path, bool hexahedra, int order) {
  gmsh::initialize(0, nullptr, false);
  gmsh::option::setNumber("General.Terminal", 0);
  gmsh::option::setNumber("Mesh.SecondOrderIncomplete", 1);
  gmsh::model::occ::addBox(0, 0, 0, 0.2, 0.3, 0.4, 1);
  gmsh::model::occ::synchronize();
  gmsh::vectorpair faces;
  gmsh::model::getEntities(faces, 2);
  std::vector<int> tags;
  for (const auto& face : faces) tags.push_back(face.second);
  gmsh::model::setPhysicalName(2, gmsh::model::addPhysicalGroup(2, tags), "skin");
  gmsh::model::setPhysicalName(3, gmsh::model::addPhysicalGroup(3, {1}), "body");
  gmsh::option::setNumber("Mesh.MeshSizeMax", 0.1);
  if (hexahedra) gmsh::model::mesh::setTransfiniteAutomatic();
  gmsh::model::mesh::generate(3);
  gmsh::model::mesh::setOrder(order);
  gmsh::write(path.string());
  gmsh::finalize();
}

std::string refusal(const std::function<void()>& action) {
  try {
    action();
  } catch (const MeshError& error) {
    return error.what();
  }
  return "";
}

const std::string two_tets = R"(** a comment
*Heading
 something
*NODE, NSET=all
1, 0, 0, 0
2, 1.0, 0, 0
3, 0, 1, 0
4, 0, 0, 1
5, 1, 1, 1.0e0
*Element, type=C3D4, elset=First
10, 1, 2, 3, 4
*ELEMENT, TYPE=C3D4, ELSET=second
11, 2, 3, 4, 5
*NSET, NSET=base, GENERATE
1, 3, 1
*ELSET, ELSET=both
FIRST, second
*SURFACE, NAME=foot
first, S1
*MATERIAL, NAME=steel
)";

}  // namespace

TEST_CASE("meshes of Gmsh have the same volume and surface, and the correct stiffness",
          "[structure][files]") {
  for (const bool hexahedra : {false, true}) {
    for (const int order : {1, 2}) {
      INFO((hexahedra ? "hexahedra" : "tetrahedra") << " of order " << order);
      const TemporaryFile file("mesh.msh");
      write_msh(file.path(), hexahedra, order);
      const Mesh mesh = as_mesh(read_msh(file.path()), "body");
      CHECK(inverted_elements(mesh, 3).empty());
      CHECK(near(volume_of(mesh), 0.024, 1e-12));
      const Group& skin = mesh.groups[0].at("skin");
      CHECK(skin.faces.size() == surface_of(mesh).size());
      double area_m2 = 0.0;
      for (const Coupling& c : ground_couplings(mesh, skin.faces, {1, 1, 1})) {
        area_m2 += c.strength[0];
      }
      CHECK(near(area_m2, 2 * (0.2 * 0.3 + 0.3 * 0.4 + 0.4 * 0.2), 1e-12));
      // Detects a wrong order of the mid-side nodes.
      for (const Element& element : mesh.elements) {
        const ShapeInfo& info = shape_info(element.shape);
        const auto nodes = mesh.nodes_of(element);
        for (std::size_t i = info.corners; i < info.nodes; ++i) {
          const auto [a, b] = info.edges[i - info.corners];
          const Vec3 middle = 0.5 * (mesh.nodes_m[nodes[a]] + mesh.nodes_m[nodes[b]]);
          REQUIRE(length(mesh.nodes_m[nodes[i]] - middle) < 1e-12);
        }
      }
    }
  }
}

TEST_CASE("a geometry is meshed when read, in metres", "[structure][files]") {
  const TemporaryFile file("box.step");
  gmsh::initialize(0, nullptr, false);
  gmsh::option::setNumber("General.Terminal", 0);
  gmsh::model::occ::addBox(0, 0, 0, 200, 300, 400, 1);  // STEP is in mm
  gmsh::model::occ::synchronize();
  gmsh::write(file.path().string());
  gmsh::finalize();
  for (const Shape shape : {Shape::tet4, Shape::tet10}) {
    const Mesh mesh = as_mesh(mesh_step(file.path(), 0.1, shape));
    CHECK(mesh.elements.front().shape == shape);
    CHECK(near(volume_of(mesh), 0.024, 1e-9));
  }
}

TEST_CASE("files without a mesh or with unsupported elements are refused by name",
          "[structure][files]") {
  const TemporaryFile broken("broken.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\nfoo\n");
  CHECK(refusal([&] { static_cast<void>(read_msh(broken.path())); }).find("broken.msh") !=
        std::string::npos);
  CHECK(refusal([&] { static_cast<void>(read_msh("/nowhere.msh")); }) ==
        "/nowhere.msh: no such file");
  const TemporaryFile not_step("not.step", "ISO-10303-21;\nnothing\n");
  CHECK(refusal([&] {
          static_cast<void>(mesh_step(not_step.path(), 0.1, Shape::tet4));
        }).find("not.step") != std::string::npos);
}

TEST_CASE("an .inp file gives nodes, elements, sets and surfaces", "[structure][files]") {
  const TemporaryFile file("two.inp", two_tets);
  const FileMesh mesh = read_inp(file.path());
  CHECK(mesh.nodes.size() == 5);
  REQUIRE(mesh.volumes.size() == 2);
  CHECK(mesh.volumes[1].number == 11);
  CHECK(mesh.volume_groups.at("both") == std::vector<Index>{0, 1});
  CHECK(mesh.groups.at("base").nodes == std::vector<Index>{0, 1, 2});
  CHECK(mesh.groups.at("all").nodes.size() == 5);
  REQUIRE(mesh.groups.at("foot").faces.size() == 1);
  CHECK(mesh.groups.at("foot").nodes == std::vector<Index>{0, 1, 2});
  CHECK(near(volume_of(as_mesh(mesh, "First")), 1.0 / 6, 1e-15));
  CHECK(near(volume_of(as_mesh(mesh, "second")), 1.0 / 3, 1e-15));
  CHECK(refusal([&] {
          static_cast<void>(as_mesh(mesh, "third"));
        }).find("there are: First, both, second") != std::string::npos);
}

TEST_CASE("errors in an .inp file are reported with their line", "[structure][files]") {
  struct Case {
    std::string text;
    std::string message;
  };
  const std::string nodes = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n";
  for (const auto& [text, message] : std::vector<Case>{
           {"*NODE\n1, 0, nan, 0\n", ":2: \"nan\" must be a finite number"},
           {"*NODE\n1, 0, 0\n", ":2: a node must be"},
           {nodes + "4, 0, 0, 0\n", ":6: node 4 is defined twice"},
           {nodes + "*ELEMENT, TYPE=S4\n", ":6: elements of type \"S4\""},
           {nodes + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 9\n", ":7: element 1: there is no node 9"},
           {nodes + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3\n", ": element 1 has 3 nodes, not 4"},
           {nodes + "*INCLUDE, INPUT=x\n", ":6: *INCLUDE is not read"},
           {nodes, "no element of type"},
           {nodes + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n*SURFACE, NAME=s\n1, S9\n",
            ":9: there is no face S9"},
           {nodes + "*ELSET, ELSET=a\nb\n", ":7: there is no set b"},
       }) {
    const TemporaryFile file("bad.inp", text);
    const std::string what = refusal([&] { static_cast<void>(read_inp(file.path())); });
    INFO(text << what);
    CHECK(what.find(message) != std::string::npos);
  }
}

TEST_CASE("quadratic elements of an .inp file may span several lines", "[structure][files]") {
  std::string text = "*NODE\n";
  const ShapeInfo& info = shape_info(Shape::hex20);
  for (std::size_t i = 0; i < 20; ++i) {
    text += std::to_string(i + 1);
    for (const double value : info.node_locals[i]) text += ", " + std::to_string(value);
    text += "\n";
  }
  text += "*ELEMENT, TYPE=C3D20R, ELSET=e\n7, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10,\n";
  text += "11, 12, 13, 14, 15, 16, 17, 18, 19, 20\n";
  const TemporaryFile file("hex.inp", text);
  CHECK(near(volume_of(as_mesh(read_inp(file.path()))), 8.0, 1e-12));
}
