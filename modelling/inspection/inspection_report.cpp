#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "config/text/units.hpp"
#include "modelling/inspection/inspection.hpp"
#include "report/xml_text.hpp"

namespace thermocomp::inspection {
namespace {

constexpr double width = 860.0;
constexpr double height = 200.0;
constexpr double left = 56.0;
constexpr double right = 12.0;
constexpr double top = 24.0;
constexpr double bottom = 34.0;
constexpr std::size_t points_max = 1500;

constexpr const char* head =
    "<!DOCTYPE html><html lang=\"en\"><head><meta "
    "charset=\"utf-8\"><title>Inspection</title><style>"
    "body{font:15px/1.45 sans-serif;max-width:900px;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:.6em 0}td,th{border:1px solid #ccc;padding:.2em .6em;"
    "text-align:left}svg{width:100%;height:auto;background:#fafafa;margin:.3em 0}"
    "svg text{font:11px sans-serif;fill:#333}svg .title{font-weight:bold}.grid{stroke:#e2e2e2}"
    ".bar{display:inline-block;width:90px;height:9px;background:#eee;margin-right:.5em}"
    ".bar i{display:block;height:9px;background:#c53030}"
    "</style></head><body>\n";

struct Axis {
  double low{0.0};
  double high{1.0};
  double step{0.2};
};

/// Ticks at 1, 2 or 5 times a power of ten, some five of them.
Axis axis_of(double low, double high) {
  if (!(high > low)) {
    low -= 0.5;
    high += 0.5;
  }
  const double rough = (high - low) / 5.0;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double share = rough / power;
  const double step = power * (share < 1.5 ? 1.0 : share < 3.5 ? 2.0 : share < 7.5 ? 5.0 : 10.0);
  return {low, high, step};
}

/// Four digits that count.
std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

/// A place in the picture.
std::string pixel(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

std::string element(const std::string& name, double x, double y, const std::string& more) {
  return "<" + name + " x=\"" + pixel(x) + "\" y=\"" + pixel(y) + "\"" + more;
}

/// One column over the run's hours, what was found in red.
class Picture {
 public:
  Picture(const RunFile& run, const std::string& column, double from_s, double to_s)
      : run_(run), values_(run.column(column)), title_(column) {
    const auto& time_s = run.time_s();
    begin_ = row_at(from_s);
    end_ = std::max(begin_ + 2, row_at(to_s));
    end_ = std::min(end_, time_s.size());
    origin_s_ = time_s.front();
    hours_ = axis_of(hour(begin_), hour(end_ - 1));
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t row = begin_; row < end_; ++row) {
      if (!std::isfinite(values_[row])) continue;
      low = std::min(low, values_[row]);
      high = std::max(high, values_[row]);
    }
    if (!(low <= high)) low = high = 0.0;
    up_ = axis_of(low, high);
  }

  [[nodiscard]] std::string svg(const Finding& finding) const {
    std::string svg = "<svg viewBox=\"0 0 860 200\" role=\"img\">";
    const std::string unit(unit_of(title_).symbol);
    svg += element("text", left, 15, " class=\"title\">") +
           xml_text(title_ + (unit.empty() ? "" : " [" + unit + "]")) + "</text>" + grid();
    svg += element("text", width - right, height - 4, " text-anchor=\"end\">") +
           "hours from the run's start</text>" + shade(finding) + curve() + marks(finding);
    return svg + "</svg>\n";
  }

 private:
  [[nodiscard]] std::size_t row_at(double time_s) const {
    const auto& times = run_.time_s();
    return static_cast<std::size_t>(std::lower_bound(times.begin(), times.end(), time_s) -
                                    times.begin());
  }
  [[nodiscard]] double hour(std::size_t row) const {
    return (run_.time_s()[row] - origin_s_) / 3600.0;
  }
  [[nodiscard]] double along(double hours) const {
    const double share = (hours - hours_.low) / (hours_.high - hours_.low);
    return left + std::clamp(share, 0.0, 1.0) * (width - left - right);
  }
  [[nodiscard]] double above(double value) const {
    return height - bottom - (value - up_.low) / (up_.high - up_.low) * (height - top - bottom);
  }

  [[nodiscard]] std::string grid() const {
    std::string svg;
    for (double tick = std::ceil(hours_.low / hours_.step) * hours_.step; tick <= hours_.high;
         tick += hours_.step) {
      const std::string x = pixel(along(tick));
      svg += "<path class=\"grid\" d=\"M" + x + " " + number(top) + "V" + number(height - bottom) +
             "\"/>" +
             element("text", along(tick), height - bottom + 14, " text-anchor=\"middle\">") +
             number(std::abs(tick) < 1e-9 ? 0.0 : tick) + "</text>";
    }
    for (double tick = std::ceil(up_.low / up_.step) * up_.step; tick <= up_.high;
         tick += up_.step) {
      const std::string y = pixel(above(tick));
      svg += "<path class=\"grid\" d=\"M" + number(left) + " " + y + "H" + number(width - right) +
             "\"/>" + element("text", left - 5, above(tick) + 4, " text-anchor=\"end\">") +
             number(std::abs(tick) < 1e-9 * up_.step ? 0.0 : tick) + "</text>";
    }
    return svg;
  }

  [[nodiscard]] std::string shade(const Finding& finding) const {
    if (!finding.times_s.empty()) return "";
    const double from = along((finding.at_s - origin_s_) / 3600.0);
    const double to = along((finding.until_s - origin_s_) / 3600.0);
    return element("rect", from, top, " fill=\"#c53030\" fill-opacity=\"0.10\" width=\"") +
           pixel(std::max(1.5, to - from)) + "\" height=\"" + number(height - top - bottom) +
           "\"/>";
  }

  /// Of many rows the lowest and the highest of each piece, so that no spike is lost.
  [[nodiscard]] std::string curve() const {
    std::string path;
    const std::size_t stride = std::max<std::size_t>(1, 2 * (end_ - begin_) / points_max);
    bool pen_down = false;
    const auto draw = [&](std::size_t row) {
      path.append(pen_down ? "L" : "M").append(pixel(along(hour(row))));
      path.append(" ").append(pixel(above(values_[row])));
      pen_down = true;
    };
    for (std::size_t from = begin_; from < end_; from += stride) {
      std::size_t low = end_;
      std::size_t high = end_;
      for (std::size_t row = from; row < std::min(end_, from + stride); ++row) {
        if (!std::isfinite(values_[row])) continue;
        if (low == end_ || values_[row] < values_[low]) low = row;
        if (high == end_ || values_[row] > values_[high]) high = row;
      }
      if (low == end_) {
        pen_down = false;
        continue;
      }
      draw(std::min(low, high));
      if (low != high) draw(std::max(low, high));
    }
    return "<path fill=\"none\" stroke=\"#2b6cb0\" d=\"" + path + "\"/>";
  }

  [[nodiscard]] std::string marks(const Finding& finding) const {
    std::string svg;
    for (const double time_s : finding.times_s) {
      const std::size_t row = row_at(time_s);
      if (row < begin_ || row >= end_ || !std::isfinite(values_[row])) continue;
      svg += "<circle r=\"2.5\" fill=\"none\" stroke=\"#c53030\" cx=\"" + pixel(along(hour(row))) +
             "\" cy=\"" + pixel(above(values_[row])) + "\"/>";
    }
    return svg;
  }

  const RunFile& run_;
  const std::vector<double>& values_;
  std::string title_;
  std::size_t begin_{0};
  std::size_t end_{0};
  double origin_s_{0.0};
  Axis hours_;
  Axis up_;
};

/// The place that moved most like the one of the finding, for comparison.
std::string neighbour_of(const Inspection& inspection, const Finding& finding, const RunFile& run) {
  if (!finding.other.empty()) return finding.other;
  if (!is_temperature(finding.column)) return "";
  for (const auto& group : inspection.groups) {
    if (std::find(group.begin(), group.end(), finding.column) == group.end()) continue;
    for (const std::string& name : group)
      if (name != finding.column && run.find(name)) return name;
  }
  return "";
}

std::string finding_html(const std::vector<RunFile>& runs, const Inspection& inspection,
                         const Finding& finding) {
  const RunFile& run = runs[finding.run];
  std::string html = "<h3><span class=\"bar\"><i style=\"width:" + pixel(90 * finding.probability) +
                     "px\"></i></span>" + std::to_string(std::lround(100 * finding.probability)) +
                     " %</h3><p>" + xml_text(finding.text) + " <small>(" + xml_text(run.name) +
                     ")</small></p>\n";
  if (!run.find(finding.column)) return html;
  const double first_s = run.time_s().front();
  const double last_s = run.time_s().back() + 1e-6;
  html += Picture(run, finding.column, first_s, last_s).svg(finding);
  const bool sudden = finding.kind == "sensor_step" || finding.kind == "displacement_step" ||
                      finding.kind == "sensor_loose";
  const double near_s = 0.03 * (last_s - first_s);
  if (sudden)
    html += "<p><small>The moment itself:</small></p>" +
            Picture(run, finding.column, finding.at_s - near_s, finding.at_s + near_s).svg(finding);
  const std::string neighbour = neighbour_of(inspection, finding, run);
  if (!neighbour.empty())
    html += "<p><small>For comparison, a place that moves alike:</small></p>" +
            Picture(run, neighbour, first_s, last_s).svg(finding);
  return html;
}

std::string runs_table(const Inspection& inspection) {
  std::string html =
      "<h2>The recordings</h2><table><tr><th>file</th><th>rows</th><th>one every</th>"
      "<th>gaps</th></tr>\n";
  for (const RunSampling& run : inspection.runs)
    html += "<tr><td>" + xml_text(run.file) + "</td><td>" + std::to_string(run.rows) + "</td><td>" +
            step_text(run.step_s) + "</td><td>" + std::to_string(run.gaps.size()) + "</td></tr>\n";
  return html + "</table>\n";
}

}  // namespace

std::string inspection_html(const std::vector<RunFile>& runs, const Inspection& inspection) {
  std::string html = head;
  html += "<h1>What these recordings are worth</h1>\n";
  html += inspection.findings.empty()
              ? "<p>No faults found in these recordings.</p>\n"
              : "<p>What is wrong with them, likeliest first. The bar is the probability.</p>\n";
  for (const Finding& finding : inspection.findings)
    html += finding_html(runs, inspection, finding);
  html += runs_table(inspection) + "<h2>Places that move alike</h2><ul>\n";
  for (const auto& group : inspection.groups) {
    html += "<li>";
    for (std::size_t i = 0; i < group.size(); ++i) html += (i > 0 ? ", " : "") + xml_text(group[i]);
    html += "</li>\n";
  }
  html += "</ul>\n";
  if (!inspection.experiments.empty()) html += "<h2>What would tell more</h2><ul>\n";
  for (const std::string& experiment : inspection.experiments)
    html += "<li>" + xml_text(experiment) + "</li>\n";
  if (!inspection.experiments.empty()) html += "</ul>\n";
  return html + "</body></html>\n";
}

}  // namespace thermocomp::inspection
