/// Why the operators' socket cannot be opened.
#pragma once

#include <stdexcept>

namespace thermocomp {

class SocketError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace thermocomp
