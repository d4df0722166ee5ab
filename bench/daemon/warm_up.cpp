// Time until a machine is warm according to WarmUp, compared with the truth, every ten minutes of
// each run file:
//   bench_warm_up COLUMN BOUND_UM RUN.csv...      a line per time: FILE MINUTE SAID TRUE
// True: from then on the column stays within the bound of its last value.
#include "daemon/status/warm_up.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "config/runs/run_file.hpp"

namespace {

using namespace thermocomp;

void look_at(const std::string& file, const std::string& column, double bound_um) {
  const RunFile run = load_run(parse_selection(file));
  const std::vector<double>& time_s = run.time_s();
  const std::vector<double>& values_um = run.column(column);
  double warm_min = 0.0;
  for (std::size_t i = 0; i < values_um.size(); ++i)
    if (std::abs(values_um[i] - values_um.back()) > bound_um) warm_min = time_s[i] / 60.0;
  WarmUp warm;
  double next_min = 0.0;
  for (std::size_t i = 0; i < values_um.size(); ++i) {
    const double minute = time_s[i] / 60.0;
    const nanoseconds now(static_cast<std::int64_t>(1e9 * time_s[i]));
    if (warm.is_due(now)) warm.note(now, {values_um[i]}, bound_um);
    if (minute < next_min) continue;
    next_min += 10.0;
    std::printf("%s %.0f %.1f %.1f\n", file.c_str(), minute, warm.remaining().front().minutes,
                std::fmax(0.0, warm_min - minute));
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  for (int i = 3; i < argc; ++i) look_at(argv[i], argv[1], std::atof(argv[2]));
}
