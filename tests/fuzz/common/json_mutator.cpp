/// A mutator for JSON: changes types and sizes of values, nests objects, moves and doubles keys.
/// Most results are valid JSON and get past the parser. Linked as libFuzzer's
/// LLVMFuzzerCustomMutator.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t size_max);

namespace {

using nlohmann::json;

/// Nesting limit of mutated and inserted documents: the library is recursive, and a stack overflow
/// in the mutator is not a finding.
constexpr std::size_t levels_max = 3000;

class JsonMutator {
 public:
  explicit JsonMutator(unsigned seed) : random_(seed) {}

  void change(json& document) {
    json& node = any_node(document);
    switch (below(6)) {
      case 0:
        node = odd_value();
        break;
      case 1:
        node = nested(node);
        break;
      case 2:
        add_key(node);
        break;
      case 3:
        remove(node);
        break;
      case 4:
        swap_with(document, node);
        break;
      default:
        change_number(node);
        break;
    }
  }
  /// Damages the text itself: doubled key, missing part, appended text.
  void damage(std::string& text) {
    const std::size_t at = below(text.size() + 1);
    switch (below(4)) {
      case 0:
        text.resize(at);
        break;
      case 1:
        text.insert(at, text.substr(below(at + 1), below(200)));
        break;
      case 2:
        text.insert(at, std::string(1 + below(20'000), below(2) == 0 ? '[' : '{'));
        break;
      default:
        text += text;
        break;
    }
  }
  [[nodiscard]] std::size_t below(std::size_t count) {
    return count == 0 ? 0 : std::uniform_int_distribution<std::size_t>(0, count - 1)(random_);
  }

 private:
  json& any_node(json& document) {
    json* node = &document;
    while (!node->empty() && node->is_structured() && below(4) != 0) {
      auto place = node->begin();
      std::advance(place, static_cast<long>(below(node->size())));
      node = &*place;
    }
    return *node;
  }

  json odd_value() {
    constexpr double huge = std::numeric_limits<double>::max();
    const std::array<json, 18> values{nullptr,
                                      true,
                                      false,
                                      "",
                                      "a\u001b[31mb",
                                      "\xE2\x80\xAE",
                                      json::array(),
                                      json::object(),
                                      0,
                                      -1,
                                      1e300,
                                      -300.0,
                                      200.0,
                                      huge,
                                      5e-324,
                                      std::numeric_limits<std::int64_t>::min(),
                                      std::numeric_limits<std::uint64_t>::max(),
                                      std::string(below(3000), 'x')};
    return values[below(values.size())];
  }

  json nested(const json& inside) {
    constexpr std::array<std::size_t, 5> depths{1, 2, 20, 500, 3000};
    json value = inside;
    const std::size_t levels = std::min(depths[below(depths.size())], levels_left_);
    levels_left_ -= levels;
    for (std::size_t i = levels; i > 0; --i) {
      json outer = json::array();
      outer.push_back(std::move(value));
      value = std::move(outer);
    }
    return value;
  }

  void add_key(json& node) {
    if (!node.is_object()) return;
    const std::array<std::string, 6> names{
        "x", "format", "a\u001b[2J", "\xE2\x80\xAE", "\n", std::string(2000, 'k')};
    const std::size_t count = below(8) == 0 ? below(3000) : 1;
    for (std::size_t i = 0; i < count; ++i) {
      node[names[below(names.size())] + (count > 1 ? std::to_string(i) : "")] = odd_value();
    }
  }

  void remove(json& node) {
    if (!node.is_structured() || node.empty()) return;
    auto place = node.begin();
    std::advance(place, static_cast<long>(below(node.size())));
    node.erase(place);
  }

  void swap_with(json& document, json& node) { json(any_node(document)).swap(node); }

  void change_number(json& node) {
    if (!node.is_number()) return;
    const std::array<double, 6> factors{-1.0, 0.0, 10.0, 1e10, 1e300, 1e-300};
    node = node.get<double>() * factors[below(factors.size())];
  }

  std::mt19937 random_;
  std::size_t levels_left_{levels_max};
};

/// Nesting depth of brackets, including those in strings.
std::size_t nesting(const std::uint8_t* data, std::size_t size) {
  std::size_t open = 0;
  std::size_t deepest = 0;
  for (std::size_t i = 0; i < size; ++i) {
    if (data[i] == '[' || data[i] == '{') deepest = std::max(deepest, ++open);
    if ((data[i] == ']' || data[i] == '}') && open > 0) --open;
  }
  return deepest;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t size_max, unsigned seed) {
  if (nesting(data, size) > levels_max) return LLVMFuzzerMutate(data, size, size_max);
  JsonMutator mutator(seed);
  json document =
      json::parse(data, data + size, nullptr, false);  // discarded: not JSON, so bytes are mutated
  if (seed % 8 == 0 || document.is_discarded()) return LLVMFuzzerMutate(data, size, size_max);
  const std::size_t changes = 1 + mutator.below(4);
  for (std::size_t i = 0; i < changes; ++i) mutator.change(document);
  std::string text = document.dump(2, ' ', false, json::error_handler_t::replace);
  if (mutator.below(10) == 0) mutator.damage(text);
  if (text.size() > size_max) text.resize(size_max);
  std::memcpy(data, text.data(), text.size());
  return text.size();
}
