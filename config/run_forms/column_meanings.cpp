#include "config/run_forms/column_meanings.hpp"

#include <algorithm>

#include "config/run_forms/field_text.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"

namespace thermocomp {
namespace {

/// Suggested name for a column without a unit; the user corrects it.
std::string example_name(std::string_view base) {
  std::string name = plain_name(base);
  if (name.empty()) return "t1_degC";
  const char first = name.front();
  if (first == 't' || first == 'T') return name + "_degC";
  if (first >= 'x' && first <= 'z') return name + "_um";
  return name + "_degC";
}

std::string own_name(const SpelledName& spelled) {
  return plain_name(spelled.base).append(spelled.known->suffix);
}

/// "ΔT", "dT bed-head", "Temp diff", "rise above ambient".
bool names_difference(const std::string& base) {
  if (base.starts_with("dT") || base.starts_with("DT")) return true;
  const std::string name = small_letters(base);
  for (const std::string_view word : {"Δ", "∆", "delta", "diff", "rise", "change", "minus"})
    if (name.find(word) != std::string::npos) return true;
  return false;
}

/// "0.1", "x10", "*0.1"
bool is_factor(std::string_view word) {
  const bool is_marked = word.starts_with('x') || word.starts_with('*');
  if (is_marked) word.remove_prefix(1);
  return finite_number(word) && (is_marked || word.find('.') != std::string_view::npos);
}

/// A name that keeps its meaning in a file of our own form.
bool is_plain(const std::string& name) {
  return is_column_name(name) && spelled_name(name).known == nullptr && name != "time_s";
}

}  // namespace

ColumnMeanings::ColumnMeanings(const TextTable& table, const ColumnMap* map,
                               const std::vector<std::string>& units, bool has_own_names,
                               ProblemList& problems, std::vector<std::string>& understood)
    : table_(table),
      map_(map),
      units_(units),
      has_own_names_(has_own_names),
      problems_(problems),
      understood_(understood) {}

std::optional<ColumnMeaning> ColumnMeanings::of(std::size_t i) const {
  const std::string& header = table_.header[i];
  SpelledName spelled = spelled_name(header);
  if (spelled.unit.empty() && !units_[i].empty()) {
    spelled.unit = units_[i];
    spelled.known = spelled_unit(units_[i]);
  }
  const bool is_mapped_with_unit = is_mapped(header) && !map_->columns.at(header).unit.empty();
  if (const std::string why = is_mapped_with_unit ? "" : unclear_unit(i, spelled); !why.empty()) {
    refuse(i, why);
    return std::nullopt;
  }
  const bool has_own = spelled_name(header).unit.empty() && has_own_unit(header);
  if (has_own && spelled.known != nullptr && spelled.known->dimension != "none" &&
      !is_mapped_with_unit) {
    const bool is_same =
        conversion(*spelled.known, header).value_or(UnitConversion{0}).is_identity();
    if (is_same && !is_mapped(header)) return ColumnMeaning{i, header, {}};
    if (!is_same)
      refuse(i, "names one unit, and its column is in " + spelled.unit + ": write " +
                    toml_text(header) + " = { name = " + toml_text(header) +
                    ", unit = " + toml_text(spelled.unit) +
                    " } under [columns] in the file of --columns, or the unit that is true");
    if (!is_same) return std::nullopt;
  }
  if (is_mapped(header)) return mapped(i, map_->columns.at(header), spelled);
  if (spelled.unit.empty() && !unit_of(header).suffix.empty() && is_column_name(header))
    return ColumnMeaning{i, header, {}};
  const bool is_named = map_ != nullptr && std::find(map_->names.begin(), map_->names.end(),
                                                     header) != map_->names.end();
  const bool takes_signal = spelled.unit.empty() && (has_own_names_ || is_named ||
                                                     (map_ != nullptr && map_->takes_signals));
  if (takes_signal && is_column_name(plain_name(header)))
    return ColumnMeaning{i, plain_name(header), {}};
  if (spelled.known == nullptr || spelled.known->dimension == "time") {
    const std::string example = spelled.unit.empty()
                                    ? example_name(spelled.base)
                                    : plain_name(spelled.base + "_" + spelled.unit);
    refuse(
        i,
        (spelled.unit.empty() ? std::string("has no unit")
                              : "has an unknown unit, " + spelled.unit) +
            ": write " + toml_text(header) + " = " + toml_text(example) +
            (spelled.unit.empty()
                 ? " (or what it is; without a unit it is a signal)"
                 : ", a signal, or { name = \"its name\", unit = " +
                       toml_text(unit_with_factor(spelled.unit) ? spelled.unit : "a known unit") +
                       " }") +
            " under [columns], or ignore = [" + toml_text(header) + "], in the file of --columns");
    return std::nullopt;
  }
  ColumnMeaning meaning{i, own_name(spelled), {}};
  const bool own_unit = unit_of(meaning.name).suffix == spelled.known->suffix;
  if (plain_name(spelled.base).empty() || !own_unit || !is_plain(meaning.name)) {
    refuse(i, "is not a descriptive name: write " + toml_text(header) +
                  " = \"its name\" under [columns] in the file of --columns");
    return std::nullopt;
  }
  meaning.conversion = conversion(*spelled.known, meaning.name).value_or(UnitConversion{});
  return meaning;
}

/// Why the unit of a column may be another than it seems; empty: it is clear.
std::string ColumnMeanings::unclear_unit(std::size_t i, const SpelledName& spelled) const {
  if (spelled.known == nullptr) return {};
  const auto ask = [&](const std::string& name, const std::string& unit,
                       const std::string& other = "what is true") {
    return ": write " + toml_text(table_.header[i]) + " = { name = " + toml_text(plain_name(name)) +
           ", unit = " + toml_text(unit) + " }, or " + other +
           ", under [columns] in the file of --columns";
  };
  if (spelled.known->suffix == "_degC" && spelled.known->offset != 0.0 &&
      names_difference(spelled.base))
    return "may be a difference of temperatures" +
           ask(spelled.base + "_K", "delta_degF", "unit = \"degF\" with a name in _degC");
  const std::string of_name = spelled_name(table_.header[i]).unit;
  const std::string in_row = table_.units.empty() ? "" : table_.units[i];
  const SpelledUnit* row = spelled_unit(in_row);
  if (!of_name.empty() && row != nullptr && row->dimension != "none" &&
      (row->factor != spelled.known->factor || row->offset != spelled.known->offset ||
       row->dimension != spelled.known->dimension))
    return "may be in " + of_name + ", as its name says, or in " + in_row +
           ", as the row of units says" + ask(spelled.base + std::string(row->suffix), in_row);
  const auto factor = spelled.base.find_last_of(" _") + 1;
  if (is_factor(std::string_view(spelled.base).substr(factor)))
    return "may be a multiple of its unit" +
           ask(std::string(trimmed(spelled.base.substr(0, factor))) +
                   std::string(spelled.known->suffix),
               "0.1 " + spelled.unit);
  const bool is_prefix = spelled.known->spelling == "K" || spelled.known->spelling == "m";
  if (of_name.empty() && in_row.empty() && is_prefix)
    return "has numbers with " + spelled.unit + ", which may be a unit or mean " +
           (spelled.unit == "K" ? "a thousand" : "a thousandth") +
           ask(spelled.base + std::string(spelled.known->suffix), spelled.unit);
  return {};
}

std::optional<ColumnMeaning> ColumnMeanings::mapped(std::size_t i, const MappedColumn& column,
                                                    const SpelledName& spelled) const {
  ColumnMeaning meaning{i, column.name, {}};
  const auto unit = column.unit.empty()
                        ? (spelled.known == nullptr ? std::nullopt : std::optional(*spelled.known))
                        : unit_with_factor(column.unit);
  if (!is_plain(column.name)) {
    problems_.add({map_->file, 0, "columns", column.name, std::string(column_name_rule)});
    return std::nullopt;
  }
  const bool has_brackets = !unit && !spelled.unit.empty();
  if (has_brackets && !unit_of(column.name).suffix.empty() && may_be_unit(spelled.unit)) {
    problems_.add({map_->file, 0, "columns", column.name,
                   "may not be the unit of '" + table_.header[i] +
                       "': write { name = " + toml_text(column.name) +
                       ", unit = \"that of the file\" }, such as degC, 0.1 degC or mil"});
    return std::nullopt;
  }
  if (has_brackets)
    understood_.push_back("in '" + table_.header[i] + "' '" + spelled.unit +
                          "' is taken for a part of the name, not for a unit");
  if (!unit) return meaning;
  const auto converted = conversion(*unit, column.name);
  if (!converted) {
    problems_.add({map_->file, 0, "columns", column.name,
                   "cannot be made from '" + table_.header[i] + "', which is in " +
                       std::string(unit->spelling)});
    return std::nullopt;
  }
  meaning.conversion = *converted;
  return meaning;
}

void ColumnMeanings::note(const ColumnMeaning& meaning) const {
  const std::size_t i = meaning.source;
  std::string note = "'" + table_.header[i] + "' is " + meaning.name;
  const bool has_unit = !unit_of(meaning.name).suffix.empty();
  if (!has_unit) note += ", a signal without unit";
  if (!has_unit && !is_mapped(table_.header[i]) && !has_own_names_ && map_ != nullptr &&
      map_->takes_signals && map_->names.empty())
    note += " (if it has one, write " + toml_text(table_.header[i]) + " = " +
            toml_text(example_name(spelled_name(table_.header[i]).base)) +
            ", or what it is, under [columns] in the file of --columns)";
  if (meaning.conversion.factor != 1.0) note += ", times " + number_text(meaning.conversion.factor);
  if (meaning.conversion.offset != 0.0) note += ", plus " + number_text(meaning.conversion.offset);
  const bool from_mm = kind_of(meaning.name) == QuantityKind::position;
  if (from_mm && meaning.name != table_.header[i])
    note += ", a position (a displacement: write " + toml_text(table_.header[i]) + " = " +
            toml_text(meaning.name.substr(0, meaning.name.size() - 2) + "um") +
            " under [columns] in the file of --columns)";
  understood_.push_back(note);
}

bool ColumnMeanings::is_mapped(const std::string& header) const {
  return map_ != nullptr && map_->columns.contains(header);
}

void ColumnMeanings::refuse(std::size_t column, std::string rule) const {
  refuse_column(table_, column, std::move(rule), problems_);
}

bool has_own_unit(const std::string& header) {
  return is_column_name(header) && !unit_of(header).suffix.empty();
}

void refuse_column(const TextTable& table, std::size_t column, std::string rule,
                   ProblemList& problems) {
  const std::string& header = table.header[column];
  problems.add(table.header_line, "column " + std::to_string(column + 1),
               header.empty() ? "(empty)" : header, std::move(rule));
}

}  // namespace thermocomp
