#include "modelling/structure/structure_model.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "config/model/model_file.hpp"
#include "modelling/structure/pictures.hpp"
#include "models.hpp"

using namespace thermocomp;
using namespace thermocomp::test;

namespace {

const std::string material = R"(format = 1
[[material]]
name = "iron"
youngs_modulus_GPa = 110
poisson_ratio = 0.25
expansion_um_per_m_K = 10
)";

std::string box_part(const std::string& name, const std::string& from, const std::string& to,
                     const std::string& element = "hex20") {
  return "[[part]]\nname = \"" + name + "\"\nmaterial = \"iron\"\nelement = \"" + element +
         "\"\nsize_mm = [50, 50, 50]\n[[part.box]]\nfrom_mm = " + from + "\nto_mm = " + to + "\n";
}

const std::string column = box_part("column", "[0, 0, 0]", "[100, 100, 400]");
const std::string foot = "[[support]]\non = { z_mm = [0, 0] }\n";
const std::string all_warm = "[[block]]\nname = \"t1_degC\"\nrest = true\n";
const std::string top =
    "[[output]]\nname = \"z_um\"\ndirection = \"z\"\n"
    "tool = { part = \"column\", at_mm = [50, 50, 400] }\n";

struct Result {
  Structure structure;
  ThermalModel model;
};

Result matrix_of(const std::string& text) {
  const StructureSpec spec = parse_structure(text, "machine.toml");
  Result result{build_structure(spec, [](std::string_view) {}), {}};
  const Structure& s = result.structure;
  const Statics statics(s.mesh, s.material_of_part, s.reduction, s.springs);
  result.model = block_model(spec, s, statics.sensitivities(s.rows));
  CHECK_FALSE(structure_report(s, statics, result.model).empty());
  return result;
}

std::vector<std::string> problems_in(const std::string& text) {
  std::vector<std::string> lines;
  try {
    static_cast<void>(
        build_structure(parse_structure(text, "machine.toml"), [](std::string_view) {}));
  } catch (const ConfigurationError& error) {
    for (const Problem& problem : error.problems()) lines.push_back(to_string(problem));
  }
  return lines;
}

bool mentions(const std::vector<std::string>& lines, const std::string& text) {
  return std::any_of(lines.begin(), lines.end(),
                     [&](const std::string& line) { return line.find(text) != std::string::npos; });
}

}  // namespace

TEST_CASE("a free column expands by alpha L per kelvin, the sum of its blocks",
          "[structure][model]") {
  const std::string slides =
      "[[support]]\non = { z_mm = [0, 0] }\ndirections = [\"z\"]\n"
      "[[support]]\non = { x_mm = [0, 0] }\ndirections = [\"x\"]\n"
      "[[support]]\non = { y_mm = [0, 0] }\ndirections = [\"y\"]\n";
  const std::string blocks =
      "[[division]]\npart = \"column\"\ny_mm = [50]\nz_mm = [200]\n"
      "names = [\"b1_degC\", \"b2_degC\", \"b3_degC\", \"b4_degC\"]\n";
  for (const char* element : {"tet4", "tet10", "hex8", "hex20"}) {
    INFO(element);
    std::string text = material;
    text.append(box_part("column", "[0, 0, 0]", "[100, 100, 400]", element));
    const Result result = matrix_of(text.append(slides).append(blocks).append(top));
    CHECK(result.model.inputs ==
          std::vector<std::string>{"b1_degC", "b2_degC", "b3_degC", "b4_degC"});
    const auto& row = result.model.matrix_um_per_K.at(0);
    CHECK(near(std::accumulate(row.begin(), row.end(), 0.0), 10e-6 * 0.4 * 1e6, 1e-9));
  }
}

TEST_CASE("two bonded halves behave as one part", "[structure][model]") {
  const std::string halves = box_part("lower", "[0, 0, 0]", "[100, 100, 200]") +
                             box_part("column", "[0, 0, 200]", "[100, 100, 400]");
  const std::string joint =
      "[[joint]]\nname = \"middle\"\nfrom = { part = \"lower\", z_mm = [200, 200] }\n"
      "to = { part = \"column\", z_mm = [200, 200] }\n";
  const std::string blocks =
      "[[block]]\nname = \"warm_degC\"\non = { x_mm = [0, 40] }\n"
      "[[block]]\nname = \"cold_degC\"\nrest = true\n";
  const std::string lean = top +
                           "[[output]]\nname = \"x_um\"\ndirection = [1, 0, 0]\n"
                           "tool = { part = \"column\", at_mm = [50, 50, 400] }\n";
  const auto whole = matrix_of(material + column + foot + blocks + lean).model.matrix_um_per_K;
  const auto bonded =
      matrix_of(material + halves + joint + foot + blocks + lean).model.matrix_um_per_K;
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t j = 0; j < 2; ++j) CHECK(near(whole[i][j], bonded[i][j], 1e-9));
  }
  // A very stiff spring joint gives nearly the same.
  std::string stiff = joint;
  stiff += "kind = \"spring\"\nstiffness_N_per_um = [1e7, 1e7, 1e7]\n";
  const auto sprung =
      matrix_of(material + halves + stiff + foot + blocks + lean).model.matrix_um_per_K;
  CHECK(near(whole[1][0], sprung[1][0], 1e-2 * std::fabs(whole[1][0])));
  // With non-matching meshes free expansion is still exact.
  const std::string coarse =
      box_part("lower", "[0, 0, 0]", "[100, 100, 200]") +
      "[[part]]\nname = \"column\"\nmaterial = \"iron\"\nelement = \"tet10\"\n"
      "size_mm = [34, 34, 50]\n[[part.box]]\nfrom_mm = [0, 0, 200]\nto_mm = [100, 100, 400]\n";
  const std::string slides =
      "[[support]]\non = { z_mm = [0, 0] }\ndirections = [\"z\"]\n"
      "[[support]]\non = { x_mm = [0, 0] }\ndirections = [\"x\"]\n"
      "[[support]]\non = { y_mm = [0, 0] }\ndirections = [\"y\"]\n";
  const auto free = matrix_of(material + coarse + joint + slides + all_warm + top);
  CHECK(near(free.model.matrix_um_per_K[0][0], 4.0, 1e-9));
}

TEST_CASE("a guideway has one row per position, with opposite sign on the work side",
          "[structure][model]") {
  const auto guideway = [](const std::string& carries) {
    return "[[guideway]]\nname = \"rail\"\naxis = \"z_mm\"\npart = \"column\"\n"
           "from_mm = [0, 50, 100]\nto_mm = [0, 50, 300]\npositions_mm = [0, 100, 200]\n"
           "carries = \"" +
           carries + "\"\noutputs = { z_um = \"z\" }\n";
  };
  const Result tool = matrix_of(material + column + foot + all_warm + top + guideway("tool"));
  const Result work = matrix_of(material + column + foot + all_warm + top + guideway("work"));
  const auto& up = tool.model.guideways.at(0).rows_um_per_K.at("z_um");
  const auto& down = work.model.guideways.at(0).rows_um_per_K.at("z_um");
  REQUIRE(up.size() == 3);
  CHECK(up[0][0] < up[1][0]);
  CHECK(up[1][0] < up[2][0]);
  for (std::size_t i = 0; i < 3; ++i) CHECK(near(up[i][0], -down[i][0], 1e-12));
  // Between two positions the row equals that of a point there.
  CHECK(tool.model.guideways[0].positions_mm == std::vector<double>{0, 100, 200});
  const ThermalModel again = parse_model(write_model(tool.model), "model.toml");
  CHECK(again.matrix_um_per_K == tool.model.matrix_um_per_K);
  CHECK(again.guideways[0].rows_um_per_K == tool.model.guideways[0].rows_um_per_K);
}

TEST_CASE("a guideway adds nothing at the meshes' axis position, elsewhere the difference",
          "[structure][model]") {
  const std::string rail =
      "[[guideway]]\nname = \"rail\"\naxis = \"z_mm\"\npart = \"column\"\n"
      "from_mm = [0, 50, 100]\nto_mm = [0, 50, 300]\npositions_mm = [0, 100, 200]\n"
      "carries = \"tool\"\noutputs = { z_um = \"z\" }\n";
  const std::string machine = material + column + foot + all_warm + top + rail;
  const auto rows_of = [](const Result& result) {
    return result.model.guideways.at(0).rows_um_per_K.at("z_um");
  };
  const auto whole = rows_of(matrix_of(machine));
  const auto drawn = rows_of(matrix_of(machine + "drawn_at_mm = 100\n"));
  for (std::size_t i = 0; i < 3; ++i) CHECK(near(drawn[i][0], whole[i][0] - whole[1][0], 1e-9));
}

TEST_CASE("tool and work: a common displacement cancels", "[structure][model]") {
  const std::string both =
      "[[output]]\nname = \"z_um\"\ndirection = \"z\"\n"
      "tool = { part = \"column\", at_mm = [50, 50, 400] }\n"
      "work = { part = \"column\", at_mm = [50, 50, 400] }\n"
      "[[output]]\nname = \"b_urad\"\ndirection = \"x\"\n"
      "tool = { part = \"column\", from_mm = [50, 50, 200], to_mm = [50, 50, 400] }\n";
  const std::string blocks =
      "[[block]]\nname = \"left_degC\"\non = { x_mm = [0, 20] }\n"
      "[[block]]\nname = \"right_degC\"\non = { x_mm = [80, 100] }\n"
      "[[block]]\nname = \"rest_degC\"\nrest = true\n";
  const auto rows = matrix_of(material + column + foot + blocks + both).model.matrix_um_per_K;
  for (const double value : rows[0]) CHECK(near(value, 0.0, 1e-12));
  CHECK(rows[1][0] > 0.1);                     // warm on the left: leans to the right
  CHECK(near(rows[1][0], -rows[1][1], 1e-9));  // and the other way round
  CHECK(near(rows[1][2], 0.0, 1e-9));          // a uniform rise does not tilt
}

TEST_CASE("a column on stiff springs behaves as on a fixed support", "[structure][model]") {
  const std::string springs =
      "[[spring]]\non = { z_mm = [0, 0] }\nstiffness_N_per_um = [1e6, 1e6, 1e6]\n";
  const double sprung =
      matrix_of(material + column + springs + all_warm + top).model.matrix_um_per_K[0][0];
  const double held =
      matrix_of(material + column + foot + all_warm + top).model.matrix_um_per_K[0][0];
  CHECK(near(sprung, held, 0.02 * held));
}

TEST_CASE("problems of a structure are named with their place", "[structure][bad_input]") {
  const auto with = [](const std::string& more) {
    return material + column + foot + all_warm + top + more;
  };
  CHECK(problems_in(with("")).empty());
  struct Case {
    std::string text;
    std::string message;
  };
  const std::string support = "[[support]]\non = ";
  const std::vector<Case> listed{
      {with(support + "{ group = \"base\" }\n"), "there is no group \"base\" in the mesh"},
      {with(support + "{ z_mm = [500, 600] }\n"), "the region contains no node of the mesh"},
      {with(support + "{ part = \"colum\" }\n"), "did you mean \"column\"?"},
      {with(support + "{ z_mm = [2, 1] }\n"), "must be a range"},
      {with(support + "{ z_mm = [nan, 1] }\n"), "must be a finite number"},
      {with("[[spring]]\non = { z_mm = [10, 20] }\nstiffness_N_per_um = [1, 1, 1]\n"),
       "the region contains no face of the mesh's surface"},
      {with("[[block]]\nname = \"t2_degC\"\non = { x_mm = [900, 901] }\n"),
       "the region contains no node of the mesh"},
      {with("[[block]]\nname = \"t1_degC\"\non = { x_mm = [0, 1] }\n"), "is used twice"},
      {with("[[block]]\nname = \"t2\"\non = { x_mm = [0, 1] }\n"), "must be a temperature"},
      {with("[[block]]\nname = \"t2_degC\"\nrest = true\n"), "has no nodes"},
      {with("unknown = 1\n"), "unknown key"},
      {with("[[output]]\nname = \"y_um\"\ndirection = \"y\"\n"
            "tool = { part = \"column\", at_mm = [50, 50, 500] }\n"),
       "[50, 50, 500] mm is outside part column"},
      {with("[[output]]\nname = \"y_um\"\ndirection = \"y\"\n"), "must have tool or work"},
      {with("[[output]]\nname = \"y_um\"\ndirection = [0, 0, 0]\n"
            "tool = { part = \"column\", at_mm = [50, 50, 400] }\n"),
       "or a vector"},
      {with("[[joint]]\nname = \"j\"\nfrom = { part = \"column\", z_mm = [0, 0] }\n"
            "to = { part = \"column\", z_mm = [400, 400] }\n"),
       "further apart than gap_mm everywhere"},
      {material + column + all_warm + top, "part column is not restrained against moving along x"},
      {material + column + foot + top, "there must be a [[block]] or a [[division]]"},
      {material + column + foot + top + "[[block]]\nname = \"a_degC\"\non = { z_mm = [0, 99] }\n",
       "nodes are in no block"},
      {material + foot + all_warm + top, "part = (missing)"},
      {material + column + "[[part]]\nname = \"lid\"\nmaterial = \"brass\"\nmesh = \"no.msh\"\n" +
           foot + all_warm + top,
       "there is no material of this name"},
      {material + column + "[[part]]\nname = \"lid\"\nmaterial = \"iron\"\nmesh = \"no.msh\"\n" +
           foot + all_warm + top,
       "no.msh: no such file"},
  };
  for (const auto& [text, message] : listed) {
    const auto lines = problems_in(text);
    std::string all;
    for (const std::string& line : lines) all += line + "\n";
    INFO(text.substr(material.size() + column.size()) << "\ntold:\n" << all);
    CHECK(mentions(lines, message));
    CHECK(all.find("machine.toml") == 0);
  }
}

TEST_CASE("all problems of a kind are reported at once", "[structure][bad_input]") {
  const auto lines =
      problems_in(material + column + foot + all_warm + top +
                  "[[support]]\non = { group = \"base\" }\n[[support]]\non = { group = \"side\" }\n"
                  "[[output]]\nname = \"y_um\"\ndirection = \"y\"\n"
                  "tool = { part = \"column\", at_mm = [50, 50, 500] }\n");
  CHECK(lines.size() == 3);
  CHECK(mentions(lines, "support[2].on = group base"));
  CHECK(mentions(lines, "support[3].on = group side"));
  CHECK(mentions(lines, "output[y_um].tool"));
}

TEST_CASE("the picture has a panel for the blocks and one per shape, the VTU file all arrays",
          "[structure][picture]") {
  const Result result = matrix_of(material + column + foot + all_warm + top);
  const Structure& s = result.structure;
  const std::vector<BlockShape> shapes{
      {"a<b_degC", std::vector<double>(3 * s.mesh.nodes_m.size(), 1e-6)}};
  const std::string svg = svg_picture(s, shapes);
  CHECK(svg.find("<svg ") == 0);
  CHECK(svg.find("1 blocks") != std::string::npos);
  CHECK(svg.find("a&lt;b_degC") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
  const std::string vtu = vtu_file(s, values_of(shapes));
  CHECK(vtu.find("NumberOfPoints=\"" + std::to_string(s.mesh.nodes_m.size()) + "\"") !=
        std::string::npos);
  CHECK(vtu.find("a&lt;b_degC_um_per_K") != std::string::npos);
}

TEST_CASE("the commented example can be computed", "[structure][model]") {
  const StructureSpec spec =
      load_structure(std::filesystem::path(THERMOCOMP_EXAMPLES) / "structure.toml");
  const Structure s = build_structure(spec, [](std::string_view) {});
  const Statics statics(s.mesh, s.material_of_part, s.reduction, s.springs);
  const ThermalModel model = block_model(spec, s, statics.sensitivities(s.rows));
  CHECK(model.inputs.size() == 6);
  CHECK(model.guideways.at(0).rows_um_per_K.at("y_um").size() == 4);
  const std::string report = structure_report(s, statics, model);
  CHECK(report.find(" a_urad") != std::string::npos);
  CHECK(report.find("condition number of all rows: ") != std::string::npos);
  CHECK(std::count(report.begin(), report.end(), '\n') <= 15);
  CHECK(report.find("e-1") == std::string::npos);  // no rounding errors of 0
  CHECK(report.find("on guideway") == std::string::npos);
  const std::string all = structure_report(s, statics, model, true);
  CHECK(all.find("y_um on guideway") != std::string::npos);
}

TEST_CASE("inverted elements and invalid numbers are reported with the mesh file's numbers",
          "[structure][bad_input]") {
  std::string pattern = (std::filesystem::temp_directory_path() / "thermocomp_XXXXXX").string();
  REQUIRE(::mkdtemp(pattern.data()) != nullptr);
  const std::filesystem::path folder = pattern;
  const auto problems_with = [&](const std::string& fourth_z, const std::string& order) {
    std::ofstream(folder / "lid.inp")
        << "*NODE\n1, 0, 0, 0\n2, 10, 0, 0\n3, 0, 10, 0\n4, 0, 0, " << fourth_z
        << "\n*ELEMENT, TYPE=C3D4, ELSET=LID\n17, " << order << "\n";
    const std::string text = material +
                             "[[part]]\nname = \"lid\"\nmaterial = \"iron\"\nmesh = \"lid.inp\"\n"
                             "[[support]]\non = { part = \"lid\" }\n" +
                             all_warm +
                             "[[output]]\nname = \"z_um\"\ndirection = \"z\"\n"
                             "tool = { part = \"lid\", at_mm = [0, 0, 0] }\n";
    std::string all;
    try {
      static_cast<void>(build_structure(parse_structure(text, (folder / "machine.toml").string()),
                                        [](std::string_view) {}));
    } catch (const ConfigurationError& error) {
      all = error.what();
    }
    return all;
  };
  CHECK(problems_with("10", "1, 2, 3, 4").empty());
  const std::string inverted = problems_with("10", "1, 3, 2, 4");
  CAPTURE(inverted);
  CHECK(inverted.find("17") != std::string::npos);
  CHECK(inverted.find("lid") != std::string::npos);
  CHECK(inverted.find("inverted") != std::string::npos);
  CHECK(problems_with("0", "1, 2, 3, 4").find("17") != std::string::npos);  // flat
  CHECK(problems_with("inf", "1, 2, 3, 4").find("must be a finite number") != std::string::npos);
  std::filesystem::remove_all(folder);
}
