#include "modelling/diagnosis/still_searching.hpp"

#include <chrono>
#include <cstdio>

namespace thermocomp::diagnosis {

StillSearching::StillSearching() : teller_([this](const std::stop_token& stop) { tell(stop); }) {}

void StillSearching::tell(const std::stop_token& stop) {
  using std::chrono::seconds;
  std::unique_lock lock(mutex_);
  for (seconds so_far{2}, wait = so_far;; wait = seconds{10}, so_far += wait) {
    if (woken_.wait_for(lock, stop, wait, [&stop] { return stop.stop_requested(); })) return;
    if (stop.stop_requested()) return;
    std::fprintf(stderr, "thermocomp: searching what the model gets wrong, %lld s so far\n",
                 static_cast<long long>(so_far.count()));
  }
}

}  // namespace thermocomp::diagnosis
