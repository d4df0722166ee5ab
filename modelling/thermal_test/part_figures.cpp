#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "config/run_forms/number_form.hpp"
#include "config/run_forms/text_table.hpp"
#include "config/text/problems.hpp"
#include "config/toml/file_limits.hpp"
#include "modelling/thermal_test/part_test.hpp"

namespace thermocomp::thermal_test {
namespace {

/// Student's t, 0.975, of 1, 2, ... degrees of freedom; beyond them that of the last.
constexpr std::array student{12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};

double student_t(std::size_t freedom) {
  return student[std::min(freedom, student.size()) - 1];
}

/// Deviations of a feature in a repeat.
struct Pair {
  std::optional<double> cold;
  std::optional<double> warm;
};
using Repeats = std::map<std::string, Pair>;
/// In the order of the sheet.
struct Feature {
  std::string name;
  std::vector<Repeats> axes;
};

class PartReader {
 public:
  explicit PartReader(const std::string& path)
      : path_(path),
        problems_(path),
        table_(read_text_table(read_text_file(path, run_bytes_max), nullptr, 0, problems_)) {
    problems_.throw_any();
    form_ = number_form(table_, nullptr, problems_);
    problems_.throw_any();
  }

  /// @param axes  out: letters of the columns that are there
  std::vector<Feature> read(std::vector<std::string>& axes) {
    const std::size_t repeat = column("repeat");
    const std::size_t state = column("state");
    const std::size_t feature = column("feature");
    std::vector<std::size_t> columns;
    for (const char axis : {'x', 'y', 'z'}) {
      const auto found =
          std::find(table_.header.begin(), table_.header.end(), std::string(1, axis) + "_um");
      if (found == table_.header.end()) continue;
      axes.emplace_back(1, static_cast<char>(axis - 'a' + 'A'));
      columns.push_back(static_cast<std::size_t>(found - table_.header.begin()));
    }
    if (axes.empty()) refuse(0, "x_um, y_um, z_um", "(missing)", "one of them must be a column");
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string word(table_.field(row, state));
      if (word != "cold" && word != "warm")
        refuse(table_.lines[row], "state", word, "must be cold or warm");
      Feature& known = feature_of(std::string(table_.field(row, feature)), axes.size());
      for (std::size_t i = 0; i < columns.size(); ++i) {
        const std::string_view field = table_.field(row, columns[i]);
        if (field.empty()) continue;
        const auto number = number_of(field, form_);
        const std::string& name = table_.header[columns[i]];
        if (!number) refuse(table_.lines[row], name, std::string(field), "must be a number");
        Pair& pair = known.axes[i][std::string(table_.field(row, repeat))];
        std::optional<double>& place = word == "warm" ? pair.warm : pair.cold;
        if (place)
          refuse(table_.lines[row], name, std::string(field),
                 "the feature has a value of this repeat and state already");
        place = *number;
      }
    }
    return std::move(features_);
  }

 private:
  [[noreturn]] void refuse(int line, const std::string& key, const std::string& value,
                           const std::string& rule) const {
    throw ConfigurationError({Problem{path_, line, key, value, rule}});
  }

  std::size_t column(const std::string& name) const {
    const auto found = std::find(table_.header.begin(), table_.header.end(), name);
    if (found == table_.header.end())
      refuse(table_.header_line, name, "(missing)",
             "must be a column; thermal-test plan --test part writes the sheet");
    return static_cast<std::size_t>(found - table_.header.begin());
  }

  Feature& feature_of(const std::string& name, std::size_t axes) {
    const auto found = std::find_if(features_.begin(), features_.end(),
                                    [&](const Feature& each) { return each.name == name; });
    if (found != features_.end()) return *found;
    return features_.emplace_back(Feature{name, std::vector<Repeats>(axes)});
  }

  const std::string& path_;
  ProblemList problems_;
  TextTable table_;
  NumberForm form_;
  std::vector<Feature> features_;
};

struct Differences {
  double mean{0.0};
  double squares{0.0};  ///< sum of squared distances from the mean
  std::size_t count{0};
};

Differences differences_of(const Repeats& repeats) {
  std::vector<double> values;
  for (const auto& [repeat, pair] : repeats)
    if (pair.cold && pair.warm) values.push_back(*pair.warm - *pair.cold);
  Differences result{0.0, 0.0, values.size()};
  for (const double value : values) result.mean += value / static_cast<double>(values.size());
  for (const double value : values) result.squares += std::pow(value - result.mean, 2);
  return result;
}

}  // namespace

PartFigures part_figures(const std::string& path) {
  PartFigures figures{path, {}, {}};
  std::vector<std::string> axes;
  const std::vector<Feature> features = PartReader(path).read(axes);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    std::vector<std::pair<std::string, Differences>> measured;
    PartAxis axis{axes[i], 0, 0.0, {}};
    double squares = 0.0;
    double freedom = 0.0;
    for (const Feature& feature : features) {
      const Differences each = differences_of(feature.axes[i]);
      if (each.count == 0) continue;
      axis.repeats = measured.empty() ? each.count : std::min(axis.repeats, each.count);
      squares += each.squares;
      freedom += static_cast<double>(each.count) - 1.0;
      measured.emplace_back(feature.name, each);
    }
    if (measured.empty()) continue;
    if (axis.repeats < 2)
      throw ConfigurationError({Problem{path, 0, axes[i], "1 repeat",
                                        "every feature is needed cold and warm at least twice, or "
                                        "nothing tells how sure it is"}});
    axis.repeat_sd_um = std::sqrt(squares / freedom);
    double sum = 0.0;
    double widest = 0.0;
    for (const auto& [name, each] : measured) {
      const double half = student_t(axis.repeats - 1) * axis.repeat_sd_um /
                          std::sqrt(static_cast<double>(each.count));
      figures.shifts.push_back({name, axes[i], {each.mean, each.mean - half, each.mean + half}});
      sum += each.mean * each.mean;
      widest = std::max(widest, half);
    }
    // Where each shift is wrong by no more than `widest`, so is their root mean square.
    const double rms = std::sqrt(sum / static_cast<double>(measured.size()));
    axis.rms_um = {rms, std::max(0.0, rms - widest), rms + widest};
    figures.axes.push_back(axis);
  }
  if (figures.axes.empty())
    throw ConfigurationError(
        {Problem{path, 0, "", "", "no feature has a value both cold and warm in one repeat"}});
  return figures;
}

}  // namespace thermocomp::thermal_test
