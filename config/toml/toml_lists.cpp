// The lists of a table. Each bad element is a problem of its own.
#include <string>

#include "config/text/printable_text.hpp"
#include "config/toml/toml_node.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {

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
      bad(shown(*as_node(element)), at_position(position, "must be a row of numbers"));
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
