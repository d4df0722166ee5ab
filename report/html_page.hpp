/// A page that needs nothing else: dark on light, for a screen, a phone and paper.
#pragma once

#include <string>
#include <vector>

namespace thermocomp {

/// From the doctype to the opening of the main part, with the title as its heading.
[[nodiscard]] std::string html_begin(const std::string& title);
[[nodiscard]] std::string html_end();

/// Escapes its text, as everything below does.
[[nodiscard]] std::string html_paragraph(const std::string& text, const std::string& kind = "");
[[nodiscard]] std::string html_heading(const std::string& text);
[[nodiscard]] std::string html_list(const std::vector<std::string>& items);
/// The first row is the head; empty without a second one.
[[nodiscard]] std::string html_table(const std::vector<std::vector<std::string>>& rows);
/// A picture that can be moved sideways, by key too, where the screen is narrower than it can be
/// read.
/// @param svg  markup, taken as it is
[[nodiscard]] std::string html_figure(const std::string& svg, const std::string& caption);

/// Three digits that count, never with an exponent: "123", "12.3", "1.23", "0.12"; "-" for NaN.
[[nodiscard]] std::string figure_text(double value);

}  // namespace thermocomp
