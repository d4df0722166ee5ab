/// Plots as SVG, for a self-contained page or a file.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace thermocomp {

/// Escapes &, <, > and " for elements and double-quoted attributes of SVG, HTML and VTU files.
[[nodiscard]] std::string xml_text(const std::string& text);

/// CSS rules for lines, grid and labels.
extern const char* const svg_style;

/// A picture with its size in pixels, for a page of usual width.
struct Drawing {
  double width{0.0};
  double height{0.0};
  std::string body;
  std::string name;                       ///< text alternative
  [[nodiscard]] std::string svg() const;  ///< the element <svg>, for a page with svg_style
};

/// A file with pictures one above the other.
[[nodiscard]] std::string svg_file(const std::vector<Drawing>& drawings);

struct PlotLine {
  std::string label;  ///< empty: not in the legend
  std::string colour;
  /// One per time. NaN is skipped; a gap much longer than the others of the line is not bridged.
  std::span<const double> values;
  bool as_dots{false};  ///< dots without a line
  unsigned dashes{0};   ///< 0: solid; else one of three patterns
};

/// A line of many: the first eight differ in colour, the next eight in their dashes too.
[[nodiscard]] PlotLine numbered_line(std::string label, std::size_t number,
                                     std::span<const double> values);

/// A shaded time span behind all panels, with its label at the top.
struct PlotSpan {
  std::string label;
  double from_s{0.0};
  double to_s{0.0};
  bool is_bad{false};  ///< red, with a least width
};

/// A labelled time on the axis, with a line through all panels.
struct TimeTick {
  double at_s{0.0};
  std::string label;
};

/// A panel of lines; all panels share the horizontal axis.
struct PlotPanel {
  std::string title;
  std::string unit;
  std::vector<PlotLine> lines;
  double height{150.0};
};

/// Panels one above the other over time (in h, min or s), with ticks, grid and units. Long columns
/// are reduced to the minimum and maximum of each interval, fine enough for a widened picture.
/// @param ticks  in order; replace the numbers. A label is to the right of its line if there is
///               room before the next one
[[nodiscard]] std::string panels_plot(std::span<const double> time_s,
                                      const std::vector<PlotPanel>& panels,
                                      std::vector<PlotSpan> spans = {},
                                      std::vector<TimeTick> ticks = {});

/// The same over any quantity.
/// @param x_title  including its unit
[[nodiscard]] Drawing curves_drawing(std::span<const double> x, const std::string& x_title,
                                     const std::vector<PlotPanel>& panels);

/// Squares from light (0) to dark (1) on a logarithmic scale, with names of rows and columns, and a
/// frame around each group.
struct HeatMap {
  std::string title;
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;  ///< square, in the order of the names
  std::vector<std::size_t> group_sizes;
};
[[nodiscard]] Drawing heat_map_drawing(const HeatMap& map);

/// Scatter plot of y over x.
struct PlotDots {
  std::string title;
  std::span<const double> x;
  std::string x_unit;
  std::span<const double> y;
};
[[nodiscard]] std::string scatter_plot(const PlotDots& dots);

struct BarPart {
  std::string label;
  std::string colour;
  double share{0.0};  ///< of the whole bar
};

/// A bar with its name; all bars have the same labels and one legend.
struct NamedBar {
  std::string name;
  std::vector<BarPart> parts;
};
[[nodiscard]] std::string bars_plot(const std::vector<NamedBar>& bars);

/// About `wanted` round ticks (steps of 1, 2 or 5 times a power of ten) within the range.
[[nodiscard]] std::vector<double> round_ticks(double low, double high, int wanted);

}  // namespace thermocomp
