/// What is thrown when a history cannot be used; the text names the file and the reason.
#pragma once

#include <stdexcept>

namespace thermocomp {

class HistoryError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace thermocomp
