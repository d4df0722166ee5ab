#include "modelling/diagnosis/svg_plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "modelling/markup/xml_text.hpp"

namespace thermocomp::diagnosis {
namespace {

constexpr double width = 860.0;
constexpr double height = 190.0;
constexpr double left = 64.0;
constexpr double top = 22.0;
constexpr double bottom = 24.0;
constexpr double small_width = 210.0;
constexpr Eigen::Index points_max = 1200;

struct Range {
  double low{0.0};
  double high{1.0};
};

Range range_of(const std::vector<const Column*>& columns) {
  Range range{1e300, -1e300};
  for (const Column* column : columns) {
    for (const double value : *column) {
      if (!std::isfinite(value)) continue;
      range.low = std::min(range.low, value);
      range.high = std::max(range.high, value);
    }
  }
  if (!(range.low <= range.high)) return {};
  if (!(range.low < range.high)) return {range.low - 1.0, range.high + 1.0};
  return range;
}

/// "1.5 2.5": a place in the drawing.
std::string place(double x, double y) {
  char text[64];
  std::snprintf(text, sizeof text, "%.1f %.1f", x, y);
  return text;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string label(double x, double y, const std::string& text, const char* attributes = "") {
  std::string svg = "<text x=\"" + number(x);
  svg.append("\" y=\"").append(number(y)).append("\" ").append(attributes).append(">");
  return svg.append(xml_text(text)).append("</text>");
}

double vertical(double value, const Range& y) {
  return height - bottom - (value - y.low) / (y.high - y.low) * (height - top - bottom);
}

std::string frame(const std::string& title, double whole_width, const Range& y) {
  std::string svg = "<svg viewBox=\"0 0 " + place(whole_width, height);
  svg.append("\" role=\"img\">").append(label(4, 14, title, "class=\"title\""));
  svg += label(4, top + 10, number(y.high)) + label(4, height - bottom, number(y.low));
  if (y.low < 0 && y.high > 0) {
    svg.append("<path class=\"zero\" d=\"M").append(place(left, vertical(0.0, y)));
    svg.append("L").append(place(whole_width, vertical(0.0, y))).append("\"/>");
  }
  return svg;
}

}  // namespace

std::string line_plot(const std::string& title, const Column& time_s,
                      const std::vector<PlotLine>& lines) {
  std::vector<const Column*> columns;
  columns.reserve(lines.size());
  for (const PlotLine& line : lines) columns.push_back(line.values);
  const Range y = range_of(columns);
  const Range x = range_of({&time_s});
  std::string svg = frame(title, width, y);
  const Eigen::Index stride = std::max<Eigen::Index>(1, time_s.size() / points_max);
  double legend = 330.0;
  for (const PlotLine& line : lines) {
    svg += "<path fill=\"none\" stroke=\"" + line.colour + "\" d=\"";
    bool pen_down = false;
    for (Eigen::Index row = 0; row < time_s.size(); row += stride) {
      const double value = (*line.values)[row];
      if (!std::isfinite(value)) {
        pen_down = false;
        continue;
      }
      const double along = left + (time_s[row] - x.low) / (x.high - x.low) * (width - left - 8);
      svg.append(pen_down ? "L" : "M").append(place(along, vertical(value, y)));
      pen_down = true;
    }
    const std::string fill = "fill=\"" + line.colour + "\"";
    svg.append("\"/>").append(label(legend, 14, line.label, fill.c_str()));
    legend += 130.0;
  }
  svg += label(left, height - 8, number(x.low / 3600.0) + " h");
  svg += label(width - 60, height - 8, number(x.high / 3600.0) + " h");
  return svg + "</svg>\n";
}

std::string scatter_plot(const std::string& title, const Column& x, const Column& y) {
  const Range across = range_of({&x});
  const Range up = range_of({&y});
  std::string svg = frame(title, small_width, up) + "<path class=\"dots\" d=\"";
  const Eigen::Index stride = std::max<Eigen::Index>(1, x.size() / 300);
  for (Eigen::Index row = 0; row < x.size(); row += stride) {
    if (!std::isfinite(x[row]) || !std::isfinite(y[row])) continue;
    const double along =
        left + (x[row] - across.low) / (across.high - across.low) * (small_width - left - 8);
    svg.append("M").append(place(along, vertical(y[row], up))).append("h1");
  }
  svg += "\"/>";
  svg += label(left, height - 8, number(across.low) + " to " + number(across.high) + " K");
  return svg + "</svg>\n";
}

}  // namespace thermocomp::diagnosis
