#include "modelling/diagnosis/network/machine_file.hpp"

#include <algorithm>
#include <functional>
#include <sstream>

#include <toml++/toml.h>

namespace thermocomp::diagnosis {
namespace {

bool has_value(const toml::table& table, const char* key, const std::string& value) {
  return table[key].value<std::string>() == value;
}

/// The first table of a kind in the root that meets the condition.
toml::table* entry(toml::table& root, const char* kind,
                   const std::function<bool(const toml::table&)>& is) {
  toml::array* const all = root[kind].as_array();
  for (std::size_t i = 0; all != nullptr && i < all->size(); ++i)
    if (toml::table* const table = all->get(i)->as_table(); table != nullptr && is(*table))
      return table;
  return nullptr;
}

toml::table* named(toml::table& root, const char* kind, const std::string& name) {
  return entry(root, kind,
               [&](const toml::table& table) { return has_value(table, "name", name); });
}

bool multiply(toml::table* table, const char* key, double factor) {
  if (table == nullptr) return false;
  table->insert_or_assign(key, factor * (*table)[key].value_or(0.0));
  return true;
}

void append(toml::table& root, const char* kind, const toml::table& table) {
  if (root[kind].as_array() == nullptr) root.insert_or_assign(kind, toml::array{});
  root[kind].as_array()->push_back(table);
}

bool joins(const toml::table& link, const TwoNames& nodes) {
  const toml::array* const ends = link["between"].as_array();
  if (ends == nullptr || ends->size() != 2) return false;
  const auto first = ends->get(0)->value_or(std::string());
  const auto second = ends->get(1)->value_or(std::string());
  return std::min(first, second) == nodes.first && std::max(first, second) == nodes.second;
}

}  // namespace

TwoNames two_names(const std::string& subject) {
  const std::size_t bar = subject.find('|');
  if (bar == std::string::npos) return {subject, ""};
  return {subject.substr(0, bar), subject.substr(bar + 1)};
}

struct MachineFile::Tables {
  toml::table root;
};

MachineFile::MachineFile(const std::filesystem::path& path)
    : tables_(std::make_unique<Tables>(Tables{toml::parse_file(path.string())})) {}

MachineFile::~MachineFile() = default;

bool MachineFile::is_body() const {
  return tables_->root["plant"]["body"].value_or(std::string()) != "";
}

bool MachineFile::multiply_in_node(const std::string& node, const char* key, double factor) {
  return multiply(named(tables_->root, "node", node), key, factor);
}

bool MachineFile::multiply_in_link(const TwoNames& nodes, const char* key, double factor) {
  return multiply(
      entry(tables_->root, "link", [&](const toml::table& table) { return joins(table, nodes); }),
      key, factor);
}

bool MachineFile::multiply_in_source(const TwoNames& source, const char* key, double factor) {
  const auto is = [&](const toml::table& table) {
    return has_value(table, "signal", source.first) && has_value(table, "node", source.second);
  };
  return multiply(entry(tables_->root, "source", is), key, factor);
}

bool MachineFile::add_to_thermocouple(const std::string& name, const char* key, double more) {
  toml::table* const thermocouple = named(tables_->root, "thermocouple", name);
  if (thermocouple == nullptr) return false;
  thermocouple->insert_or_assign(key, (*thermocouple)[key].value_or(0.0) + more);
  return true;
}

void MachineFile::add_source(const TwoNames& source, double heat_W, double at, double exponent) {
  toml::table& root = tables_->root;
  append(root, "source",
         toml::table{{"node", source.second},
                     {"signal", source.first},
                     {"heat_W", heat_W},
                     {"at", at},
                     {"exponent", exponent}});
  if (named(root, "signal", source.first) == nullptr)
    append(root, "signal",
           toml::table{{"name", source.first},
                       {"kind", "steps"},
                       {"times_s", toml::array{0.0}},
                       {"values", toml::array{0.0}}});
}

std::string MachineFile::text() const {
  std::ostringstream text;
  text << tables_->root;
  return text.str();
}

}  // namespace thermocomp::diagnosis
