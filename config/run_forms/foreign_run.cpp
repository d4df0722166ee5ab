#include "config/run_forms/foreign_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "config/run_forms/number_form.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_table.hpp"
#include "config/run_forms/time_column.hpp"
#include "config/text/number_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

constexpr auto missing_words = std::to_array<std::string_view>(
    {"NA", "N/A", "n/a", "#N/A", "#NV", "null", "NULL", "-", "--", "---"});

/// What a column of the file becomes.
struct Meaning {
  std::size_t source{0};
  std::string name;
  UnitConversion conversion;
};

/// A name to write for a column without unit; the one who knows the column corrects it.
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

std::optional<double> switch_word(std::string_view field) {
  for (const std::string_view on : {"on", "ON", "On", "true", "TRUE", "True"})
    if (field == on) return 1.0;
  for (const std::string_view off : {"off", "OFF", "Off", "false", "FALSE", "False"})
    if (field == off) return 0.0;
  return std::nullopt;
}

class ForeignReader {
 public:
  ForeignReader(std::string_view text, const std::string& name, const ColumnMap* map)
      : problems_(name), map_(map), table_(read_text_table(text, map, problems_)) {
    run_.name = name;
  }

  std::optional<WallZero> read_wall_zero() {
    problems_.throw_any();
    read_units();
    form_ = number_form(table_, map_, problems_);
    const auto time = find_time(table_, map_, units_, problems_);
    problems_.throw_any();
    const RunTime run_time = read_time(table_, *time, map_, units_, form_, problems_);
    problems_.throw_any();
    return run_time.wall_zero;
  }

  RunFile read() {
    problems_.throw_any();
    read_units();
    form_ = number_form(table_, map_, problems_);
    say_layout();
    const auto time = find_time(table_, map_, units_, problems_);
    if (time) find_meanings(*time);
    problems_.throw_any();
    RunTime run_time = read_time(table_, *time, map_, units_, form_, problems_);
    problems_.throw_any();
    run_.understood.insert(run_.understood.begin() + 1, run_time.said);
    run_.columns.insert(run_.columns.begin(), "time_s");
    run_.values.insert(run_.values.begin(), std::move(run_time.time_s));
    for (const Meaning& meaning : meanings_) read_values(meaning);
    problems_.throw_any();
    if (missing_ > 0)
      run_.understood.push_back("missing: " + std::to_string(missing_) + " fields like '" +
                                missing_as_ + "'");
    return std::move(run_);
  }

 private:
  /// From the header, or from a row of nothing but units under it.
  void read_units() {
    for (const std::string& header : table_.header) units_.push_back(spelled_name(header).unit);
    if (table_.rows() < 2) return;
    std::vector<std::string> below;
    std::size_t known = 0;
    for (std::size_t i = 0; i < table_.columns(); ++i) {
      std::string_view field = table_.field(0, i);
      if (finite_number(field)) return;
      if (field.size() > 2 && (field.front() == '[' || field.front() == '('))
        field = trimmed(field.substr(1, field.size() - 2));
      if (spelled_unit(field) != nullptr && field != "-") ++known;
      below.emplace_back(field);
    }
    if (2 * known <= table_.columns()) return;
    for (std::size_t i = 0; i < below.size(); ++i)
      if (units_[i].empty()) units_[i] = below[i];
    units_below_ = true;
    table_.lines.erase(table_.lines.begin());
    table_.fields.erase(table_.fields.begin(),
                        table_.fields.begin() + static_cast<std::ptrdiff_t>(table_.columns()));
  }

  void say_layout() {
    std::string said = "separator '" + separator_name(table_.separator) + "', decimal " +
                       (form_.decimal == ',' ? "comma" : "point");
    if (form_.thousands != '\0') said += std::string(", thousands '") + form_.thousands + "'";
    if (table_.from_latin1) said += ", letters Latin-1";
    if (units_below_) said += ", units in the row under the header";
    run_.understood.push_back(said);
  }

  [[nodiscard]] bool is_ignored(const std::string& header) const {
    return map_ != nullptr &&
           std::find(map_->ignored.begin(), map_->ignored.end(), header) != map_->ignored.end();
  }

  void find_meanings(const TimeColumns& time) {
    check_map();
    std::set<std::string> seen{"time_s"};
    for (std::size_t i = 0; i < table_.columns(); ++i) {
      const std::string& header = table_.header[i];
      if (time.has(i)) continue;
      if (is_ignored(header)) {
        run_.understood.push_back("'" + header + "' left out");
        continue;
      }
      const auto meaning = meaning_of(i);
      if (!meaning) continue;
      if (!seen.insert(meaning->name).second) {
        refuse(i, "becomes " + meaning->name + ", which is there twice: write " +
                      toml_text(header) +
                      " = \"another name\" under [columns] in the file of --columns");
        continue;
      }
      say(i, *meaning);
      run_.columns.push_back(meaning->name);
      meanings_.push_back(*meaning);
    }
  }

  void check_map() {
    if (map_ == nullptr) return;
    const auto check = [&](const std::string& key, const std::string& header) {
      const auto count = std::count(table_.header.begin(), table_.header.end(), header);
      if (count == 1) return;
      std::string rule = count > 1 ? "stands twice in " : "is no column of ";
      rule += run_.name;
      std::string near = nearest_name(header, table_.header);
      for (const std::string& each : table_.header)
        if (spelled_name(each).base == header) near = each;  // all but the unit
      if (count == 0 && !near.empty()) rule += "; '" + near + "' is";
      problems_.add({map_->file, 0, key, header, rule});
    };
    for (const auto& [header, column] : map_->columns) check("columns", header);
    for (const std::string& header : map_->ignored) check("ignore", header);
  }

  std::optional<Meaning> meaning_of(std::size_t i) {
    const std::string& header = table_.header[i];
    if (header.empty()) {
      refuse(i, "has no name");
      return std::nullopt;
    }
    SpelledName spelled = spelled_name(header);
    if (spelled.unit.empty() && !units_[i].empty()) {
      spelled.unit = units_[i];
      spelled.known = spelled_unit(units_[i]);
    }
    if (map_ != nullptr) {
      const auto mapped = map_->columns.find(header);
      if (mapped != map_->columns.end()) return mapped_meaning(i, mapped->second, spelled);
    }
    if (spelled.unit.empty() && !unit_of(header).suffix.empty() && is_column_name(header))
      return Meaning{i, header, {}};
    if (spelled.known == nullptr || spelled.known->dimension == "time") {
      const std::string example = spelled.unit.empty()
                                      ? example_name(spelled.base)
                                      : plain_name(spelled.base + "_" + spelled.unit);
      refuse(i,
             (spelled.unit.empty() ? std::string("has no unit")
                                   : "has a unit that is not known here, " + spelled.unit) +
                 ": write " + toml_text(header) + " = " + toml_text(example) +
                 " (or what it is; without a unit it is a signal) under [columns], or ignore = [" +
                 toml_text(header) + "], in the file of --columns");
      return std::nullopt;
    }
    Meaning meaning{i, own_name(spelled), {}};
    const bool own_unit = unit_of(meaning.name).suffix == spelled.known->suffix;
    if (plain_name(spelled.base).empty() || !own_unit || !is_plain(meaning.name)) {
      refuse(i, "is no name that says what it is: write " + toml_text(header) +
                    " = \"its name\" under [columns] in the file of --columns");
      return std::nullopt;
    }
    meaning.conversion = conversion(*spelled.known, meaning.name).value_or(UnitConversion{});
    return meaning;
  }

  /// A name that reads as itself in a file of our own form.
  static bool is_plain(const std::string& name) {
    return is_column_name(name) && spelled_name(name).known == nullptr && name != "time_s";
  }

  std::optional<Meaning> mapped_meaning(std::size_t i, const MappedColumn& mapped,
                                        const SpelledName& spelled) {
    Meaning meaning{i, mapped.name, {}};
    const SpelledUnit* unit = mapped.unit.empty() ? spelled.known : spelled_unit(mapped.unit);
    if (!is_plain(mapped.name)) {
      problems_.add({map_->file, 0, "columns", mapped.name, std::string(column_name_rule)});
      return std::nullopt;
    }
    if (unit == nullptr) return meaning;
    const auto converted = conversion(*unit, mapped.name);
    if (!converted) {
      problems_.add({map_->file, 0, "columns", mapped.name,
                     "cannot be made from '" + table_.header[i] + "', which is in " +
                         std::string(unit->spelling)});
      return std::nullopt;
    }
    meaning.conversion = *converted;
    return meaning;
  }

  void say(std::size_t i, const Meaning& meaning) {
    std::string said = "'" + table_.header[i] + "' is " + meaning.name;
    if (unit_of(meaning.name).suffix.empty()) said += ", a signal without unit";
    if (meaning.conversion.factor != 1.0)
      said += ", times " + number_text(meaning.conversion.factor);
    if (meaning.conversion.offset != 0.0)
      said += ", plus " + number_text(meaning.conversion.offset);
    const bool from_mm = kind_of(meaning.name) == QuantityKind::position;
    if (from_mm && meaning.name != table_.header[i])
      said += ", a position (a displacement: write " + toml_text(table_.header[i]) + " = " +
              toml_text(meaning.name.substr(0, meaning.name.size() - 2) + "um") +
              " under [columns] in the file of --columns)";
    run_.understood.push_back(said);
  }

  void read_values(const Meaning& meaning) {
    const bool is_switch = unit_of(meaning.name).suffix == "_on";
    std::vector<double> values;
    values.reserve(table_.rows());
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string_view field = table_.field(row, meaning.source);
      std::optional<double> number = number_of(field, form_);
      if (!number && is_switch) number = switch_word(field);
      if (!number && !takes_as_missing(field)) {
        const std::string& header = table_.header[meaning.source];
        problems_.add(table_.lines[row], header, field,
                      "must be a number with a decimal " +
                          std::string(form_.decimal == ',' ? "comma" : "point") +
                          ", or empty; a column of text is left out by ignore = [" +
                          toml_text(header) + "] in the file of --columns");
      }
      double value = number.value_or(std::numeric_limits<double>::quiet_NaN());
      if (!meaning.conversion.is_identity())
        value = meaning.conversion.factor * value + meaning.conversion.offset;
      if (std::isinf(value)) value = std::numeric_limits<double>::quiet_NaN();
      values.push_back(value);
    }
    run_.values.push_back(std::move(values));
  }

  bool takes_as_missing(std::string_view field) {
    if (is_missing(field)) return true;
    if (std::find(missing_words.begin(), missing_words.end(), field) == missing_words.end())
      return false;
    if (missing_++ == 0) missing_as_ = field;
    return true;
  }

  void refuse(std::size_t column, std::string rule) {
    const std::string& header = table_.header[column];
    problems_.add(table_.header_line, "column " + std::to_string(column + 1),
                  header.empty() ? "(empty)" : header, std::move(rule));
  }

  ProblemList problems_;
  const ColumnMap* map_;
  TextTable table_;
  RunFile run_;
  std::vector<std::string> units_;  ///< as written, by column
  bool units_below_{false};
  NumberForm form_;
  std::vector<Meaning> meanings_;
  std::size_t missing_{0};
  std::string missing_as_;
};

}  // namespace

bool is_own_form(std::string_view header) {
  bool has_time = false;
  std::string_view field;
  while (take(header, ',', field)) {
    field = trimmed(field);
    has_time = has_time || field == "time_s";
    if (spelled_name(field).known != nullptr) return false;
  }
  return has_time;
}

RunFile read_foreign_run(std::string_view text, const std::string& name, const ColumnMap* map) {
  return ForeignReader(text, name, map).read();
}

std::optional<WallZero> wall_zero(std::string_view text, const std::string& name,
                                  const ColumnMap* map) {
  return ForeignReader(text, name, map).read_wall_zero();
}

}  // namespace thermocomp
