#include "modelling/structure/mesh/file_mesh.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>
#include <set>
#include <unordered_map>

#include "modelling/structure/modules/module_loader.hpp"

namespace thermocomp::structure {

namespace {

namespace fs = std::filesystem;

constexpr Module gmsh_module{"thermocomp-gmsh.so", "reads .msh and STEP files",
                             "thermocomp_gmsh_functions", "Gmsh's library (Debian 12: libgmsh4.8)"};

const GmshFunctions& gmsh() {
  // Retried if loading failed.
  static const auto& functions = *static_cast<const GmshFunctions*>(functions_of(gmsh_module));
  return functions;
}

void expect_file(const fs::path& path) {
  if (!fs::is_regular_file(path)) throw MeshError(path.string() + ": no such file");
}

std::string listed(const std::map<std::string, std::vector<Index>>& groups) {
  std::string text;
  for (const auto& [name, volumes] : groups) text.append(text.empty() ? "" : ", ").append(name);
  return text.empty() ? "none" : text;
}

}  // namespace

FileMesh read_msh(const fs::path& path) {
  expect_file(path);
  return gmsh().read_msh(path);
}

FileMesh mesh_step(const fs::path& path, double size_m, Shape shape) {
  expect_file(path);
  return gmsh().mesh_step(path, size_m, shape);
}

Index add_nodes(Mesh& mesh, const FileMesh& file, double unit_m) {
  const auto first = static_cast<Index>(mesh.nodes_m.size());
  for (const Vec3& node : file.nodes) mesh.nodes_m.push_back(unit_m * node);
  return first;
}

void add_part(Mesh& mesh, Index part, const FileMesh& file, const std::optional<std::string>& group,
              Index first_node) {
  const auto add_volume = [&](const FileMesh::Volume& volume) {
    std::vector<Index> nodes = volume.nodes;
    for (Index& node : nodes) node += first_node;
    mesh.add_element(volume.shape, part, nodes, volume.number);
  };
  if (group) {
    const auto found = file.volume_groups.find(*group);
    if (found == file.volume_groups.end()) {
      throw MeshError("there is no group of volume elements called \"" + *group +
                      "\"; there are: " + listed(file.volume_groups));
    }
    for (const Index volume : found->second) add_volume(file.volumes[volume]);
  } else {
    for (const FileMesh::Volume& volume : file.volumes) add_volume(volume);
  }
  mesh.groups[part] = file.groups;
  for (auto& [name, its] : mesh.groups[part]) {
    for (Index& node : its.nodes) node += first_node;
    for (Face& face : its.faces) {
      const std::size_t count = shape_info(face.shape).nodes;
      for (std::size_t i = 0; i < count; ++i) face.nodes[i] += first_node;
      face.part = part;
    }
  }
}

namespace {

std::string trimmed(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())) != 0) {
    text.remove_prefix(1);
  }
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) {
    text.remove_suffix(1);
  }
  return std::string(text);
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// Splits at commas; ignores one comma at the end of the line.
std::vector<std::string> fields_of(std::string_view line) {
  std::vector<std::string> fields;
  while (!line.empty()) {
    const std::size_t comma = line.find(',');
    fields.push_back(trimmed(line.substr(0, comma)));
    line = comma == std::string_view::npos ? std::string_view() : line.substr(comma + 1);
  }
  if (!fields.empty() && fields.back().empty()) fields.pop_back();
  return fields;
}

struct Keyword {
  std::string name;                               ///< "ELEMENT"
  std::map<std::string, std::string> parameters;  ///< names in upper case, values as written
};

Keyword keyword_of(const std::string& line) {
  Keyword keyword;
  for (const std::string& field : fields_of(std::string_view(line).substr(1))) {
    const std::size_t equals = field.find('=');
    const std::string name = upper(trimmed(field.substr(0, equals)));
    if (keyword.name.empty()) {
      keyword.name = name;
    } else {
      keyword.parameters[name] =
          equals == std::string::npos ? "" : trimmed(field.substr(equals + 1));
    }
  }
  return keyword;
}

class InpReader {
 public:
  explicit InpReader(const std::filesystem::path& path) : path_(path), file_(path) {
    if (!file_) throw MeshError(path.string() + ": cannot be opened");
  }

  FileMesh read() {
    std::string line;
    while (std::getline(file_, line)) {
      ++line_number_;
      const std::string text = trimmed(line);
      if (text.empty() || text.rfind("**", 0) == 0) continue;
      if (text.front() == '*') {
        begin(keyword_of(text));
      } else {
        data(fields_of(text));
      }
    }
    expect_whole_element();
    if (mesh_.volumes.empty()) fail("no element of type C3D4, C3D10, C3D8 or C3D20");
    finish_groups();
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw MeshError(path_.string() + ":" + std::to_string(line_number_) + ": " + what);
  }

  Index index(const std::string& text) const {
    Index value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) {
      fail("\"" + text + "\" must be a whole number");
    }
    return value;
  }

  double coordinate(const std::string& text) const {
    double value = 0.0;
    const char* first = text.data() + (text.rfind('+', 0) == 0 ? 1 : 0);
    const auto [end, error] = std::from_chars(first, text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
      fail("\"" + text + "\" must be a finite number");
    }
    return value;
  }

  void begin(const Keyword& keyword) {
    expect_whole_element();
    keyword_ = keyword;
    set_.clear();
    const auto parameter = [&](const char* name) {
      const auto found = keyword_.parameters.find(name);
      return found == keyword_.parameters.end() ? std::string() : found->second;
    };
    if (keyword.name == "INCLUDE" || keyword.name == "INSTANCE") {
      fail("*" + keyword.name + " is not read; write the mesh as one flat file");
    }
    if (keyword.name == "ELEMENT") {
      set_ = known_name(parameter("ELSET"));
      shape_ = shape_of(upper(parameter("TYPE")));
    } else if (keyword.name == "NODE" || keyword.name == "NSET") {
      set_ = known_name(parameter("NSET"));
    } else if (keyword.name == "ELSET") {
      set_ = known_name(parameter("ELSET"));
    } else if (keyword.name == "SURFACE") {
      set_ = known_name(parameter("NAME"));
    }
    if ((keyword.name == "NSET" || keyword.name == "ELSET" || keyword.name == "SURFACE") &&
        set_.empty()) {
      fail("*" + keyword.name + " must have a name");
    }
  }

  /// Names are case-insensitive and kept as first written.
  std::string known_name(const std::string& name) {
    return name.empty() ? name : names_.try_emplace(upper(name), name).first->second;
  }

  Shape shape_of(const std::string& type) const {
    for (const auto& [prefix, shape] :
         {std::pair{"C3D20", Shape::hex20}, std::pair{"C3D10", Shape::tet10},
          std::pair{"C3D4", Shape::tet4}, std::pair{"C3D8", Shape::hex8}}) {
      const std::string_view name(prefix);
      if (type.rfind(name, 0) != 0) continue;
      if (type.size() > name.size() && std::isdigit(static_cast<unsigned char>(type[name.size()])))
        continue;
      return shape;
    }
    fail("elements of type \"" + type + "\" are not known; C3D4, C3D10, C3D8 and C3D20 are");
  }

  void data(const std::vector<std::string>& fields) {
    if (fields.empty()) return;
    if (keyword_.name == "NODE") {
      add_node(fields);
    } else if (keyword_.name == "ELEMENT") {
      add_element_fields(fields);
    } else if (keyword_.name == "NSET" || keyword_.name == "ELSET") {
      add_to_set(fields, keyword_.name == "NSET" ? node_sets_ : element_sets_);
    } else if (keyword_.name == "SURFACE") {
      if (fields.size() != 2) fail("a surface line must be: element or set, face");
      surfaces_[set_].push_back({fields[0], upper(fields[1]), line_number_});
    }
  }

  void add_node(const std::vector<std::string>& fields) {
    if (fields.size() < 4) fail("a node must be: number, x, y, z");
    const Index number = index(fields[0]);
    if (!node_of_.try_emplace(number, static_cast<Index>(mesh_.nodes.size())).second) {
      fail("node " + fields[0] + " is defined twice");
    }
    mesh_.nodes.push_back({coordinate(fields[1]), coordinate(fields[2]), coordinate(fields[3])});
    if (!set_.empty()) node_sets_[set_].push_back(number);
  }

  void expect_whole_element() {
    if (!pending_.empty()) {
      fail("element " + std::to_string(pending_[0]) + " has " +
           std::to_string(pending_.size() - 1) + " nodes, not " +
           std::to_string(shape_info(shape_).nodes));
    }
  }

  void add_element_fields(const std::vector<std::string>& fields) {
    for (const std::string& field : fields) pending_.push_back(index(field));
    const std::size_t wanted = shape_info(shape_).nodes + 1;
    if (pending_.size() > wanted) expect_whole_element();
    if (pending_.size() < wanted) return;
    FileMesh::Volume volume{shape_, pending_[0], {}};
    for (std::size_t i = 1; i < wanted; ++i) {
      const auto found = node_of_.find(pending_[i]);
      if (found == node_of_.end()) {
        fail("element " + std::to_string(pending_[0]) + ": there is no node " +
             std::to_string(pending_[i]));
      }
      volume.nodes.push_back(found->second);
    }
    if (!volume_of_.try_emplace(pending_[0], static_cast<Index>(mesh_.volumes.size())).second) {
      fail("element " + std::to_string(pending_[0]) + " is defined twice");
    }
    if (!set_.empty()) element_sets_[set_].push_back(pending_[0]);
    mesh_.volumes.push_back(std::move(volume));
    pending_.clear();
  }

  using Sets = std::map<std::string, std::vector<Index>>;

  void add_to_set(const std::vector<std::string>& fields, Sets& sets) {
    std::vector<Index>& members = sets[set_];
    if (keyword_.parameters.contains("GENERATE")) {
      if (fields.size() < 2) fail("a generated set must be: first, last, step");
      const Index last = index(fields[1]);
      const Index step = fields.size() > 2 ? index(fields[2]) : 1;
      if (step == 0 || last > 1'000'000'000) fail("a generated set must be: first, last, step");
      for (Index i = index(fields[0]); i <= last; i += step) members.push_back(i);
      return;
    }
    for (const std::string& field : fields) {
      if (std::isdigit(static_cast<unsigned char>(field.front())) != 0) {
        members.push_back(index(field));
        continue;
      }
      const auto other = sets.find(known_name(field));
      if (other == sets.end()) fail("there is no set " + field + " before this line");
      const std::vector<Index> theirs = other->second;
      members.insert(members.end(), theirs.begin(), theirs.end());
    }
  }

  void finish_groups() {
    for (const auto& [name, numbers] : node_sets_) {
      for (const Index number : numbers) {
        const auto found = node_of_.find(number);
        if (found != node_of_.end()) mesh_.groups[name].nodes.push_back(found->second);
      }
    }
    for (const auto& [name, numbers] : element_sets_) {
      for (const Index number : numbers) {
        const auto found = volume_of_.find(number);
        if (found == volume_of_.end()) continue;
        mesh_.volume_groups[name].push_back(found->second);
        const auto& nodes = mesh_.volumes[found->second].nodes;
        std::vector<Index>& group = mesh_.groups[name].nodes;
        group.insert(group.end(), nodes.begin(), nodes.end());
      }
    }
    for (const auto& [name, entries] : surfaces_) add_surface(name, entries);
    for (auto& [name, group] : mesh_.groups) {
      std::sort(group.nodes.begin(), group.nodes.end());
      group.nodes.erase(std::unique(group.nodes.begin(), group.nodes.end()), group.nodes.end());
    }
  }

  struct SurfaceEntry {
    std::string of;
    std::string face;
    int line;
  };

  void add_surface(const std::string& name, const std::vector<SurfaceEntry>& entries) {
    for (const SurfaceEntry& entry : entries) {
      line_number_ = entry.line;
      std::vector<Index> numbers;
      if (std::isdigit(static_cast<unsigned char>(entry.of.front())) != 0) {
        numbers.push_back(index(entry.of));
      } else {
        const auto set = element_sets_.find(known_name(entry.of));
        if (set == element_sets_.end()) fail("there is no element set " + entry.of);
        numbers = set->second;
      }
      for (const Index number : numbers) {
        const auto found = volume_of_.find(number);
        if (found == volume_of_.end()) fail("there is no element " + std::to_string(number));
        add_face(mesh_.groups[name], mesh_.volumes[found->second], entry.face);
      }
    }
  }

  void add_face(Group& group, const FileMesh::Volume& volume, const std::string& face) const {
    const auto& faces = shape_info(volume.shape).faces;  // in the order S1, S2, ...
    const bool known = face.size() == 2 && face[0] == 'S' && face[1] >= '1' &&
                       static_cast<std::size_t>(face[1] - '1') < faces.size();
    if (!known) fail("there is no face " + face + " in this element");
    const ShapeFace& local = faces[static_cast<std::size_t>(face[1] - '1')];
    Face result{local.shape, 0, {}};
    for (std::size_t i = 0; i < local.nodes.size(); ++i) {
      result.nodes[i] = volume.nodes[local.nodes[i]];
      group.nodes.push_back(result.nodes[i]);
    }
    group.faces.push_back(result);
  }

  std::filesystem::path path_;
  std::ifstream file_;
  int line_number_{0};
  Keyword keyword_;
  std::string set_;
  Shape shape_{Shape::tet4};
  std::vector<Index> pending_;  ///< number and nodes of an element continued on the next line
  FileMesh mesh_;
  std::unordered_map<Index, Index> node_of_;
  std::unordered_map<Index, Index> volume_of_;
  std::map<std::string, std::string> names_;
  Sets node_sets_;
  Sets element_sets_;
  std::map<std::string, std::vector<SurfaceEntry>> surfaces_;
};

}  // namespace

FileMesh read_inp(const std::filesystem::path& path) {
  return InpReader(path).read();
}

}  // namespace thermocomp::structure
