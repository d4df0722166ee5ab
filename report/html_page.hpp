/// Self-contained HTML pages: dark on light, for screen, phone and paper.
#pragma once

#include <string>
#include <vector>

namespace thermocomp {

/// From the doctype to the opening of the main part, with the title as heading.
[[nodiscard]] std::string html_begin(const std::string& title);
[[nodiscard]] std::string html_end();

/// Escapes its text, as do all functions below.
[[nodiscard]] std::string html_paragraph(const std::string& text, const std::string& kind = "");
[[nodiscard]] std::string html_heading(const std::string& text);
[[nodiscard]] std::string html_list(const std::vector<std::string>& items);
/// The first row is the head; empty if there is no other row.
[[nodiscard]] std::string html_table(const std::vector<std::vector<std::string>>& rows);
/// A picture that can be scrolled sideways, also by key, on narrow screens.
/// @param svg  markup, not escaped
[[nodiscard]] std::string html_figure(const std::string& svg, const std::string& caption);

/// Three significant digits, at most two decimals, no exponent: "123", "12.3", "1.23", "0.12"; "-"
/// for NaN.
[[nodiscard]] std::string figure_text(double value);

}  // namespace thermocomp
