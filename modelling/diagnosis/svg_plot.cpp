#include "modelling/diagnosis/svg_plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

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

std::string formatted(const char* format, double a, double b = 0.0) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

std::string frame(const std::string& title, double whole_width, const Range& y) {
  std::string svg = formatted("<svg viewBox=\"0 0 %g %g\" role=\"img\">", whole_width, height);
  svg += "<text x=\"4\" y=\"14\" class=\"title\">" + escaped(title) + "</text>";
  svg += formatted("<text x=\"4\" y=\"%g\">", top + 10) + formatted("%.3g</text>", y.high);
  svg += formatted("<text x=\"4\" y=\"%g\">", height - bottom) + formatted("%.3g</text>", y.low);
  if (y.low < 0 && y.high > 0) {
    const double zero = height - bottom - (0 - y.low) / (y.high - y.low) * (height - top - bottom);
    svg += formatted("<path class=\"zero\" d=\"M64 %g", zero) + formatted("H%g\"/>", whole_width);
  }
  return svg;
}

double vertical(double value, const Range& y) {
  return height - bottom - (value - y.low) / (y.high - y.low) * (height - top - bottom);
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '&') {
      out += "&amp;";
    } else if (c == '"') {
      out += "&quot;";
    } else {
      out += c;
    }
  }
  return out;
}

std::string line_plot(const std::string& title, const Column& time_s,
                      const std::vector<PlotLine>& lines) {
  std::vector<const Column*> columns;
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
      svg += formatted(pen_down ? "L%.1f %.1f" : "M%.1f %.1f", along, vertical(value, y));
      pen_down = true;
    }
    svg += "\"/>" + formatted("<text x=\"%g\" y=\"14\" fill=\"", legend) + line.colour + "\">" +
           escaped(line.label) + "</text>";
    legend += 130.0;
  }
  svg += formatted("<text x=\"64\" y=\"%g\">", height - 8) +
         formatted("%.2f h</text>", x.low / 3600.0);
  svg += formatted("<text x=\"%g\" y=\"%g\">", width - 60, height - 8) +
         formatted("%.2f h</text></svg>\n", x.high / 3600.0);
  return svg;
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
    svg += formatted("M%.1f %.1fh1", along, vertical(y[row], up));
  }
  svg += formatted("\"/><text x=\"64\" y=\"%g\">", height - 8) +
         formatted("%.3g to %.3g K</text></svg>\n", across.low, across.high);
  return svg;
}

}  // namespace thermocomp::diagnosis
