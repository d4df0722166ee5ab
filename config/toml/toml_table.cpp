// TomlTable: single values and nested tables.

#include <algorithm>
#include <string>

#include "config/text/printable_text.hpp"
#include "config/toml/toml_node.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {

using detail::as_node;
using detail::as_table;
using detail::at_position;
using detail::harmless;
using detail::integer_in;
using detail::line_of;
using detail::number_in;
using detail::shortened;
using detail::shown;

namespace {

const toml::key* find_key(const toml::table& table, std::string_view name) {
  const auto found = table.find(name);
  return found == table.cend() ? nullptr : &found->first;
}

}  // namespace

TomlTable::TomlTable(std::shared_ptr<detail::TomlState> state, const void* node, std::string path,
                     int line, bool silent)
    : state_(std::move(state)), node_(node), path_(std::move(path)), line_(line), silent_(silent) {
  if (node_ != nullptr) state_->opened[as_table(node_)].path = path_;
}

TomlTable TomlTable::over(const TomlTable& base) const {
  TomlTable layered = *this;
  layered.base_ = std::make_shared<const TomlTable>(base_ ? base_->over(base) : base);
  return layered;
}

const void* TomlTable::find_own(std::string_view key) const {
  if (node_ == nullptr) return nullptr;
  state_->opened[as_table(node_)].asked.emplace(key);
  return as_table(node_)->get(key);
}

const void* TomlTable::find(std::string_view key) const {
  const void* own = find_own(key);
  const void* below = base_ ? base_->find(key) : nullptr;  // marked there even if hidden
  return own != nullptr ? own : below;
}

const TomlTable& TomlTable::owner(std::string_view key) const {
  if (!base_ || find_own(key) != nullptr) return *this;
  return base_->find(key) != nullptr ? base_->owner(key) : *this;
}

std::string TomlTable::full(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

int TomlTable::line(std::string_view key) const {
  if (const TomlTable& table = owner(key); &table != this) return table.line(key);
  if (node_ == nullptr) return line_;
  const toml::key* found = find_key(*as_table(node_), key);
  if (found == nullptr) return line_;
  const int line = line_of(found->source());
  return line > 0 ? line : line_;
}

void TomlTable::problem(std::string_view key, std::string_view rule) const {
  if (const TomlTable& table = owner(key); &table != this) return table.problem(key, rule);
  if (silent_) return;
  const void* node = find(key);
  state_->add(line(key), full(key), node == nullptr ? "(missing)" : shown(*as_node(node)), rule);
}

void TomlTable::problem(std::string_view key, std::string_view value, std::string_view rule) const {
  if (const TomlTable& table = owner(key); &table != this) return table.problem(key, value, rule);
  if (silent_) return;
  static_cast<void>(find(key));
  state_->add(line(key), full(key), value.empty() ? "\"\"" : shortened(std::string(value)), rule);
}

void TomlTable::missing(std::string_view key) const {
  problem(key, "must be given");
}

void TomlTable::refuse(std::string_view key, std::string_view rule) const {
  if (has(key)) problem(key, rule);
}

void TomlTable::ignore_rest() const {
  if (base_) base_->ignore_rest();
  if (node_ != nullptr) state_->opened[as_table(node_)].ignore_rest = true;
}

bool TomlTable::has(std::string_view key) const {
  return find(key) != nullptr;
}

bool TomlTable::is_text(std::string_view key) const {
  const void* node = find(key);
  return node != nullptr && as_node(node)->is_string();
}

bool TomlTable::is_list_of_numbers(std::string_view key) const {
  const auto* list = has(key) ? as_node(find(key))->as_array() : nullptr;
  return list != nullptr && !list->empty() && list->front().is_number();
}

bool TomlTable::is_table(std::string_view key) const {
  const void* node = find(key);
  return node != nullptr && as_node(node)->is_table();
}

std::vector<std::string> TomlTable::keys() const {
  std::vector<std::pair<std::pair<std::uint32_t, std::uint32_t>, std::string>> placed;
  if (node_ != nullptr) {
    for (const auto& [key, value] : *as_table(node_)) {
      const auto begin = key.source().begin;
      placed.push_back({{begin.line, begin.column}, std::string(key.str())});
    }
  }
  std::sort(placed.begin(), placed.end());
  std::vector<std::string> names;
  names.reserve(placed.size());
  for (auto& entry : placed) names.push_back(std::move(entry.second));
  return names;
}

double TomlTable::number(std::string_view key, Range range) const {
  if (!has(key)) missing(key);
  return number(key, range, harmless(range));
}

double TomlTable::number(std::string_view key, Range range, double otherwise) const {
  const void* node = find(key);
  if (node == nullptr) return otherwise;
  std::string rule;
  const auto value = number_in(*as_node(node), range, rule);
  if (!value) problem(key, rule);
  return value.value_or(otherwise);
}

std::int64_t TomlTable::integer_value(std::string_view key, std::int64_t low, std::int64_t high,
                                      std::optional<std::int64_t> otherwise) const {
  const void* node = find(key);
  if (node == nullptr) {
    if (!otherwise) missing(key);
    return otherwise.value_or(low);
  }
  std::string rule;
  const auto value = integer_in(*as_node(node), low, high, rule);
  if (!value) problem(key, rule);
  return value.value_or(otherwise.value_or(low));
}

std::string TomlTable::text(std::string_view key) const {
  if (!has(key)) missing(key);
  return text(key, "");
}

std::string TomlTable::text(std::string_view key, std::string_view otherwise) const {
  const void* node = find(key);
  if (node == nullptr) return std::string(otherwise);
  const auto* value = as_node(node)->as_string();
  if (value == nullptr || value->get().empty()) {
    problem(key, "must be a string that is not empty");
    return std::string(otherwise);
  }
  if (!is_printable(value->get())) {
    problem(key, printable_rule);
    return std::string(otherwise);
  }
  return value->get();
}

bool TomlTable::flag(std::string_view key) const {
  if (!has(key)) missing(key);
  return flag(key, false);
}

bool TomlTable::flag(std::string_view key, bool otherwise) const {
  const void* node = find(key);
  if (node == nullptr) return otherwise;
  const auto* value = as_node(node)->as_boolean();
  if (value == nullptr) problem(key, "must be true or false");
  return value == nullptr ? otherwise : value->get();
}

std::size_t TomlTable::choice_index(std::string_view key,
                                    const std::vector<std::string_view>& names,
                                    std::optional<std::size_t> otherwise) const {
  const void* node = find(key);
  if (node == nullptr) {
    if (!otherwise) missing(key);
    return otherwise.value_or(0);
  }
  if (const auto* value = as_node(node)->as_string()) {
    const auto found = std::find(names.begin(), names.end(), value->get());
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  }
  std::string rule = "must be one of";
  for (const std::string_view name : names) rule += " \"" + std::string(name) + '"';
  problem(key, rule);
  return otherwise.value_or(0);
}

TomlTable TomlTable::child(std::string_view key, const void* node, std::string path) const {
  const int own_line = line_of(as_node(node)->source());
  return {state_, as_node(node)->as_table(), std::move(path), own_line > 0 ? own_line : line(key),
          silent_};
}

TomlTable TomlTable::silent_child(std::string_view key) const {
  return {state_, nullptr, full(key), line(key), true};
}

TomlTable TomlTable::table(std::string_view key) const {
  if (!has(key)) {
    missing(key);
    return silent_child(key);
  }
  return table_or_empty(key);
}

TomlTable TomlTable::table_or_empty(std::string_view key) const {
  if (const TomlTable& table = owner(key); &table != this) return table.table_or_empty(key);
  const void* node = find(key);
  if (node == nullptr) return {state_, nullptr, full(key), line_, silent_};
  if (!as_node(node)->is_table()) {
    problem(key, "must be a table");
    return silent_child(key);
  }
  return child(key, node, full(key));
}

std::vector<TomlTable> TomlTable::tables(std::string_view key) const {
  if (const TomlTable& table = owner(key); &table != this) return table.tables(key);
  std::vector<TomlTable> result;
  for_each_element(key, false, "tables", [&](const void* element, std::size_t position) {
    const toml::table* table = as_node(element)->as_table();
    if (table == nullptr) {
      problem(key, shown(*as_node(element)), at_position(position, "must be a table"));
      return;
    }
    std::string label = std::to_string(position);
    if (const auto name = (*table)["name"].value<std::string>()) label = shortened(*name);
    result.push_back(child(key, element, full(key) + "[" + label + "]"));
  });
  return result;
}

std::vector<TomlTable> TomlTable::tables_required(std::string_view key) const {
  std::vector<TomlTable> result = tables(key);
  if (!has(key)) {
    missing(key);
  } else if (result.empty()) {
    problem(key, "must have at least one entry");
  }
  return result;
}

using detail::as_node;
using detail::at_position;
using detail::harmless;
using detail::integer_in;
using detail::number_in;
using detail::shown;

void TomlTable::for_each_element(std::string_view key, bool required, std::string_view what,
                                 const std::function<void(const void*, std::size_t)>& each) const {
  const void* node = find(key);
  if (node == nullptr) {
    if (required) missing(key);
    return;
  }
  const toml::array* list = as_node(node)->as_array();
  if (list == nullptr) {
    problem(key, "must be a list of " + std::string(what));
    return;
  }
  std::size_t position = 0;
  for (const toml::node& element : *list) each(&element, ++position);
}

std::vector<double> TomlTable::numbers(std::string_view key, Range range) const {
  if (!has(key)) missing(key);
  return numbers(key, range, {});
}

std::vector<double> TomlTable::numbers(std::string_view key, Range range,
                                       std::vector<double> otherwise) const {
  if (!has(key)) return otherwise;
  std::vector<double> values;
  for_each_element(key, false, "numbers", [&](const void* element, std::size_t position) {
    std::string rule;
    const auto value = number_in(*as_node(element), range, rule);
    if (!value) problem(key, shown(*as_node(element)), at_position(position, rule));
    values.push_back(value.value_or(harmless(range)));
  });
  return values;
}

std::vector<std::int64_t> TomlTable::integers(std::string_view key, std::int64_t low,
                                              std::int64_t high) const {
  if (!has(key)) missing(key);
  return integers(key, low, high, {});
}

std::vector<std::int64_t> TomlTable::integers(std::string_view key, std::int64_t low,
                                              std::int64_t high,
                                              std::vector<std::int64_t> otherwise) const {
  if (!has(key)) return otherwise;
  std::vector<std::int64_t> values;
  for_each_element(key, false, "whole numbers", [&](const void* element, std::size_t position) {
    std::string rule;
    const auto value = integer_in(*as_node(element), low, high, rule);
    if (!value) problem(key, shown(*as_node(element)), at_position(position, rule));
    values.push_back(value.value_or(low));
  });
  return values;
}

std::vector<std::string> TomlTable::texts(std::string_view key) const {
  if (!has(key)) missing(key);
  return texts(key, {});
}

std::vector<std::string> TomlTable::texts(std::string_view key, std::vector<std::string> otherwise,
                                          bool takes_empty) const {
  if (!has(key)) return otherwise;
  std::vector<std::string> values;
  for_each_element(key, false, "strings", [&](const void* element, std::size_t position) {
    const auto* value = as_node(element)->as_string();
    const bool is_good = value != nullptr && is_printable(value->get());
    if (value == nullptr || (value->get().empty() && !takes_empty)) {
      problem(key, shown(*as_node(element)),
              at_position(position, "must be a string that is not empty"));
    } else if (!is_good) {
      problem(key, shown(*as_node(element)), at_position(position, printable_rule));
    }
    values.push_back(is_good ? value->get() : std::string());
  });
  return values;
}

std::vector<std::vector<double>> TomlTable::matrix(std::string_view key, std::size_t rows,
                                                   std::size_t columns) const {
  std::vector<std::vector<double>> values;
  bool good = true;
  const auto bad = [&](std::string_view value, const std::string& rule) {
    problem(key, value, rule);
    good = false;
  };
  for_each_element(key, true, "rows", [&](const void* element, std::size_t position) {
    const toml::array* row = as_node(element)->as_array();
    if (row == nullptr) {
      bad(shown(*as_node(element)), at_position(position, "must be an array of numbers"));
      return;
    }
    std::vector<double>& numbers = values.emplace_back();
    for (const toml::node& cell : *row) {
      std::string rule;
      const auto number = number_in(cell, Range::any(), rule);
      const std::size_t column = numbers.size() + 1;
      if (!number) {
        bad(shown(cell),
            "row " + std::to_string(position) + " column " + std::to_string(column) + " " + rule);
      }
      numbers.push_back(number.value_or(0.0));
    }
    if (numbers.size() != columns) {
      bad(std::to_string(numbers.size()) + " columns",
          "row " + std::to_string(position) + " must have " + std::to_string(columns));
    }
  });
  if (good && has(key) && values.size() != rows) {
    bad(std::to_string(values.size()) + " rows", "must have " + std::to_string(rows));
  }
  if (!good) values.clear();
  return values;
}

}  // namespace thermocomp
