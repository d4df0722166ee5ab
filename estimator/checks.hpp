/// The two ways of refusing: `ensure` for bugs of ours (aborts with the expression), `require` for
/// a value somebody chose (throws with name, value and rule).
#pragma once

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

/// A number of the configuration in one place: its key, its member and its range. The reader of the
/// file, the check and the message come from there.
template <class Config>
struct NumberKey {
  const char* key{nullptr};
  double Config::*member{nullptr};
  double min{0.0};
  double max{0.0};
  bool min_excluded{false};

  /// (min, max]
  static constexpr NumberKey above(const char* key, double Config::*member, double min,
                                   double max) {
    return {key, member, min, max, true};
  }
};

/// @throws InvalidValue unless `value` is in [min, max], or in (min, max]; its rule is "must be in
///         (0, 1e6]"
void require_in(double value, const char* key, double min, double max, bool min_excluded);

/// @throws InvalidValue at the first of Config::numbers() that is not in its range
template <class Config>
void require_numbers(const Config& config) {
  for (const NumberKey<Config>& each : Config::numbers())
    require_in(config.*each.member, each.key, each.min, each.max, each.min_excluded);
}

[[noreturn]] void abort_with(const char* expression, const char* file, int line) noexcept;

}  // namespace thermocomp

/// Always on: a broken promise of our own code ends the program with the expression.
#define THERMOCOMP_ENSURE(expression) \
  ((expression) ? static_cast<void>(0) : ::thermocomp::abort_with(#expression, __FILE__, __LINE__))
