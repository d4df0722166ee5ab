/// What is thrown when a history cannot be used; the text names the file and the reason.
#pragma once

#include <stdexcept>
#include <string>

namespace thermocomp {

class HistoryError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// @throws HistoryError "damaged: ..." unless it holds
inline void require_sound(bool holds, const char* damage) {
  if (!holds) throw HistoryError(std::string("damaged: ") + damage);
}

}  // namespace thermocomp
