#include "daemon/history/replay/thinned_history.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>

#include <catch2/catch.hpp>

#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

const ThinnedColumn& column_of(const ThinnedHistory& history, const std::string& name) {
  for (const ThinnedColumn& column : history.columns)
    if (column.name == name) return column;
  throw std::runtime_error("no column " + name);
}

/// Mean of a column of a run file.
double mean_of(const std::string& csv, const std::string& name) {
  std::istringstream lines(csv);
  std::string line;
  std::size_t place = std::string::npos;
  double sum = 0.0;
  int count = 0;
  while (std::getline(lines, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    std::string field;
    for (std::size_t i = 0; std::getline(fields, field, ','); ++i) {
      if (place == std::string::npos && field == name)
        place = i;
      else if (i == place && !field.empty() && field != name) {
        sum += std::stod(field);
        ++count;
      }
    }
  }
  REQUIRE(count > 0);
  return sum / count;
}

struct Recorded {
  explicit Recorded(const TempFolder& folder) : config(history_config(folder / "h.db")) {
    RecordedMachine machine(config, 5);
    machine.start();
    for (int part = 0; part < 4; ++part) {
      machine.run(300);
      std::this_thread::sleep_for(std::chrono::milliseconds(300));  // one chunk
    }
    machine.stop();
    const HistoryReader reader(config.file);
    begin_s = 1e-9 * static_cast<double>(reader.segments().front().wall_ns);
  }
  HistoryConfig config;
  double begin_s{0.0};
};

}  // namespace

TEST_CASE("a single point is the mean of all records", "[gateway][history]") {
  const TempFolder folder;
  const Recorded recorded(folder);
  const ThinnedHistory history = thin_history(recorded.config.file, recorded.begin_s - 100.0,
                                              recorded.begin_s + 100.0, 1, {}, parse_test_setup);
  CHECK(history.damage.empty());
  CHECK(history.chunks == history.chunks_read);
  CHECK(history.chunks >= 3);
  REQUIRE(history.time_s.size() == 1);
  CHECK(history.time_s[0] == Approx(recorded.begin_s + 49.5).epsilon(0).margin(1e-3));
  std::ostringstream csv;
  export_run(recorded.config.file, {}, {}, csv, {}, parse_test_setup);
  CHECK(column_of(history, "z_offset_um").values[0] ==
        Approx(mean_of(csv.str(), "z_offset_um")).epsilon(1e-9));
  const double bed_degC = column_of(history, "bed_degC").values[0];
  CHECK(bed_degC > 20.0);
  CHECK(bed_degC < 20.3);
}

TEST_CASE("points span from the start of the history to the requested end", "[gateway][history]") {
  const TempFolder folder;
  const Recorded recorded(folder);
  const ThinnedHistory history = thin_history(recorded.config.file, recorded.begin_s - 100.0,
                                              recorded.begin_s + 100.0, 200, {}, parse_test_setup);
  const auto& values = column_of(history, "z_offset_um").values;
  REQUIRE(values.size() == 200);
  CHECK(history.from_s == Approx(recorded.begin_s - 1.0).epsilon(0).margin(1e-3));
  CHECK(history.time_s.back() ==
        Approx(recorded.begin_s + 100.0 - 0.5 * 101.0 / 200.0).epsilon(0).margin(1e-3));
  CHECK(std::any_of(values.begin(), values.begin() + 4, [](double v) { return std::isfinite(v); }));
  CHECK(std::isnan(values.back()));
  const double later_s = recorded.begin_s + 0.5;
  CHECK(
      thin_history(recorded.config.file, later_s, later_s + 1.0, 2, {}, parse_test_setup).from_s ==
      later_s);
}

TEST_CASE("a long period is sampled evenly", "[gateway][history]") {
  const TempFolder folder;
  const Recorded recorded(folder);
  const ThinnedHistory history =
      thin_history(recorded.config.file, recorded.begin_s - 100.0, recorded.begin_s + 100.0, 10,
                   {5000, 2}, parse_test_setup);
  CHECK(history.chunks_read <= 2);
  CHECK(history.chunks_read >= 1);
  CHECK(history.chunks > 2);
}

TEST_CASE("a period before the history, or zero points, gives no data", "[gateway][history]") {
  const TempFolder folder;
  const Recorded recorded(folder);
  const auto thin = [&](double from_s, double to_s, std::size_t points) {
    return thin_history(recorded.config.file, from_s, to_s, points, {}, parse_test_setup);
  };
  const ThinnedHistory before = thin(1000.0, 2000.0, 5);
  CHECK(before.columns.empty());
  CHECK(before.time_s.size() == 5);
  CHECK_THROWS_AS(thin(2000.0, 1000.0, 5), std::invalid_argument);
  CHECK_THROWS_AS(thin(1000.0, 2000.0, 0), std::invalid_argument);
  CHECK_THROWS_AS(thin(1000.0, 2000.0, 5001), std::invalid_argument);
  CHECK_THROWS_AS(thin_history(folder / "none.db", 0.0, 1.0, 5), HistoryError);
}
