#include <algorithm>
#include <cmath>
#include <functional>

#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"
#include "simulator/plant/reduced_body.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t states_max = 400;

const Names<BodyPartKind> part_kinds = {{"room_film", BodyPartKind::room_film},
                                        {"coolant_film", BodyPartKind::coolant_film},
                                        {"joint", BodyPartKind::joint},
                                        {"capacity", BodyPartKind::capacity}};

std::vector<double> read_vector(const TomlTable& table, std::string_view key, std::size_t states) {
  std::vector<double> values = table.numbers(key);
  if (values.size() != states && table.has(key)) {
    table.problem(key, std::to_string(values.size()) + " numbers",
                  "must have one number per state");
  }
  values.resize(states, 0.0);
  return values;
}

std::vector<double> read_square(const TomlTable& table, std::string_view key, std::size_t states) {
  const auto rows = table.matrix(key, states, states);
  std::vector<double> values;
  for (const auto& row : rows) values.insert(values.end(), row.begin(), row.end());
  values.resize(states * states, 0.0);
  for (std::size_t i = 0; i < states; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (values[i * states + j] == values[j * states + i]) continue;
      table.problem(key, "row " + std::to_string(i + 1), "the matrix must be symmetric");
      return values;
    }
  }
  return values;
}

BodySource read_source(const TomlTable& table, std::size_t states) {
  BodySource source;
  source.name = table.text("name");
  source.heat_W = table.number("heat_W", Range::between(-1e6, 1e6));
  if (table.has("signal")) {
    source.signal = table.text("signal");
    source.at = table.number("at", Range::above(0.0, 1e9));
    source.exponent = table.number("exponent", Range::above(0.0, 5.0));
  }
  source.inflow = read_vector(table, "inflow", states);
  return source;
}

std::vector<BodyRow> read_rows(const TomlTable& root, std::string_view key, std::size_t states) {
  std::vector<BodyRow> rows;
  for (const TomlTable& table : root.tables_required(key)) {
    rows.push_back({table.text("name"), read_vector(table, "row", states)});
    const auto same = [&](const BodyRow& row) { return row.name == rows.back().name; };
    if (std::count_if(rows.begin(), rows.end(), same) > 1) table.problem("name", "is used twice");
    if (key == "output" && !is_output(rows.back().name)) {
      table.problem("name", "must end in _um or _urad");
    }
  }
  return rows;
}

BodyGuideway read_guideway(const TomlTable& table, const std::vector<BodyRow>& outputs,
                           std::size_t states) {
  BodyGuideway guideway;
  guideway.name = table.text("name");
  guideway.axis = table.text("axis");
  if (kind_of(guideway.axis) != QuantityKind::position) {
    table.problem("axis", "must be a position, a column *_mm");
  }
  guideway.output = table.text("output");
  const auto same = [&](const BodyRow& output) { return output.name == guideway.output; };
  if (std::none_of(outputs.begin(), outputs.end(), same)) {
    table.problem("output", "must be the name of an [[output]]");
  }
  std::vector<double>& at = guideway.positions_mm;
  at = table.numbers("positions_mm");
  if (at.size() < 2 ||
      std::adjacent_find(at.begin(), at.end(), std::greater_equal<>()) != at.end()) {
    table.problem("positions_mm", "must be two or more numbers, strictly increasing");
  }
  guideway.rows = table.matrix("rows", at.size(), states);
  return guideway;
}

BodyPart read_part(const TomlTable& table, std::size_t states) {
  BodyPart part;
  part.name = table.text("name");
  part.kind = table.choice<BodyPartKind>("kind", part_kinds);
  part.matrix = read_square(table, "matrix", states);
  const bool film = part.kind == BodyPartKind::room_film || part.kind == BodyPartKind::coolant_film;
  if (film)
    part.inflow = read_vector(table, "inflow", states);
  else
    table.refuse("inflow", "only a film has an inflow");
  return part;
}

ReducedBody read_body(const TomlDocument& document) {
  const TomlTable root = document.root();
  ReducedBody body;
  (void)root.integer("format", 1, 1);
  const auto states = root.integer<std::size_t>("states", 1, states_max);
  body.conductance = read_square(root, "conductance", states);
  body.coolant_conductance = read_square(root, "coolant_conductance", states);
  body.room_inflow = read_vector(root, "room_inflow", states);
  body.coolant_inflow = read_vector(root, "coolant_inflow", states);
  body.one_degC = read_vector(root, "one_degC", states);
  for (const TomlTable& table : root.tables("source")) {
    body.sources.push_back(read_source(table, states));
  }
  body.sensors = read_rows(root, "sensor", states);
  body.outputs = read_rows(root, "output", states);
  for (const TomlTable& table : root.tables("guideway")) {
    body.guideways.push_back(read_guideway(table, body.outputs, states));
  }
  for (const TomlTable& table : root.tables("part")) body.parts.push_back(read_part(table, states));
  document.finish();
  return body;
}

std::string number(double value) {
  std::string text = number_text(value);
  if (text.find_first_of(".e") == std::string::npos) text.append(".0");
  return text;
}

std::string list(const double* values, std::size_t count) {
  std::string text = "[";
  for (std::size_t i = 0; i < count; ++i) text.append(i == 0 ? "" : ", ").append(number(values[i]));
  return text.append("]");
}

void append(std::string& text, const char* key, const std::vector<double>& values) {
  text.append(key).append(" = ").append(list(values.data(), values.size())).append("\n");
}

void append_square(std::string& text, const char* key, const std::vector<double>& values,
                   std::size_t states) {
  text.append(key).append(" = [\n");
  for (std::size_t i = 0; i < states; ++i) {
    text.append("  ").append(list(&values[i * states], states)).append(",\n");
  }
  text.append("]\n");
}

void append_rows(std::string& text, const char* key, const std::vector<std::vector<double>>& rows) {
  text.append(key).append(" = [\n");
  for (const auto& row : rows) text.append("  ").append(list(row.data(), row.size())).append(",\n");
  text.append("]\n");
}

void append_text(std::string& text, const char* key, const std::string& value) {
  text.append(key).append(" = \"").append(value).append("\"\n");
}

}  // namespace

ReducedBody load_body(const std::filesystem::path& path) {
  return read_body(TomlDocument::from_file(path));
}

ReducedBody parse_body(std::string text, std::string name) {
  return read_body(TomlDocument::from_text(std::move(text), std::move(name)));
}

std::string write_body(const ReducedBody& body, const std::string& comment) {
  std::string text = comment;
  text.append("format = 1\nstates = ").append(std::to_string(body.states())).append("\n");
  append_square(text, "conductance", body.conductance, body.states());
  append_square(text, "coolant_conductance", body.coolant_conductance, body.states());
  append(text, "room_inflow", body.room_inflow);
  append(text, "coolant_inflow", body.coolant_inflow);
  append(text, "one_degC", body.one_degC);
  for (const BodySource& source : body.sources) {
    text.append("[[source]]\n");
    append_text(text, "name", source.name);
    text.append("heat_W = ").append(number(source.heat_W)).append("\n");
    if (source.signal) {
      append_text(text, "signal", *source.signal);
      text.append("at = ").append(number(source.at)).append("\n");
      text.append("exponent = ").append(number(source.exponent)).append("\n");
    }
    append(text, "inflow", source.inflow);
  }
  for (const auto& [rows, heading] :
       {std::pair{&body.sensors, "[[sensor]]\n"}, std::pair{&body.outputs, "[[output]]\n"}}) {
    for (const BodyRow& row : *rows) {
      text.append(heading);
      append_text(text, "name", row.name);
      append(text, "row", row.row);
    }
  }
  for (const BodyGuideway& guideway : body.guideways) {
    text.append("[[guideway]]\n");
    append_text(text, "name", guideway.name);
    append_text(text, "axis", guideway.axis);
    append_text(text, "output", guideway.output);
    append(text, "positions_mm", guideway.positions_mm);
    append_rows(text, "rows", guideway.rows);
  }
  for (const BodyPart& part : body.parts) {
    text.append("[[part]]\n");
    append_text(text, "name", part.name);
    for (const auto& [name, kind] : part_kinds)
      if (kind == part.kind) append_text(text, "kind", std::string(name));
    append_square(text, "matrix", part.matrix, body.states());
    if (!part.inflow.empty()) append(text, "inflow", part.inflow);
  }
  return text;
}

}  // namespace thermocomp
