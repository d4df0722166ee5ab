#include "report/body_page.hpp"

#include <cmath>
#include <filesystem>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

// Raw literals made by CMake.
constexpr const char* frame =
#include "report/body_page.html.literal"
    ;
constexpr const char* script =
#include "report/body_page.js.literal"
    ;

constexpr const char* library_folder = "/usr/share/javascript/three";

std::string library_text(const char* file) {
  try {
    return read_text_file(std::filesystem::path(library_folder) / file);
  } catch (const ConfigurationError& error) {
    throw std::runtime_error(std::string("the page needs the package libjs-three: ") +
                             error.what());
  }
}

double four_digits(double value) {
  if (value == 0.0 || !std::isfinite(value)) return value;
  const double step = std::pow(10.0, std::floor(std::log10(std::fabs(value))) - 3.0);
  return std::round(value / step) * step;
}

json numbers(const std::vector<double>& values) {
  json list = json::array();
  list.get_ref<json::array_t&>().reserve(values.size());
  for (const double value : values) list.push_back(static_cast<float>(four_digits(value)));
  return list;
}

json state_json(const BodyState& state) {
  return {{"group", state.group},
          {"name", state.name},
          {"time_s", state.time_s},
          {"input", state.input},
          {"rise_K", numbers(state.rise_K)},
          {"moved_um", numbers(state.moved_um)},
          {"outputs_um", numbers(state.outputs_um)}};
}

/// JSON text that cannot close an element <script>.
std::string script_text(const json& value) {
  std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1))
    text.replace(at, 1, "\\u003c");
  return text;
}

std::string script_element(const std::string& text) {
  return "<script>\n" + text + "\n</script>\n";
}

}  // namespace

std::string body_page(const BodyPicture& picture) {
  json data = {{"title", picture.title},
               {"note", picture.note},
               {"nodes_mm", numbers(picture.nodes_mm)},
               {"triangles", picture.triangles},
               {"outputs", picture.outputs},
               {"states", json::array()},
               {"points", json::array()}};
  for (const BodyState& state : picture.states) data["states"].push_back(state_json(state));
  for (const BodyPoint& point : picture.points)
    data["points"].push_back(
        {{"name", point.name}, {"is_sensor", point.is_sensor}, {"at_mm", point.at_mm}});
  std::string page =
      "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><title>";
  page.append(xml_text(picture.title)).append("</title>").append(frame);
  page += "<script id=\"body\" type=\"application/json\">" + script_text(data) + "</script>\n";
  page += script_element(library_text("three.min.js"));
  page += script_element(library_text("examples/js/controls/OrbitControls.js"));
  return page + script_element(script) + "</body></html>\n";
}

}  // namespace thermocomp
