#include "report/svg_plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "config/runs/robust.hpp"

namespace thermocomp {
namespace {

constexpr double width = 860.0;
constexpr double left = 52.0;
constexpr double right = 10.0;
constexpr double title_height = 24.0;
/// Distance of a title from its panel, above the label of the highest tick.
constexpr double title_up = 11.0;
constexpr double axis_height = 32.0;
constexpr double gap = 8.0;
constexpr double small_width = 240.0;
constexpr double small_height = 190.0;
constexpr double bar_height = 20.0;
constexpr double bar_left = 120.0;
constexpr double share_written_min = 0.06;
constexpr double cell_size = 18.0;
/// Limits for all lines of a panel and for one line.
constexpr std::size_t panel_points_max = 8000;
constexpr std::size_t points_max = 2000;
constexpr std::size_t dots_max = 300;
constexpr double rounding_share = 1e-9;
constexpr double bad_width_min = 1.5;
constexpr double legend_row = 16.0;
constexpr double legend_stroke = 16.0;
constexpr double legend_gap = 14.0;

struct Extent {
  double low{0.0};
  double high{1.0};
  [[nodiscard]] double share(double value) const { return (value - low) / (high - low); }
};

using Values = std::span<const double>;

Extent range_of(const std::vector<Values>& columns) {
  Extent range{1e300, -1e300};
  for (const Values column : columns) {
    for (const double value : column) {
      if (!std::isfinite(value)) continue;
      range.low = std::min(range.low, value);
      range.high = std::max(range.high, value);
    }
  }
  if (!(range.low <= range.high)) return {};
  // Rounding errors of a constant are not magnified.
  const double size = std::max(std::abs(range.low), std::abs(range.high));
  if (!(range.high - range.low > rounding_share * size)) return {range.low - 1.0, range.high + 1.0};
  return range;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string coordinate(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

/// "1.5 2.5": coordinates.
std::string place(double x, double y) {
  return coordinate(x) + " " + coordinate(y);
}

std::string label(double x, double y, const std::string& text, const std::string& attributes = "") {
  std::string svg = "<text x=\"" + coordinate(x);
  svg.append("\" y=\"").append(coordinate(y)).append("\" ").append(attributes).append(">");
  return svg.append(xml_text(text)).append("</text>");
}

/// "h120.0"
std::string way(char direction, double length) {
  return std::string(1, direction).append(coordinate(length));
}

/// Approximate width in the labels' font.
double text_width(const std::string& text) {
  return 7.0 * static_cast<double>(text.size());
}

std::string line_path(double x, double y, const std::string& along, const char* kind) {
  std::string svg = "<path class=\"";
  svg.append(kind).append("\" d=\"M").append(place(x, y)).append(along);
  return svg.append("\"/>");
}

/// @param name  text alternative
std::string begin(double whole_width, double height, const std::string& name) {
  return std::string("<svg viewBox=\"0 0 ")
      .append(place(whole_width, height))
      .append("\" role=\"img\" aria-label=\"")
      .append(xml_text(name))
      .append("\">");
}

/// The frame of a panel.
struct Box {
  double x;
  double y;
  double width;
  double height;
  [[nodiscard]] double across(const Extent& range, double value) const {
    return x + width * range.share(value);
  }
  [[nodiscard]] double up(const Extent& range, double value) const {
    return y + height * (1.0 - range.share(value));
  }
};

std::string vertical_axis(const Box& box, const Extent& range, int wanted) {
  std::string svg;
  for (const double tick : round_ticks(range.low, range.high, wanted)) {
    const double at = box.up(range, tick);
    svg += line_path(box.x, at, way('h', box.width), tick == 0.0 ? "zero" : "grid");
    svg += label(box.x - 4, at + 4, number(tick), "text-anchor=\"end\"");
  }
  return svg + line_path(box.x, box.y, way('v', box.height), "axis");
}

std::string horizontal_axis(const Box& box, const Extent& range, const std::string& unit,
                            int wanted) {
  std::string svg;
  for (const double tick : round_ticks(range.low, range.high, wanted)) {
    const double at = box.across(range, tick);
    svg += line_path(at, box.y + box.height, "v4", "axis");
    svg += label(at, box.y + box.height + 16, number(tick), "text-anchor=\"middle\"");
  }
  svg += line_path(box.x, box.y + box.height, way('h', box.width), "axis");
  return svg + label(box.x + box.width, box.y + box.height + 28, unit, "text-anchor=\"end\"");
}

std::string named_axis(const Box& box, const Extent& x, const std::vector<TimeTick>& ticks) {
  std::string svg = line_path(box.x, box.y + box.height, way('h', box.width), "axis");
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const double at = box.across(x, ticks[i].at_s);
    const double next = i + 1 < ticks.size() ? box.across(x, ticks[i + 1].at_s) : box.x + box.width;
    svg += line_path(at, box.y + box.height, "v16", "axis");
    if (at + text_width(ticks[i].label) + 8 < next)
      svg += label(at + 4, box.y + box.height + 14, ticks[i].label);
  }
  return svg;
}

/// Longest gap of a line that is bridged.
double gap_max(const Extent& x, Values time, Values values) {
  std::vector<double> steps;
  double last = std::nan("");
  for (std::size_t row = 0; row < time.size(); ++row) {
    if (!std::isfinite(values[row])) continue;
    if (std::isfinite(last)) steps.push_back(time[row] - last);
    last = time[row];
  }
  if (steps.empty()) return x.high - x.low;
  constexpr double seen_share = 0.01;
  return std::max(10.0 * median(std::move(steps)), seen_share * (x.high - x.low));
}

/// Rows of the minimum and the maximum finite value from `begin` to `end`, in order.
std::vector<std::size_t> extreme_rows(Values values, std::size_t begin, std::size_t end) {
  std::size_t low = end;
  std::size_t high = end;
  for (std::size_t row = begin; row < end; ++row) {
    if (!std::isfinite(values[row])) continue;
    if (low == end || values[row] < values[low]) low = row;
    if (high == end || values[row] > values[high]) high = row;
  }
  if (low == end) return {};
  if (low == high) return {low};
  return {std::min(low, high), std::max(low, high)};
}

/// Within the quotation marks of the attribute before it.
std::string dash_attribute(const PlotLine& line) {
  constexpr std::array<const char*, 4> patterns = {"", "5 4", "2 3", "10 3 2 3"};
  const std::size_t pattern = line.dashes % patterns.size();
  return pattern == 0 ? "" : std::string("\" stroke-dasharray=\"") + patterns[pattern];
}

std::string curve(const Box& box, const Extent& x, const Extent& y, Values time,
                  const PlotLine& line, std::size_t points) {
  std::string svg = "<path fill=\"none\" stroke=\"";
  svg.append(line.colour);
  if (line.as_dots) svg.append("\" stroke-width=\"5\" stroke-linecap=\"round");
  svg.append(dash_attribute(line)).append("\" d=\"");
  const std::size_t stride = time.size() <= points ? 1 : 1 + 2 * (time.size() - 1) / points;
  const double bridged = gap_max(x, time, line.values) + static_cast<double>(stride) *
                                                             (x.high - x.low) /
                                                             static_cast<double>(time.size());
  bool pen_down = false;
  double last = 0.0;
  for (std::size_t begin = 0; begin < time.size(); begin += stride) {
    const std::size_t end = std::min(time.size(), begin + stride);
    for (const std::size_t row : extreme_rows(line.values, begin, end)) {
      pen_down = pen_down && time[row] - last <= bridged;
      last = time[row];
      svg.append(pen_down ? "L" : "M");
      svg.append(place(box.across(x, time[row]), box.up(y, line.values[row])));
      if (line.as_dots) svg.append("h0");
      pen_down = !line.as_dots;
    }
  }
  return svg + "\"/>";
}

std::string span_svg(const PlotSpan& span, const Box& box, const Extent& x, bool named) {
  const double from = box.across(x, std::max(x.low, span.from_s));
  double to = box.across(x, std::min(x.high, span.to_s));
  if (!(to > from)) return "";
  if (span.is_bad) to = std::max(to, from + bad_width_min);
  std::string svg = span.is_bad ? "<path class=\"bad\" d=\"M" : "<path class=\"span\" d=\"M";
  svg.append(place(from, box.y)).append(way('h', to - from)).append(way('v', box.height));
  svg.append(way('h', from - to)).append("z\"/>");
  return named ? svg + label(from + 3, box.y + 12, span.label, "class=\"note\"") : svg;
}

/// Colour of a heat map's square; values below 1e-4 are the lightest.
std::string shade(double value) {
  const double share = std::clamp(1.0 + std::log10(std::max(value, 1e-4)) / 4.0, 0.0, 1.0);
  return "hsl(215,60%," + number(std::round(96.0 - 76.0 * share)) + "%)";
}

/// @param body  inner markup
std::string square(double x, double y, double side, const std::string& attributes,
                   const std::string& body = "") {
  std::string svg = "<rect x=\"" + coordinate(x);
  svg.append("\" y=\"").append(coordinate(y)).append("\" width=\"").append(coordinate(side));
  svg.append("\" height=\"").append(coordinate(side)).append("\" ").append(attributes);
  return svg.append(">").append(body).append("</rect>");
}

std::string title_of(const PlotPanel& panel) {
  return panel.title + (panel.unit.empty() ? "" : ", " + panel.unit);
}

/// Strokes with their names: beside the title if there is room, else in rows below it.
class Legend {
 public:
  explicit Legend(const PlotPanel& panel) {
    constexpr double bold = 1.15;
    double all = 0.0;
    for (const PlotLine& line : panel.lines) all += width_of(line);
    // A narrow screen shows the left part of a picture.
    double x = left + legend_gap + bold * text_width(title_of(panel));
    double row = 0.0;
    if (x + all > width - right) {
      x = left;
      row = 1.0;
    }
    for (const PlotLine& line : panel.lines) {
      if (line.label.empty()) continue;
      if (x > left && x + width_of(line) > width - right + 1.0) {
        x = left;
        row += 1.0;
      }
      entries_.push_back({&line, x, row * legend_row});
      x += width_of(line);
    }
  }

  [[nodiscard]] double below() const { return entries_.empty() ? 0.0 : entries_.back().y; }
  /// @param y  of the title's line
  [[nodiscard]] std::string svg(double y) const {
    std::string svg;
    for (const Entry& entry : entries_) {
      svg.append("<path stroke-width=\"2\" stroke=\"").append(entry.line->colour);
      svg.append(dash_attribute(*entry.line)).append("\" d=\"M");
      svg.append(place(entry.x, y + entry.y - 4)).append(way('h', legend_stroke)).append("\"/>");
      svg += label(entry.x + legend_stroke + 4, y + entry.y, entry.line->label);
    }
    return svg;
  }

 private:
  struct Entry {
    const PlotLine* line;
    double x;
    double y;
  };
  static double width_of(const PlotLine& line) {
    return line.label.empty() ? 0.0 : legend_stroke + 4 + text_width(line.label) + legend_gap;
  }
  std::vector<Entry> entries_;
};

std::string panel_svg(const PlotPanel& panel, const Legend& legend, const Box& box, Values time,
                      const Extent& x) {
  std::vector<Values> columns;
  columns.reserve(panel.lines.size());
  for (const PlotLine& line : panel.lines) columns.push_back(line.values);
  const Extent y = range_of(columns);
  std::string svg = label(4, box.y - title_up - legend.below(), title_of(panel), "class=\"title\"");
  svg += vertical_axis(box, y, panel.height > 100 ? 5 : 3);
  svg += legend.svg(box.y - title_up - legend.below());
  const auto points =
      std::min(points_max, panel_points_max / std::max<std::size_t>(1, panel.lines.size()));
  for (const PlotLine& line : panel.lines) svg += curve(box, x, y, time, line, points);
  return svg;
}

/// @param spans, ticks  in the unit of `along`
Drawing panels_drawing(Values along, const std::string& along_title,
                       const std::vector<PlotPanel>& panels, const std::vector<PlotSpan>& spans,
                       const std::vector<TimeTick>& ticks) {
  Drawing drawing{width, axis_height, "", ""};
  const Extent x = range_of({along});
  for (const PlotPanel& panel : panels) {
    const Legend legend(panel);
    const double top = drawing.height - axis_height + title_height + legend.below();
    const Box box{left, top, width - left - right, panel.height};
    drawing.name += (drawing.name.empty() ? "" : "; ") + panel.title;
    std::string& svg = drawing.body;
    for (const PlotSpan& span : spans) svg += span_svg(span, box, x, &panel == &panels.front());
    for (const TimeTick& tick : ticks)
      svg += line_path(box.across(x, tick.at_s), box.y, way('v', box.height), "grid");
    svg += panel_svg(panel, legend, box, along, x);
    if (&panel == &panels.back())
      svg += ticks.empty() ? horizontal_axis(box, x, along_title, 10) : named_axis(box, x, ticks);
    drawing.height += title_height + legend.below() + panel.height + gap;
  }
  return drawing;
}

}  // namespace

const char* const svg_style =
    "svg text{font:13px sans-serif}svg .title{font-weight:bold}svg .note{fill:#4a5568}"
    ".zero{stroke:#718096}.grid{stroke:#e2e8f0}.axis{stroke:#718096}"
    ".span{fill:#2b6cb0;fill-opacity:.07}svg .bad{fill:#b3261e;fill-opacity:.14}";

PlotLine numbered_line(std::string label, std::size_t number, Values values) {
  constexpr std::array<const char*, 8> colours = {"#2b6cb0", "#c05621", "#2f855a", "#6b46c1",
                                                  "#b7791f", "#97266d", "#285e61", "#4a5568"};
  return {std::move(label), colours[number % colours.size()], values, false,
          static_cast<unsigned>(number / colours.size())};
}

std::string Drawing::svg() const {
  return begin(width, height, name) + body + "</svg>\n";
}

std::string svg_file(const std::vector<Drawing>& drawings) {
  Drawing all;
  for (const Drawing& drawing : drawings) {
    all.body.append("<g transform=\"translate(").append(place(0.0, all.height)).append(")\">");
    all.body.append(drawing.body).append("</g>\n");
    all.width = std::max(all.width, drawing.width);
    all.height += drawing.height;
  }
  const std::string size =
      " width=\"" + coordinate(all.width) + "\" height=\"" + coordinate(all.height) + "\"";
  return "<svg xmlns=\"http://www.w3.org/2000/svg\"" + size + "><style>" + svg_style +
         "</style>\n<rect" + size + " fill=\"white\"/>\n" + all.body + "</svg>\n";
}

std::vector<double> round_ticks(double low, double high, int wanted) {
  std::vector<double> ticks;
  if (!(high > low) || wanted < 1) return ticks;
  const double raw = (high - low) / wanted;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power < raw) continue;
    step = factor * power;
    break;
  }
  for (double n = std::ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n += 1.0)
    ticks.push_back(n == 0.0 ? 0.0 : n * step);
  return ticks;
}

std::string panels_plot(Values time_s, const std::vector<PlotPanel>& panels,
                        std::vector<PlotSpan> spans, std::vector<TimeTick> ticks) {
  const double length_s = time_s.empty() ? 0.0 : time_s.back() - time_s.front();
  const auto [unit, unit_s] = length_s > 5400.0  ? std::pair{"time, h", 3600.0}
                              : length_s > 120.0 ? std::pair{"time, min", 60.0}
                                                 : std::pair{"time, s", 1.0};
  std::vector<double> time(time_s.begin(), time_s.end());
  for (double& at : time) at /= unit_s;
  for (PlotSpan& span : spans) {
    span.from_s /= unit_s;
    span.to_s /= unit_s;
  }
  for (TimeTick& tick : ticks) tick.at_s /= unit_s;
  return panels_drawing(time, unit, panels, spans, ticks).svg();
}

Drawing curves_drawing(Values x, const std::string& x_title, const std::vector<PlotPanel>& panels) {
  return panels_drawing(x, x_title, panels, {}, {});
}

Drawing heat_map_drawing(const HeatMap& map) {
  const std::size_t count = map.names.size();
  const auto at = [](std::size_t i) { return cell_size * static_cast<double>(i); };
  double names_width = 0.0;
  for (const std::string& name : map.names)
    names_width = std::max(names_width, 1.2 * text_width(name) + 8.0);
  Drawing drawing{std::max(width, names_width + at(count) + right),
                  title_height + at(count) + names_width, "", map.title};
  std::string& svg = drawing.body;
  svg += label(4, 14, map.title, "class=\"title\"");
  for (std::size_t i = 0; i < count; ++i) {
    const double y = title_height + at(i);
    svg += label(names_width - 4, y + 13, map.names[i], "text-anchor=\"end\"");
    svg += "<g transform=\"translate(" + place(names_width + at(i) + 13, title_height + at(count)) +
           ") rotate(-90)\">" + label(-4, 0, map.names[i], "text-anchor=\"end\"") + "</g>";
    for (std::size_t j = 0; j < count; ++j)
      svg += square(names_width + at(j), y, cell_size, "fill=\"" + shade(map.values[i][j]) + "\"",
                    "<title>" + number(map.values[i][j]) + "</title>");
  }
  std::size_t from = 0;
  for (const std::size_t size : map.group_sizes) {
    svg += square(names_width + at(from), title_height + at(from), at(size),
                  "fill=\"none\" stroke=\"#c8502c\" stroke-width=\"2\"");
    from += size;
  }
  return drawing;
}

std::string scatter_plot(const PlotDots& dots) {
  const Extent across = range_of({dots.x});
  const Extent up = range_of({dots.y});
  const Box box{left, title_height + 4, small_width - left - right,
                small_height - title_height - 4 - axis_height};
  std::string svg =
      begin(small_width, small_height, dots.title) + label(4, 14, dots.title, "class=\"title\"");
  svg += vertical_axis(box, up, 4) + horizontal_axis(box, across, dots.x_unit, 3);
  svg += "<path class=\"dots\" d=\"";
  const std::size_t stride = 1 + (dots.x.size() - 1) / dots_max;
  for (std::size_t row = 0; row < dots.x.size(); row += stride) {
    const double x = dots.x[row];
    const double y = dots.y[row];
    if (!std::isfinite(x) || !std::isfinite(y)) continue;
    svg.append("M").append(place(box.across(across, x), box.up(up, y))).append("h1");
  }
  return svg + "\"/></svg>\n";
}

std::string bars_plot(const std::vector<NamedBar>& bars) {
  const double height = title_height + static_cast<double>(bars.size()) * (bar_height + gap);
  std::string shares;
  for (const NamedBar& bar : bars) {
    shares += (shares.empty() ? "" : "; ") + bar.name;
    for (const BarPart& part : bar.parts)
      shares += ", " + part.label + " " + number(std::round(100.0 * part.share)) + " %";
  }
  std::string svg = begin(width, height + gap, shares);
  double legend = bar_left;
  if (!bars.empty())
    for (const BarPart& part : bars.front().parts) {
      svg.append("<path stroke=\"").append(part.colour).append("\" stroke-width=\"10\" d=\"M");
      svg.append(place(legend, 10)).append("h10\"/>").append(label(legend + 14, 14, part.label));
      legend += 34.0 + text_width(part.label);
    }
  double top = title_height + gap;
  for (const NamedBar& bar : bars) {
    svg += label(4, top + 14, bar.name, "class=\"title\"");
    double x = bar_left;
    for (const BarPart& part : bar.parts) {
      const double length = (width - bar_left - right) * part.share;
      svg.append("<path fill=\"").append(part.colour).append("\" d=\"M").append(place(x, top));
      svg.append(way('h', length)).append(way('v', bar_height)).append(way('h', -length));
      svg.append("z\"/>");
      if (part.share >= share_written_min)
        svg += label(x + length / 2, top + 14, number(std::round(100.0 * part.share)).append(" %"),
                     "class=\"share\" text-anchor=\"middle\"");
      x += length;
    }
    top += bar_height + gap;
  }
  return svg + "</svg>\n";
}

std::string xml_text(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace thermocomp
