#include "modelling/thermal_test/part_test.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include <nlohmann/json.hpp>

#include "config/run_forms/number_form.hpp"
#include "config/run_forms/text_table.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/toml/toml_reader.hpp"
#include "modelling/thermal_test/test_report.hpp"
#include "report/html_page.hpp"
#include "report/svg_plot.hpp"

namespace thermocomp::thermal_test {

namespace {

/// 0.975 quantile of Student's t for 1, 2, ... degrees of freedom; the last one holds beyond.
constexpr std::array student{12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};

double student_t(std::size_t freedom) {
  return student[std::min(freedom, student.size()) - 1];
}

struct Pair {
  std::optional<double> cold;
  std::optional<double> warm;
};
using Repeats = std::map<std::string, Pair>;
/// A feature, in the order of the sheet.
struct Feature {
  std::string name;
  std::vector<Repeats> axes;
};

class PartReader {
 public:
  explicit PartReader(const std::string& path)
      : path_(path),
        problems_(path),
        table_(read_text_table({read_text_file(path, run_bytes_max), {}}, no_map_, problems_)) {
    problems_.throw_any();
    table_.form = number_form(table_);
    problems_.throw_any();
  }

  /// @param axes  out: letters of the columns found
  std::vector<Feature> read(std::vector<std::string>& axes) {
    const auto& repeats = column("repeat");
    const auto& states = column("state");
    const auto& features = column("feature");
    std::vector<std::size_t> columns;
    for (const char axis : {'x', 'y', 'z'}) {
      const std::size_t found = table_.find(std::string(1, axis) + "_um");
      if (found == table_.columns.size()) continue;
      axes.emplace_back(1, static_cast<char>(axis - 'a' + 'A'));
      columns.push_back(found);
    }
    if (axes.empty()) refuse(0, "x_um, y_um, z_um", "(missing)", "one of them must be a column");
    std::vector<std::vector<double>> values(columns.size());
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string word(states[row]);
      if (word != "cold" && word != "warm")
        refuse(table_.lines[row], "state", word, "must be cold or warm");
      Feature& known = feature_of(std::string(features[row]), axes.size());
      for (std::size_t i = 0; i < columns.size(); ++i) {
        const std::string_view field = table_.columns[columns[i]].fields[row];
        if (field.empty()) continue;
        const auto number = table_.number(field);
        const std::string& name = table_.columns[columns[i]].header;
        if (!number) refuse(table_.lines[row], name, std::string(field), "must be a number");
        Pair& pair = known.axes[i][std::string(repeats[row])];
        std::optional<double>& place = word == "warm" ? pair.warm : pair.cold;
        if (place)
          refuse(table_.lines[row], name, std::string(field),
                 "the feature already has a value for this repeat and state");
        place = *number;
        values[i].push_back(*number);
      }
    }
    for (std::size_t i = 0; i < columns.size(); ++i)
      if (values[i].size() > 2 && std::all_of(values[i].begin(), values[i].end(), [&](double each) {
            return each == values[i].front();
          }))
        refuse(0, table_.columns[columns[i]].header, number_text(values[i].front()),
               "is the value of every row: the gauge shows nothing; leave the column out");
    return std::move(features_);
  }

 private:
  [[noreturn]] void refuse(int line, const std::string& key, const std::string& value,
                           const std::string& rule) const {
    throw ConfigurationError({Problem{path_, line, key, value, rule}});
  }

  const std::vector<std::string_view>& column(const std::string& name) const {
    const std::size_t found = table_.find(name);
    if (found == table_.columns.size())
      refuse(table_.header_line, name, "(missing)",
             "must be a column; thermal-test plan --test part writes the sheet");
    return table_.columns[found].fields;
  }

  Feature& feature_of(const std::string& name, std::size_t axes) {
    const auto found = std::find_if(features_.begin(), features_.end(),
                                    [&](const Feature& each) { return each.name == name; });
    if (found != features_.end()) return *found;
    return features_.emplace_back(Feature{name, std::vector<Repeats>(axes)});
  }

  const std::string& path_;
  ProblemList problems_;
  ColumnMap no_map_;
  TextTable table_;
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
      throw ConfigurationError(
          {Problem{path, 0, axes[i], "1 repeat",
                   "every feature must be measured cold and warm at least twice, "
                   "for an interval"}});
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
    // If no shift is wrong by more than `widest`, neither is their root mean square.
    const double rms = std::sqrt(sum / static_cast<double>(measured.size()));
    axis.rms_um = {rms, std::max(0.0, rms - widest), rms + widest};
    figures.axes.push_back(axis);
  }
  if (figures.axes.empty())
    throw ConfigurationError(
        {Problem{path, 0, "", "", "no feature has a value both cold and warm in one repeat"}});
  return figures;
}

Tolerance tolerance_of(const PartFigures& figures, double tolerance_um) {
  Tolerance all = Tolerance::kept;
  for (const auto& [feature, axis, shift] : figures.shifts) {
    if (shift.low > tolerance_um || shift.high < -tolerance_um) return Tolerance::exceeded;
    if (shift.low < -tolerance_um || shift.high > tolerance_um) all = Tolerance::undecided;
  }
  return all;
}

namespace {

constexpr const char* without_colour = "#c05621";
constexpr const char* with_colour = "#2b6cb0";

const PartShift* find(const PartFigures& figures, const PartShift& like) {
  const auto found =
      std::find_if(figures.shifts.begin(), figures.shifts.end(), [&](const PartShift& each) {
        return each.feature == like.feature && each.axis == like.axis;
      });
  return found == figures.shifts.end() ? nullptr : &*found;
}

const PartAxis* find(const PartFigures& figures, const std::string& axis) {
  const auto found = std::find_if(figures.axes.begin(), figures.axes.end(),
                                  [&](const PartAxis& each) { return each.axis == axis; });
  return found == figures.axes.end() ? nullptr : &*found;
}

std::vector<std::string> instructions(const PartSheet& sheet) {
  return {
      "The part: " + std::to_string(sheet.features) +
          " features of one kind (bores, pads, spheres) spread over the working volume. Use either "
          "an artefact that stays clamped and is probed, or a part with a cold and a warm copy of "
          "each feature side by side, cut by this machine (rough cuts, one finishing cut) and "
          "measured at 20 degC.",
      ("Cold: after a night at rest, probe or finish every feature once, in the order of the "
       "rows."),
      "Warm: after " + figure_text(sheet.hours) +
          " h of the shop's usual load, immediately do the same in the same order.",
      "One repeat, cold and warm, takes a day. Do " + std::to_string(sheet.repeats) +
          " repeats; clamp the part anew only between them.",
      "Fill in one sheet with the compensation off (thermocomp disable), one with it on.",
      ("Values are deviations from the nominal size or place in um, with their sign. Leave missing "
       "values empty.")};
}

/// Draws each feature's shift as a line between its bounds, without and with compensation.
std::string picture(const PartTest& test) {
  const auto& [before, after, tolerance_um] = test;
  constexpr double left = 90.0;
  constexpr double width = 720.0;
  constexpr double row = 17.0;
  double reach = std::max(1.0, tolerance_um.value_or(0.0));
  for (const PartFigures* figures : {&before, after ? &*after : nullptr})
    if (figures != nullptr)
      for (const PartShift& each : figures->shifts)
        reach = std::max({reach, std::abs(each.shift_um.low), std::abs(each.shift_um.high)});
  const double middle = (left + width) / 2.0;
  const double scale = (width - left - 20.0) / 2.0 / reach;
  const double height = 44.0 + row * static_cast<double>(before.shifts.size());
  Drawing drawing{width, height, "", "shift of each feature with its 95 % interval"};
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", value);
    return std::string(text);
  };
  const auto text = [&](double x, double y, const std::string& words, const char* anchor) {
    drawing.body += "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" +
                    anchor + "\">" + words + "</text>";
  };
  const auto line = [&](double x1, double y1, double x2, double y2, const std::string& style) {
    drawing.body += "<path d=\"M" + number(x1) + " " + number(y1) + "L" + number(x2) + " " +
                    number(y2) + "\" style=\"fill:none;" + style + "\"/>";
  };
  for (const double tick : round_ticks(-reach, reach, 7)) {
    const double x = middle + scale * tick;
    line(x, 20.0, x, height - 22.0, tick == 0.0 ? "stroke:#4a5568" : "stroke:#cbd5e0");
    text(x, height - 6.0, figure_text(tick) + (tick == 0.0 ? " µm" : ""), "middle");
  }
  for (const double side : {-1.0, 1.0}) {
    const double x = middle + side * scale * tolerance_um.value_or(0.0);
    if (tolerance_um) line(x, 14.0, x, height - 22.0, "stroke:#1a202c;stroke-dasharray:5 4");
  }
  const auto mark = [&](const Figure& shift, double y, const std::string& colour) {
    const double from = middle + scale * shift.low;
    const double to = middle + scale * shift.high;
    line(from, y, to, y, "stroke-width:2;stroke:" + colour);
    const double at = middle + scale * shift.value;
    line(at, y - 5.0, at, y + 5.0, "stroke-width:4;stroke:" + colour);
  };
  double y = 30.0;
  for (const PartShift& each : before.shifts) {
    text(left - 8.0, y + 5.0, xml_text(each.feature) + " " + each.axis, "end");
    mark(each.shift_um, y - 4.0, without_colour);
    const PartShift* compensated = after ? find(*after, each) : nullptr;
    if (compensated != nullptr) mark(compensated->shift_um, y + 5.0, with_colour);
    y += row;
  }
  return drawing.svg();
}

std::string signature_table() {
  const std::string blank = "\u00a0";
  return html_table({{"machine and number", "part", "dates", "room, from to °C", "measured by",
                      "signed for the maker", "signed for the user"},
                     {blank, "", "", "", "", "", ""}});
}

nlohmann::json figure_json(const Figure& figure) {
  return {{"value", figure.value}, {"ci95", {figure.low, figure.high}}};
}

nlohmann::json figures_json(const PartFigures& figures) {
  nlohmann::json result{{"file", figures.file},
                        {"axes", nlohmann::json::array()},
                        {"features", nlohmann::json::array()}};
  for (const PartAxis& axis : figures.axes)
    result["axes"].push_back({{"axis", axis.axis},
                              {"repeats", axis.repeats},
                              {"repeat_sd_um", axis.repeat_sd_um},
                              {"rms_um", figure_json(axis.rms_um)}});
  for (const PartShift& each : figures.shifts)
    result["features"].push_back(
        {{"feature", each.feature}, {"axis", each.axis}, {"shift_um", figure_json(each.shift_um)}});
  return result;
}

const PartShift& farthest(const PartFigures& figures) {
  const auto reach = [](const PartShift& each) {
    return std::max(std::abs(each.shift_um.low), std::abs(each.shift_um.high));
  };
  return *std::max_element(
      figures.shifts.begin(), figures.shifts.end(),
      [&](const PartShift& a, const PartShift& b) { return reach(a) < reach(b); });
}

const char* name_of(Tolerance tolerance) {
  switch (tolerance) {
    case Tolerance::kept:
      return "kept";
    case Tolerance::exceeded:
      return "exceeded";
    default:
      return "undecided";
  }
}

std::string tolerance_sentence(const PartFigures& figures, const char* which, double tolerance_um) {
  const Tolerance tolerance = tolerance_of(figures, tolerance_um);
  const PartShift& most = farthest(figures);
  std::string text = "Tolerance ±" + figure_text(tolerance_um) + " µm, " + which +
                     " compensation: " + name_of(tolerance) + ". Farthest: " + most.feature +
                     " in " + most.axis + ", " + figure_words(most.shift_um, "um") + ".";
  if (tolerance == Tolerance::undecided)
    text += " An interval crosses the tolerance; more repeats narrow it.";
  return text;
}

}  // namespace

std::vector<std::string> part_sentences(const PartTest& test) {
  const auto& [before, after, tolerance_um] = test;
  std::vector<std::string> sentences;
  if (tolerance_um) sentences.push_back(tolerance_sentence(before, "without", *tolerance_um));
  if (tolerance_um && after) sentences.push_back(tolerance_sentence(*after, "with", *tolerance_um));
  for (const PartAxis& axis : before.axes) {
    const PartAxis* compensated = after ? find(*after, axis.axis) : nullptr;
    std::string text =
        axis.axis + ": heat moves the features by " + figure_words(axis.rms_um, "um") + " RMS";
    if (compensated != nullptr)
      text += ", with compensation by " + figure_words(compensated->rms_um, "um") + ": " +
              percent_words(ratio_of(compensated->rms_um, axis.rms_um)) + " remains";
    sentences.push_back(text + ".");
  }
  return sentences;
}

std::string part_html(const PartTest& test) {
  const auto& [before, after, tolerance_um] = test;
  std::string html = html_begin("Test part: thermal shift of its features");
  html += html_list(part_sentences(test));
  html += html_figure(
      picture(test), std::string("Shift of each feature from cold to warm with its 95 % interval") +
                         (after ? ": brown without, blue with compensation" : "") +
                         (tolerance_um ? "; dashed: the tolerance." : "."));
  std::vector<std::vector<std::string>> rows{{"feature", "axis", "shift, µm"}};
  if (after) rows.front().insert(rows.front().end(), {"with compensation, µm", "remains"});
  for (const PartShift& each : before.shifts) {
    rows.push_back({each.feature, each.axis, figure_words(each.shift_um, "")});
    if (!after) continue;
    const PartShift* compensated = find(*after, each);
    const bool is_there = compensated != nullptr && each.shift_um.value != 0.0;
    rows.back().push_back(is_there ? figure_words(compensated->shift_um, "") : "-");
    rows.back().push_back(
        is_there ? figure_text(100.0 * compensated->shift_um.value / each.shift_um.value) + " %"
                 : "-");
  }
  html += html_table(rows) + html_heading("Signed") + signature_table();
  std::vector<std::string> method{
      "A shift is the mean over the repeats of the warm minus the cold deviation. The feature's "
      "own error, its clamping and the probe's calibration cancel.",
      "Brackets contain the 95 % interval by Student's t from the scatter of the repeats. The "
      "degrees of freedom are the repeats minus one, since the features of one repeat share its "
      "thermal state."};
  if (tolerance_um)
    method.emplace_back(
        "The tolerance is kept if every interval is within it, exceeded if one is entirely "
        "outside, else undecided.");
  for (const PartFigures* figures : {&before, after ? &*after : nullptr})
    if (figures != nullptr) {
      std::string scatter = figures->file + ": the standard deviation of one repeat is";
      for (const PartAxis& axis : figures->axes)
        scatter += (&axis == &figures->axes.front() ? " " : ", ") + figure_text(axis.repeat_sd_um) +
                   " µm in " + axis.axis + " (" + std::to_string(axis.repeats) + " repeats)";
      method.push_back(scatter + ".");
    }
  return html + html_heading("How these figures were made") + html_list(method) + html_end();
}

std::string part_json(const PartTest& test) {
  const auto& [before, after, tolerance_um] = test;
  nlohmann::json result{{"test", "part"}, {"before", figures_json(before)}};
  if (tolerance_um) {
    result["tolerance"] = {{"um", *tolerance_um},
                           {"before", name_of(tolerance_of(before, *tolerance_um))}};
    if (after) result["tolerance"]["after"] = name_of(tolerance_of(*after, *tolerance_um));
  }
  if (after) {
    result["after"] = figures_json(*after);
    for (const PartAxis& axis : before.axes)
      if (const PartAxis* compensated = find(*after, axis.axis)) {
        const Figure ratio = ratio_of(compensated->rms_um, axis.rms_um);
        result["remains"][axis.axis] =
            std::isfinite(ratio.high) ? figure_json(ratio) : nlohmann::json(ratio.value);
      }
  }
  return result.dump(1) + "\n";
}

std::string part_sheet(const PartSheet& sheet, bool as_page) {
  const std::vector<std::string> columns{"repeat", "state", "feature", "x_um", "y_um", "z_um"};
  const std::string then =
      "Filled in: thermocomp thermal-test report OFF.csv ON.csv --test part -o REPORT.html";
  std::vector<std::vector<std::string>> rows{columns};
  for (int repeat = 1; repeat <= sheet.repeats; ++repeat)
    for (const char* state : {"cold", "warm"})
      for (int feature = 1; feature <= sheet.features; ++feature)
        rows.push_back({std::to_string(repeat), state,
                        std::string("P").append(std::to_string(feature)), "", "", ""});
  if (as_page)
    return html_begin("Test part, cold and warm") + html_list(instructions(sheet)) +
           html_table(rows) + signature_table() + html_paragraph(then, "small") + html_end();
  std::string text = "# Test part, cold and warm\n";
  for (const std::string& line : instructions(sheet)) text += "# " + line + "\n";
  text += "# " + then + "\n";
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) text += row[i] + (i + 1 < row.size() ? "," : "\n");
  return text;
}

}  // namespace thermocomp::thermal_test
