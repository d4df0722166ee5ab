// Parts of toml_reader.hpp that need no parser: ranges, file limits, the nearest known key.

#include "config/toml/toml_reader.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "config/text/printable_text.hpp"
#include "config/text/regular_file.hpp"

namespace thermocomp {

bool Range::contains(double value) const {
  return std::isfinite(value) && (min_excluded ? value > min : value >= min) && value <= max;
}

std::string Range::rule() const {
  const bool bounded_below = min > any().min;
  const bool bounded_above = max < any().max;
  if (bounded_below && bounded_above) {
    return std::string("must be in ") + (min_excluded ? "(" : "[") + number_text(min) + ", " +
           number_text(max) + "]";
  }
  if (bounded_below) {
    return std::string(min_excluded ? "must be above " : "must be at least ") + number_text(min);
  }
  if (bounded_above) return "must be at most " + number_text(max);
  return "must be a finite number";
}

namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string read_text_file(const std::filesystem::path& path, std::uintmax_t bytes_max) {
  try {
    return read_regular_file(path, bytes_max);
  } catch (const std::runtime_error& error) {
    throw ConfigurationError({{path.string(), 0, "", "", error.what()}});
  }
}

std::string read_text_file(const std::filesystem::path& path) {
  return read_text_file(path, file_bytes_max);
}

std::string nearest_name(std::string_view name, const std::vector<std::string>& known) {
  constexpr std::size_t name_bytes_max = 100;  // the time grows with the length
  if (name.size() > name_bytes_max) return {};
  std::size_t best = std::max<std::size_t>(2, name.size() / 3) + 1;
  std::string nearest;
  bool is_clear = true;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance > best || distance >= name.size()) continue;
    if (distance == best) {
      is_clear = is_clear && candidate == nearest;
      continue;
    }
    is_clear = true;
    best = distance;
    nearest = candidate;
  }
  // With similar names such as T_01 and T_02, the nearest one is ambiguous.
  const auto is_twin = [&](const std::string& other) {
    return other != nearest && edit_distance(nearest, other) < best;
  };
  if (!is_clear || std::any_of(known.begin(), known.end(), is_twin)) return {};
  return nearest;
}

}  // namespace thermocomp
