/// Pictures as SVG, for a page that needs nothing else or for a file of their own.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace thermocomp {

/// Text inside SVG, HTML and VTU files: `text` with &, <, > and " as references, for elements and
/// for attributes in double quotes.
[[nodiscard]] std::string xml_text(const std::string& text);

/// The rules of a page's style sheet for lines, grid and labels.
extern const char* const svg_style;

/// A picture with its size, in pixels of a page of usual width.
struct Drawing {
  double width{0.0};
  double height{0.0};
  std::string body;
  std::string name;                       ///< for who does not see it
  [[nodiscard]] std::string svg() const;  ///< the element <svg>, for a page with svg_style
};

/// A file of pictures, one above the other.
[[nodiscard]] std::string svg_file(const std::vector<Drawing>& drawings);

struct PlotLine {
  std::string label;  ///< empty: not in the legend
  std::string colour;
  /// As many as there are times. NaN is left out; a gap that is much longer than the others of the
  /// line is not bridged.
  std::span<const double> values;
  bool as_dots{false};  ///< single values, not joined by a line
  bool dashed{false};
};

/// A stretch of time behind all panels, shaded and named at its top.
struct PlotSpan {
  std::string label;
  double from_s{0.0};
  double to_s{0.0};
};

/// A named moment on the axis of time, with a line through all panels.
struct TimeTick {
  double at_s{0.0};
  std::string label;
};

/// Lines over the axis that all panels share.
struct PlotPanel {
  std::string title;
  std::string unit;
  std::vector<PlotLine> lines;
  double height{150.0};
};

/// Panels one above the other over time (in h, min or s), with ticks, grid and units. Of long
/// columns the lowest and the highest value of each stretch are drawn, as many as a screen shows
/// when the picture is made wider.
/// @param ticks  in order; take the place of numbers. A label stands to the right of its line where
///               there is room before the next one
[[nodiscard]] std::string panels_plot(std::span<const double> time_s,
                                      const std::vector<PlotPanel>& panels,
                                      std::vector<PlotSpan> spans = {},
                                      std::vector<TimeTick> ticks = {});

/// The same over any axis.
/// @param x_title  with its unit
[[nodiscard]] Drawing curves_drawing(std::span<const double> x, const std::string& x_title,
                                     const std::vector<PlotPanel>& panels);

/// Squares from light (0) to dark (1) on a logarithmic scale, a name before each row and below each
/// column, and a frame around each run of `group_sizes`.
struct HeatMap {
  std::string title;
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;  ///< square, in the order of the names
  std::vector<std::size_t> group_sizes;
};
[[nodiscard]] Drawing heat_map_drawing(const HeatMap& map);

/// Dots of y over x.
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

/// Bars with a name before each, and one legend for all; every bar has the same labels.
struct NamedBar {
  std::string name;
  std::vector<BarPart> parts;
};
[[nodiscard]] std::string bars_plot(const std::vector<NamedBar>& bars);

/// About `wanted` round numbers (1, 2 or 5 times a power of ten apart) within the range.
[[nodiscard]] std::vector<double> round_ticks(double low, double high, int wanted);

}  // namespace thermocomp
