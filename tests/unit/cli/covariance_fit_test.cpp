#include "cli/model/covariance_fit.hpp"

#include <cmath>
#include <random>
#include <string>

#include <catch2/catch.hpp>

#include "config/model/model_file.hpp"
#include "config/text/problems.hpp"

using namespace thermocomp;
using namespace thermocomp::cli;

namespace {

const std::vector<std::string> inputs{"a_degC", "b_degC", "c_degC"};

/// a follows a slow cycle, b is 2 a with noise, c wanders alone. One row a minute.
RunFile run_of(std::size_t rows, unsigned seed = 1) {
  std::mt19937_64 engine(seed);
  const auto chance = [&] { return 2.0 * static_cast<double>(engine() >> 11) * 0x1p-53 - 1.0; };
  RunFile run;
  run.name = "run";
  run.columns = {"time_s", "a_degC", "b_degC", "c_degC"};
  run.values.resize(4);
  double alone_degC = 30.0;
  for (std::size_t row = 0; row < rows; ++row) {
    const double slow_K = 3.0 * std::sin(static_cast<double>(row) / 90.0);
    alone_degC += 0.05 * chance();
    run.values[0].push_back(60.0 * static_cast<double>(row));
    run.values[1].push_back(20.0 + slow_K);
    run.values[2].push_back(25.0 + 2.0 * slow_K + 0.1 * chance());
    run.values[3].push_back(alone_degC);
  }
  run.selected_end = rows;
  return run;
}

}  // namespace

TEST_CASE("the covariance is that of the record, whatever its level and its gaps",
          "[cli][covariance]") {
  RunFile run = run_of(2000);
  const CovarianceFit fit = fit_covariance({&run, 1}, inputs);
  CHECK(fit.rows == 2000);
  CHECK(fit.hours == Approx(2000.0 / 60.0));
  CHECK(fit.matrix_K2[0][1] == Approx(2.0 * fit.matrix_K2[0][0]).epsilon(0.02));
  CHECK(fit.matrix_K2[0][0] == Approx(4.5).epsilon(0.1));
  // An hour after its loss, only an input that follows another is known well.
  CHECK(fit.sd_1h_K[0] < 0.2);
  CHECK(fit.sd_1h_K[2] > 0.2);
  CHECK(fit.growth.drift_factor.size() == 3);
  std::vector<RunFile> runs{run, run};
  for (double& temp_degC : runs[1].values[2]) temp_degC += 40.0;
  runs[1].values[1][7] = std::nan("");
  const CovarianceFit two = fit_covariance(runs, inputs);
  CHECK(two.rows == 3999);
  CHECK(two.matrix_K2[1][1] == Approx(fit.matrix_K2[1][1]).epsilon(0.01));
}

TEST_CASE("only selected rows are used, and too few are refused", "[cli][covariance]") {
  RunFile run = run_of(2000);
  run.selected_begin = 500;
  run.selected_end = 1000;
  CHECK(fit_covariance({&run, 1}, inputs).rows == 500);
  run.selected_end = 600;
  CHECK_THROWS_AS(fit_covariance({&run, 1}, inputs), ConfigurationError);
  CHECK_THROWS_WITH(fit_covariance({&run, 1}, {"a_degC", "d_degC"}),
                    Catch::Matchers::Contains("d_degC"));
}

TEST_CASE("an input that never changed has a variance above zero", "[cli][covariance]") {
  RunFile run = run_of(2000);
  std::fill(run.values[3].begin(), run.values[3].end(), 21.0);
  const CovarianceFit fit = fit_covariance({&run, 1}, inputs);
  CHECK(fit.sd_1h_K[2] > 0.0);
  CHECK(std::isfinite(fit.sd_1h_K[2]));
}

TEST_CASE("a model file keeps all but its old covariance, comments too", "[cli][covariance]") {
  const std::string head =
      "# mine\nformat = 1\ninputs = [\"a_degC\", \"b_degC\"]\noutputs = [\"z_um\"]\n"
      "reference = \"first_sample\"   # so\nmatrix_um_per_K = [\n  [1.0, 2.0],\n]\n";
  const std::string old = "\n[covariance]\nmatrix_K2 = [\n[1.0, 0.0],\n  [0.0, 1.0],\n]\n";
  const std::string tail =
      "\n[[term]] # t\nkind = \"thermal_lag\"\nsubject = \"a_degC\"\ntau_s = 9.0\n"
      "gain_um_per_K = { z_um = 1.0 }\n";
  std::string with_old = head;
  with_old.append(old);
  std::string with_tail = with_old;
  with_tail.append(tail);
  for (const std::string& text : {head, with_old, with_tail}) {
    ThermalModel model = parse_model(text, "m");
    model.covariance_K2 = {{5.0, 1.0}, {1.0, 6.0}};
    model.covariance_growth.drift_factor = {2.5, 3.5};
    const std::string made = with_covariance(text, model);
    CHECK(made.find("# mine") == 0);
    CHECK(write_model(parse_model(made, "made")) == write_model(model));
  }
}
