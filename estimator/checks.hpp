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

[[noreturn]] void abort_with(const char* expression, const char* file, int line) noexcept;

}  // namespace thermocomp

/// Always on: a broken promise of our own code ends the program with the expression.
#define THERMOCOMP_ENSURE(expression) \
  ((expression) ? static_cast<void>(0) : ::thermocomp::abort_with(#expression, __FILE__, __LINE__))
