/// Tells on stderr that a search goes on.
#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

namespace thermocomp::diagnosis {

/// While it lives: a line after two seconds and after every ten seconds more. A search over a few
/// days of one machine is done before.
class StillSearching {
 public:
  StillSearching();

 private:
  void tell(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any woken_;
  std::jthread teller_;  ///< last: stopped and joined before the others go
};

}  // namespace thermocomp::diagnosis
