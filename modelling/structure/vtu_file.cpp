#include <cstring>

#include "modelling/structure/pictures.hpp"
#include "report/xml_text.hpp"

namespace thermocomp::structure {
namespace {

int cell_type(Shape shape) {
  switch (shape) {
    case Shape::tet4:
      return 10;
    case Shape::hex8:
      return 12;
    case Shape::tet10:
      return 24;
    default:
      return 25;  // hex20
  }
}

/// Arrays stand behind the XML as raw bytes, each after its size; the XML holds their offsets.
class Appended {
 public:
  template <class T>
  std::string array(const char* type, const std::string& name, int components,
                    const std::vector<T>& values) {
    std::string tag = "<DataArray type=\"";
    tag.append(type).append("\" Name=\"").append(xml_text(name));
    tag.append("\" NumberOfComponents=\"").append(std::to_string(components));
    tag.append("\" format=\"appended\" offset=\"").append(std::to_string(bytes_.size()));
    tag.append("\"/>\n");
    const std::uint64_t size = values.size() * sizeof(T);
    append(&size, sizeof size);
    append(values.data(), size);
    return tag;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t size) {
    bytes_.append(static_cast<const char*>(data), size);
  }
  std::string bytes_;
};

std::string cells(const Mesh& mesh, Appended& appended) {
  std::vector<std::int32_t> connectivity;
  std::vector<std::int32_t> offsets;
  std::vector<std::uint8_t> types;
  std::vector<std::int32_t> parts;
  for (const Element& element : mesh.elements) {
    for (const Index node : mesh.nodes_of(element)) {
      connectivity.push_back(static_cast<std::int32_t>(node));
    }
    offsets.push_back(static_cast<std::int32_t>(connectivity.size()));
    types.push_back(static_cast<std::uint8_t>(cell_type(element.shape)));
    parts.push_back(static_cast<std::int32_t>(element.part));
  }
  std::string text = "<Cells>\n" + appended.array("Int32", "connectivity", 1, connectivity);
  text += appended.array("Int32", "offsets", 1, offsets);
  text += appended.array("UInt8", "types", 1, types);
  text += "</Cells>\n<CellData>\n";
  text += appended.array("Int32", "part", 1, parts);
  return text + "</CellData>\n";
}

}  // namespace

std::string vtu_file(const Structure& structure, const std::vector<BlockShape>& shapes) {
  const Mesh& mesh = structure.mesh;
  Appended appended;
  std::vector<double> points;
  for (const Vec3& node : mesh.nodes_m) points.insert(points.end(), node.begin(), node.end());
  const std::vector<std::int32_t> blocks(structure.block_of_node.begin(),
                                         structure.block_of_node.end());
  std::string text =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n"
      "<Piece NumberOfPoints=\"";
  text.append(std::to_string(mesh.nodes_m.size())).append("\" NumberOfCells=\"");
  text.append(std::to_string(mesh.elements.size())).append("\">\n<Points>\n");
  text.append(appended.array("Float64", "points_m", 3, points)).append("</Points>\n");
  text.append(cells(mesh, appended)).append("<PointData>\n");
  text += appended.array("Int32", "block", 1, blocks);
  for (const BlockShape& shape : shapes) {
    std::vector<float> displacement_um;
    displacement_um.reserve(shape.displacement_m.size());
    for (const double value : shape.displacement_m) {
      displacement_um.push_back(static_cast<float>(1e6 * value));
    }
    text += appended.array("Float32", shape.block + "_um_per_K", 3, displacement_um);
  }
  text += "</PointData>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
  text += appended.bytes();
  return text + "\n</AppendedData>\n</VTKFile>\n";
}

}  // namespace thermocomp::structure
