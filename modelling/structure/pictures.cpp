#include "modelling/structure/pictures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <numeric>

#include "report/svg_plot.hpp"

namespace thermocomp::structure {

namespace {

constexpr double panel_px = 360.0;
constexpr double margin_px = 24.0;
constexpr std::size_t panels_in_a_row = 4;
constexpr double shown_of_size = 0.08;          ///< largest displacement as a share of the picture
constexpr std::size_t faces_with_edges = 4000;  ///< above this number, edges would hide the colours

/// Isometric directions: right, up, towards the viewer.
const Vec3 right{std::sqrt(0.5), -std::sqrt(0.5), 0.0};
const Vec3 up{-std::sqrt(1.0 / 6), -std::sqrt(1.0 / 6), std::sqrt(2.0 / 3)};
const Vec3 viewer{std::sqrt(1.0 / 3), std::sqrt(1.0 / 3), std::sqrt(1.0 / 3)};

/// Colours evenly around the hue circle; consecutive numbers are far apart in hue.
std::string colour(Index block, double light) {
  const double hue = std::fmod(137.508 * static_cast<double>(block), 360.0);
  char text[40];
  std::snprintf(text, sizeof text, "hsl(%.0f,55%%,%.0f%%)", hue, 38.0 + 34.0 * light);
  return text;
}

class Picture {
 public:
  explicit Picture(const Structure& structure)
      : structure_(structure),
        surface_(surface_of(structure.mesh)),
        box_(bounds_of(structure.mesh.nodes_m)) {}

  void add_panel(const std::string& title, const std::vector<double>& displacement_m) {
    const double factor = enlargement(displacement_m);
    std::vector<Vec3> points = structure_.mesh.nodes_m;
    for (std::size_t i = 0; i < displacement_m.size(); ++i) {
      points[i / 3][i % 3] += factor * displacement_m[i];
    }
    const auto column = static_cast<double>(panels_ % panels_in_a_row);
    const std::size_t rows_above = panels_ / panels_in_a_row;
    const auto row = static_cast<double>(rows_above);
    ++panels_;
    char text[160];
    std::snprintf(text, sizeof text, "<g transform=\"translate(%.0f %.0f)\">\n", column * panel_px,
                  row * panel_px);
    body_ += text;
    draw_faces(points);
    std::snprintf(text, sizeof text, "<text x=\"%.0f\" y=\"%.0f\">", margin_px, panel_px - 8.0);
    body_.append(text).append(xml_text(title));
    if (factor > 0.0) {
      std::snprintf(text, sizeof text, " +1 K, displacement x %.2g", factor);
      body_ += text;
    }
    body_ += "</text>\n</g>\n";
  }

  [[nodiscard]] std::string text() const {
    const std::size_t rows = (panels_ + panels_in_a_row - 1) / panels_in_a_row;
    const std::size_t columns = std::min(panels_, panels_in_a_row);
    char head[320];
    std::snprintf(head, sizeof head,
                  "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" "
                  "font-family=\"sans-serif\" font-size=\"12\">\n"
                  "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
                  panel_px * static_cast<double>(columns), panel_px * static_cast<double>(rows));
    return head + body_ + "</svg>\n";
  }

 private:
  /// @return 0 without displacement
  [[nodiscard]] double enlargement(const std::vector<double>& displacement_m) const {
    double largest = 0.0;
    for (const double value : displacement_m) largest = std::max(largest, std::fabs(value));
    return largest > 0.0 ? shown_of_size * box_.diagonal_m() / largest : 0.0;
  }

  /// Pixels of a point in a panel; scale and centre of the undeformed structure.
  [[nodiscard]] std::array<double, 2> pixel(const Vec3& point) const {
    const Vec3 from_middle = point - 0.5 * (box_.low_m + box_.high_m);
    const double scale = (panel_px - 2.0 * margin_px) / (box_.diagonal_m() * 1.1);
    return {0.5 * panel_px + scale * dot(from_middle, right),
            0.5 * panel_px - scale * dot(from_middle, up)};
  }

  /// Draws the faces towards the viewer from back to front.
  void draw_faces(const std::vector<Vec3>& points) {
    struct Seen {
      const Face* face;
      double depth;
      double light;
    };
    std::vector<Seen> seen;
    for (const Face& face : surface_) {
      const std::size_t corners = shape_info(face.shape).corners;
      const auto at = [&](std::size_t i) { return points[face.nodes[i]]; };
      const Vec3 normal =
          corners == 3 ? cross(at(1) - at(0), at(2) - at(0)) : cross(at(2) - at(0), at(3) - at(1));
      const double facing = dot(normal, viewer) / std::max(length(normal), 1e-300);
      if (!(facing > 0.0)) continue;
      double depth = 0.0;
      for (std::size_t i = 0; i < corners; ++i) {
        depth += dot(at(i), viewer) / static_cast<double>(corners);
      }
      seen.push_back({&face, depth, light_of(normal)});
    }
    std::sort(seen.begin(), seen.end(),
              [](const Seen& a, const Seen& b) { return a.depth < b.depth; });
    body_ += seen.size() <= faces_with_edges ? "<g stroke=\"#222\" stroke-width=\"0.3\">\n"
                                             : "<g stroke-width=\"0.5\">\n";
    for (const Seen& one : seen) {
      draw(*one.face, points, one.light, seen.size() > faces_with_edges);
    }
    body_ += "</g>\n";
  }

  static double light_of(const Vec3& normal) {
    const Vec3 lamp{0.2, 0.55, 0.8};
    return std::clamp(dot(normal, lamp) / std::max(length(normal) * length(lamp), 1e-300), 0.0,
                      1.0);
  }

  void draw(const Face& face, const std::vector<Vec3>& points, double light, bool own_edges) {
    const std::size_t corners = shape_info(face.shape).corners;
    std::vector<Index> blocks;
    for (std::size_t i = 0; i < corners; ++i) {
      blocks.push_back(structure_.block_of_node[face.nodes[i]]);
    }
    std::sort(blocks.begin(), blocks.end());
    const std::string fill = colour(blocks[corners / 2], light);
    body_ += "<path d=\"";
    char text[48];
    for (std::size_t i = 0; i < corners; ++i) {
      const auto [x, y] = pixel(points[face.nodes[i]]);
      std::snprintf(text, sizeof text, "%c%.1f %.1f", i == 0 ? 'M' : 'L', x, y);
      body_ += text;
    }
    body_.append("Z\" fill=\"").append(fill);
    if (own_edges) body_.append("\" stroke=\"").append(fill);
    body_ += "\"/>\n";
  }

  const Structure& structure_;
  std::vector<Face> surface_;
  Box box_;
  std::string body_;
  std::size_t panels_{0};
};

}  // namespace

std::string svg_picture(const Structure& structure, const std::vector<BlockShape>& shapes) {
  Picture picture(structure);
  picture.add_panel(std::to_string(structure.block_names.size()) + " blocks", {});
  for (const BlockShape& shape : shapes) picture.add_panel(shape.block, shape.displacement_m);
  return picture.text();
}

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

/// Arrays appended to the XML as raw bytes, each after its size; the XML contains their offsets.
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

std::vector<NodeValues> values_of(const std::vector<BlockShape>& shapes) {
  std::vector<NodeValues> list;
  for (const BlockShape& shape : shapes) {
    NodeValues& added = list.emplace_back(NodeValues{shape.block + "_um_per_K", 3, {}});
    for (const double value_m : shape.displacement_m) added.values.push_back(1e6 * value_m);
  }
  return list;
}

std::string vtu_file(const Structure& structure, const std::vector<NodeValues>& data) {
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
  for (const NodeValues& each : data) {
    const std::vector<float> values(each.values.begin(), each.values.end());
    text += appended.array("Float32", each.name, each.components, values);
  }
  text += "</PointData>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
  text += appended.bytes();
  return text + "\n</AppendedData>\n</VTKFile>\n";
}

std::vector<std::size_t> moments(std::size_t first, std::size_t last) {
  constexpr std::size_t steps_max = 24;
  const std::size_t steps = std::min(steps_max, last - first);
  std::vector<std::size_t> chosen{first};
  for (std::size_t i = 1; i <= steps; ++i) chosen.push_back(first + (last - first) * i / steps);
  return chosen;
}

SurfacePicture::SurfacePicture(const StructureSpec& spec, const Structure& structure) {
  picture_.title = spec.file.stem().string();
  std::map<Index, std::uint32_t> number_of;
  for (const Face& face : surface_of(structure.mesh)) {
    const std::size_t corners = shape_info(face.shape).corners;
    std::array<std::uint32_t, 4> numbers{};
    for (std::size_t i = 0; i < corners; ++i) {
      const Index node = face.nodes[i];
      const auto next = static_cast<std::uint32_t>(nodes_.size());
      const auto [found, is_new] = number_of.try_emplace(node, next);
      if (is_new) nodes_.push_back(node);
      numbers[i] = found->second;
    }
    for (std::size_t i = 2; i < corners; ++i)
      picture_.triangles.insert(picture_.triangles.end(), {numbers[0], numbers[i - 1], numbers[i]});
  }
  for (const Index node : nodes_)
    for (const double value_m : structure.mesh.nodes_m[node])
      picture_.nodes_mm.push_back(1e3 * value_m);
  for (const OutputSpec& output : spec.outputs) {
    rows_.push_back(structure.rows[picture_.outputs.size()]);
    picture_.outputs.push_back(output.name);
    for (const PlaceSpec& place : output.places)
      for (const Vec3& at_m : place.at_m)
        add_point((place.sign > 0.0 ? "tool, " : "work, ") + output.name, false, at_m);
  }
  for (const SensorSpec& sensor : spec.sensors) add_sensor(sensor.name, sensor.place.at_m.front());
}

void SurfacePicture::add_state(BodyState state, std::span<const double> rise_K,
                               std::span<const double> displacement_m) {
  for (const Index node : nodes_) {
    state.rise_K.push_back(rise_K[node]);
    for (std::size_t c = 0; c < 3; ++c)
      state.moved_um.push_back(1e6 * displacement_m[3 * std::size_t{node} + c]);
  }
  for (const Functional& row : rows_) state.outputs_um.push_back(1e6 * row.of(displacement_m));
  picture_.states.push_back(std::move(state));
}

void SurfacePicture::add_sensor(const std::string& name, const Vec3& at_m) {
  add_point(name, true, at_m);
}

void SurfacePicture::leave_out_sensors() {
  std::erase_if(picture_.points, [](const BodyPoint& point) { return point.is_sensor; });
}

void SurfacePicture::set_title(const std::string& title, const std::string& note) {
  picture_.title = title;
  picture_.note = note;
}

/// Outputs at the same point share one point.
void SurfacePicture::add_point(const std::string& name, bool is_sensor, const Vec3& at_m) {
  const BodyPoint point{name, is_sensor, {1e3 * at_m[0], 1e3 * at_m[1], 1e3 * at_m[2]}};
  for (BodyPoint& known : picture_.points) {
    if (is_sensor || known.is_sensor || known.at_mm != point.at_mm) continue;
    if (known.name != name) known.name += name.substr(name.find(','));
    return;
  }
  picture_.points.push_back(point);
}

}  // namespace thermocomp::structure
