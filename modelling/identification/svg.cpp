#include "modelling/identification/svg.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "modelling/identification/printed.hpp"
#include "report/xml_text.hpp"

namespace thermocomp::identification {
namespace {

constexpr double left_px = 64.0;
constexpr double top_px = 28.0;
constexpr double bottom_px = 44.0;
constexpr double right_px = 170.0;  // the names of the curves
constexpr std::size_t points_max = 2000;
constexpr std::array<const char*, 8> colours{"#1b6ca8", "#c8502c", "#3a8a3a", "#7b4fa0",
                                             "#a07a1c", "#2b9a9a", "#b03a6e", "#606060"};

struct Extent {
  double low{std::numeric_limits<double>::infinity()};
  double high{-std::numeric_limits<double>::infinity()};
  void add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void settle() {
    if (!(high >= low)) low = 0.0, high = 1.0;
    if (!(high > low)) low -= 0.5, high += 0.5;
  }
};

/// 1, 2 or 5 times a power of ten, so that about six lie in the extent.
double tick_step(const Extent& extent) {
  const double raw = (extent.high - extent.low) / 6.0;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= raw) return factor * power;
  return 10.0 * power;
}

class Axes {
 public:
  explicit Axes(const Diagram& diagram) : diagram_(diagram) {
    for (const Curve& curve : diagram.curves)
      for (std::size_t i = 0; i < curve.x.size(); ++i)
        if (std::isfinite(curve.y[i])) x_.add(curve.x[i]), y_.add(curve.y[i]);
    x_.settle();
    y_.settle();
    const double margin = 0.05 * (y_.high - y_.low);
    y_.low -= margin;
    y_.high += margin;
  }
  [[nodiscard]] double px(double x) const {
    return left_px + (x - x_.low) / (x_.high - x_.low) * (diagram_.width_px - left_px - right_px);
  }
  [[nodiscard]] double py(double y) const {
    return diagram_.height_px - bottom_px -
           (y - y_.low) / (y_.high - y_.low) * (diagram_.height_px - top_px - bottom_px);
  }
  [[nodiscard]] std::string frame() const {
    std::string text = printed(
        "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
        "stroke=\"#999\"/>\n",
        left_px, top_px, diagram_.width_px - left_px - right_px,
        diagram_.height_px - top_px - bottom_px);
    const double x_step = tick_step(x_);
    for (double x = std::ceil(x_.low / x_step) * x_step; x <= x_.high; x += x_step)
      text += printed("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%.4g</text>\n", px(x),
                      diagram_.height_px - bottom_px + 15.0, std::abs(x) < 1e-9 * x_step ? 0.0 : x);
    const double y_step = tick_step(y_);
    for (double y = std::ceil(y_.low / y_step) * y_step; y <= y_.high; y += y_step)
      text += printed(
          "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%.1f\" "
          "text-anchor=\"end\">%.4g</text>\n",
          left_px, py(y), diagram_.width_px - right_px, left_px - 5.0, py(y) + 4.0,
          std::abs(y) < 1e-9 * y_step ? 0.0 : y);
    return text;
  }

 private:
  const Diagram& diagram_;
  Extent x_;
  Extent y_;
};

std::string path_of(const Curve& curve, const Axes& axes, const std::string& colour) {
  std::string d;
  const std::size_t stride = curve.x.size() / points_max + 1;
  bool down = false;
  for (std::size_t i = 0; i < curve.x.size(); i += stride) {
    if (!std::isfinite(curve.y[i])) {
      down = false;
      continue;
    }
    d += printed("%c%.1f %.1f", down ? 'L' : 'M', axes.px(curve.x[i]), axes.py(curve.y[i]));
    down = true;
  }
  std::string text("<path d=\"");
  text.append(d).append("\" fill=\"none\" stroke-width=\"1.3\" stroke=\"").append(colour);
  text.append(curve.dashed ? "\" stroke-dasharray=\"5 4\"/>\n" : "\"/>\n");
  return text;
}

std::string head(double width_px, double height_px, const std::string& title) {
  return printed(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" "
             "font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%%\" "
             "height=\"100%%\" fill=\"white\"/>\n<text x=\"%.0f\" y=\"17\" font-size=\"13\">",
             width_px, height_px, left_px)
      .append(xml_text(title))
      .append("</text>\n");
}

/// Light where alike. Below a ten thousandth everything is the lightest.
std::string shade(double value) {
  const double share = std::clamp(1.0 + std::log10(std::max(value, 1e-4)) / 4.0, 0.0, 1.0);
  return printed("hsl(215,60%%,%.0f%%)", 96.0 - 76.0 * share);
}

}  // namespace

std::string svg_of(const Diagram& diagram) {
  const Axes axes(diagram);
  std::string text = head(diagram.width_px, diagram.height_px, diagram.title);
  text += axes.frame();
  std::size_t next = 0;
  double legend_px = top_px + 10.0;
  for (const Curve& curve : diagram.curves) {
    const std::string colour =
        curve.colour.empty() ? std::string(colours[next++ % colours.size()]) : curve.colour;
    text += path_of(curve, axes, colour);
    text += printed("<text x=\"%.1f\" y=\"%.1f\" fill=\"%s\">", diagram.width_px - right_px + 8.0,
                    legend_px, colour.c_str())
                .append(xml_text(curve.name))
                .append("</text>\n");
    legend_px += 15.0;
  }
  const double middle = (left_px + diagram.width_px - right_px) / 2.0;
  text += printed("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">", middle,
                  diagram.height_px - 8.0)
              .append(xml_text(diagram.x_label))
              .append("</text>\n");
  text += printed("<text transform=\"translate(14 %.1f) rotate(-90)\" text-anchor=\"middle\">",
                  diagram.height_px / 2.0)
              .append(xml_text(diagram.y_label))
              .append("</text>\n");
  return text.append("</svg>\n");
}

std::string svg_of(const HeatMap& map) {
  constexpr double cell_px = 18.0;
  constexpr double names_px = 120.0;
  constexpr double title_px_min = 420.0;
  const auto count = static_cast<double>(map.order.size());
  std::string text = head(std::max(names_px + cell_px * count + 20.0, title_px_min),
                          names_px + cell_px * count + 50.0, map.title);
  for (std::size_t i = 0; i < map.order.size(); ++i) {
    const double y = 30.0 + cell_px * static_cast<double>(i);
    const std::string name = xml_text(map.names[map.order[i]]);
    text += printed("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">", names_px - 4.0, y + 13.0)
                .append(name)
                .append("</text>\n");
    text += printed("<text transform=\"translate(%.1f %.1f) rotate(-90)\" text-anchor=\"end\">",
                    names_px + cell_px * (static_cast<double>(i) + 0.7), 36.0 + cell_px * count)
                .append(name)
                .append("</text>\n");
    for (std::size_t j = 0; j < map.order.size(); ++j) {
      const double value = map.values(static_cast<Eigen::Index>(map.order[i]),
                                      static_cast<Eigen::Index>(map.order[j]));
      text += printed("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"%s\">",
                      names_px + cell_px * static_cast<double>(j), y, cell_px, cell_px,
                      shade(value).c_str());
      text += printed("<title>%.3g</title></rect>\n", value);
    }
  }
  double from = 0.0;
  for (const std::size_t size : map.group_sizes) {
    const double length = cell_px * static_cast<double>(size);
    text += printed(
        "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" "
        "stroke=\"#c8502c\" stroke-width=\"2\"/>\n",
        names_px + from, 30.0 + from, length, length);
    from += length;
  }
  return text.append("</svg>\n");
}

}  // namespace thermocomp::identification
