#include "report/html_page.hpp"

#include <cmath>
#include <cstdio>

#include "report/svg_plot.hpp"

namespace thermocomp {
namespace {

constexpr const char* style =
    "body{font:16px/1.5 sans-serif;max-width:900px;margin:1.5em auto;padding:0 1em;color:#1a202c;"
    "background:#fff}h1,h2,p,li{overflow-wrap:anywhere}h1{font-size:1.6em;line-height:1.2}h2{font-"
    "size:1.2em;margin:1.6em 0 .3em}"
    // Shading at a side that hides more content.
    ".wide,figure{overflow-x:auto;background:linear-gradient(90deg,#fff 60%,#fff0) local,"
    "linear-gradient(270deg,#fff 60%,#fff0) 100% 0 "
    "local,linear-gradient(90deg,#4a556866,#4a556800),"
    "linear-gradient(270deg,#4a556866,#4a556800) 100% 0;background-repeat:no-repeat;"
    "background-size:40px 100%,40px 100%,14px 100%,14px 100%}"
    "table{border-collapse:collapse;margin:.5em 0}"
    "td,th{border:1px solid #cbd5e0;padding:.25em .6em;text-align:right;vertical-align:top}"
    "td:first-child,th:first-child{text-align:left}th{background:#edf2f7;font-weight:600}"
    ".line{white-space:nowrap}.long{min-width:9em}.text td{text-align:left}figure{margin:.6em 0}"
    "figcaption{color:#4a5568;font-size:.9em}svg{width:100%;min-width:680px;height:auto}"
    ".small{font-size:.85em;color:#4a5568}.good{color:#22543d}.bad{color:#9b2c2c}"
    "@media print{@page{size:A4;margin:12mm}body{font-size:8.5pt;line-height:1.25;margin:0;"
    "max-width:none}h2{margin:.8em 0 .2em}p,ul,table,figure{margin:.3em 0}td,th{padding:0 "
    "6px}td:empty{height:2.4em}"
    "svg{min-width:0}figure,tr{break-inside:avoid}}";

std::string row(const std::vector<std::string>& cells, const char* tag) {
  std::string html = "<tr>";
  // On a phone neither a number and its unit nor every word is broken onto a new line.
  constexpr std::size_t line_max = 24;
  for (const std::string& cell : cells) {
    const bool is_figure = cell.find_first_of("0123456789") != std::string::npos;
    html.append("<").append(tag);
    html.append(cell.size() > line_max ? " class=\"long\">" : is_figure ? " class=\"line\">" : ">");
    html.append(xml_text(cell));
    html.append("</").append(tag).append(">");
  }
  return html + "</tr>\n";
}

}  // namespace

std::string html_begin(const std::string& title) {
  std::string html =
      "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><title>";
  html.append(xml_text(title)).append("</title><style>").append(style).append(svg_style);
  html.append("</style></head><body><main>\n<h1>").append(xml_text(title));
  return html.append("</h1>\n");
}

std::string html_end() {
  return "</main></body></html>\n";
}

std::string html_paragraph(const std::string& text, const std::string& kind) {
  std::string html = kind.empty() ? "<p>" : "<p class=\"" + kind + "\">";
  return html.append(xml_text(text)).append("</p>\n");
}

std::string html_heading(const std::string& text) {
  return "<h2>" + xml_text(text) + "</h2>\n";
}

std::string html_list(const std::vector<std::string>& items) {
  if (items.empty()) return "";
  std::string html = "<ul>\n";
  for (const std::string& item : items) html += "<li>" + xml_text(item) + "</li>\n";
  return html + "</ul>\n";
}

std::string html_table(const std::vector<std::vector<std::string>>& rows) {
  if (rows.size() < 2) return "";
  std::string html = "<div class=\"wide\" tabindex=\"0\"><table>\n" + row(rows.front(), "th");
  for (std::size_t i = 1; i < rows.size(); ++i) html += row(rows[i], "td");
  return html + "</table></div>\n";
}

std::string html_figure(const std::string& svg, const std::string& caption) {
  std::string html = "<figure tabindex=\"0\">" + svg;
  if (!caption.empty()) html += "<figcaption>" + xml_text(caption) + "</figcaption>";
  return html + "</figure>\n";
}

std::string figure_text(double value) {
  if (!std::isfinite(value)) return "-";
  const double size = std::abs(value);
  const int digits = size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2;
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  // A value rounded to zero has no sign.
  const std::string result(text);
  return result.find_first_not_of("-0.") == std::string::npos ? std::string("0.00") : result;
}

}  // namespace thermocomp
