#include "gateway/http/history_answer.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/history/replay/thinned_history.hpp"

namespace thermocomp::gateway {
namespace {

using nlohmann::json;

std::string dumped(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

JsonAnswer error_answer(unsigned status, const std::string& text) {
  return {status, dumped({{"error", text}})};
}

/// A chart shows no more than seven significant digits, and an answer has half the size.
void append_short(std::string& text, double value) {
  if (!std::isfinite(value)) {
    text += "null";
    return;
  }
  constexpr int digits = 7;
  std::array<char, 40> chars{};
  const auto [end, code] = std::to_chars(chars.data(), chars.data() + chars.size(), value,
                                         std::chars_format::general, digits);
  text.append(chars.data(), code == std::errc() ? end : chars.data());
}

void append_column(std::string& text, const std::string& name, const std::vector<double>& values) {
  if (text.back() != '{') text += ',';
  text += dumped(name) + ":[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) text += ',';
    append_short(text, values[i]);
  }
  text += ']';
}

}  // namespace

JsonAnswer history_answer(const DaemonFeed& feed, const HistoryRequest& request) {
  const std::filesystem::path file = feed.history_file();
  if (file.empty()) return error_answer(503, "it is not known where the history is");
  try {
    const ThinnedHistory history = thin_history(file, request.from_s, request.to_s, request.points);
    const double span_s = (request.to_s - request.from_s) / static_cast<double>(request.points);
    json damage = json::array();
    for (const HistoryDamage& part : history.damage) damage.push_back(to_string(part));
    std::string text = R"({"columns":{)";
    text += "\"time_s\":" + dumped(history.time_s);
    for (const ThinnedColumn& column : history.columns)
      append_column(text, column.name, column.values);
    for (const auto& [name, values] : feed.displacement(history.time_s, span_s))
      append_column(text, name, values);
    json rest = {{"from_s", request.from_s},
                 {"to_s", request.to_s},
                 {"span_s", span_s},
                 {"chunks", history.chunks},
                 {"chunks_read", history.chunks_read},
                 {"damage", std::move(damage)}};
    text += "}," + dumped(rest).substr(1);
    return {200, std::move(text)};
  } catch (const std::exception& error) {
    return error_answer(503, error.what());
  }
}

}  // namespace thermocomp::gateway
