/// Tells on stderr that a search goes on.
#pragma once

#include <csignal>

namespace thermocomp::diagnosis {

/// While it lives: a line after two seconds and after every ten seconds more. A search over a few
/// days of one machine is done before. One at a time; it has the process' alarm (SIGALRM). A thread
/// in its place would make every allocation of the search take a lock.
class StillSearching {
 public:
  StillSearching();
  ~StillSearching();
  StillSearching(const StillSearching&) = delete;
  StillSearching& operator=(const StillSearching&) = delete;

 private:
  struct sigaction before_ {};
};

}  // namespace thermocomp::diagnosis
