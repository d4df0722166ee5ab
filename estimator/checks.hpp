/// The two kinds of checks: THERMOCOMP_ENSURE for bugs (aborts with the expression), `require` for
/// bad input (throws with name, value and rule).
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace thermocomp {

/// A value that breaks a rule. The loader adds file and line.
class InvalidValue : public std::invalid_argument {
 public:
  InvalidValue(std::string key, std::string value, std::string rule);
  [[nodiscard]] const std::string& key() const noexcept { return key_; }
  [[nodiscard]] const std::string& value() const noexcept { return value_; }
  [[nodiscard]] const std::string& rule() const noexcept { return rule_; }

 private:
  std::string key_;
  std::string value_;
  std::string rule_;
};

/// @throws InvalidValue unless `holds`
void require(bool holds, const char* key, double value, const char* rule);

/// Key, member and range of a number of the configuration, for the reader of the file, the check
/// and the message.
template <class Config>
struct NumberKey {
  const char* key{nullptr};
  double Config::*member{nullptr};
  double min{0.0};
  double max{0.0};
  bool min_excluded{false};
  std::uint64_t Config::*whole_member{nullptr};  ///< of a whole number, instead of `member`

  /// (min, max]
  static constexpr NumberKey above(const char* key, double Config::*member, double min,
                                   double max) {
    return {key, member, min, max, true};
  }
  /// A whole number in [min, max]
  static constexpr NumberKey whole(const char* key, std::uint64_t Config::*member,
                                   std::uint64_t min, std::uint64_t max) {
    return {key, nullptr, static_cast<double>(min), static_cast<double>(max), false, member};
  }

  [[nodiscard]] double of(const Config& config) const {
    return whole_member != nullptr ? static_cast<double>(config.*whole_member) : config.*member;
  }
  void copy(const Config& from, Config& to) const {
    if (whole_member != nullptr)
      to.*whole_member = from.*whole_member;
    else
      to.*member = from.*member;
  }
};

/// @throws InvalidValue unless `value` is in [min, max], or (min, max]; rule: "must be in (0, 1e6]"
void require_in(double value, const char* key, double min, double max, bool min_excluded);

/// @throws InvalidValue at the first of Config::numbers() outside its range
template <class Config>
void require_numbers(const Config& config) {
  for (const NumberKey<Config>& each : Config::numbers())
    require_in(each.of(config), each.key, each.min, each.max, each.min_excluded);
}

[[noreturn]] void abort_with(const char* expression, const char* file, int line) noexcept;

}  // namespace thermocomp

/// Always on: aborts with the expression if it is false.
#define THERMOCOMP_ENSURE(expression) \
  ((expression) ? static_cast<void>(0) : ::thermocomp::abort_with(#expression, __FILE__, __LINE__))
