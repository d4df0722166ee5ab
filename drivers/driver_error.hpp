/// What a driver throws when it cannot start; once it runs, trouble is data.
#pragma once

#include <stdexcept>

namespace thermocomp {

class DriverError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace thermocomp
