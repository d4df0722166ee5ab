// Probings until a candidate is called better, and the rate of false calls. The errors of both
// models are autocorrelated, half in common, with noise of the probe.
// `cycle_test "[contest]" -s` prints the figures.
#include <cmath>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

#include "daemon/cycle/candidate.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

constexpr std::size_t lives = 1000;
constexpr std::size_t probings_max = 150;

struct Errors {
  double ratio{1.0};         ///< RMS error of the candidate over that of the model
  double alike{0.5};         ///< correlation of errors an hour apart
  bool has_outliers{false};  ///< Student's t noise, three degrees of freedom
};

struct Figures {
  std::size_t probings{0};  ///< median until better with 95 %
  double better_share{0.0};
  double worse_share{0.0};
};

Figures contests(const Errors& errors, nanoseconds pitch = 1h) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  std::student_t_distribution<double> heavy(3);
  const double hours = std::chrono::duration<double, std::ratio<3600>>(pitch).count();
  const double alike = std::pow(errors.alike, hours);
  std::vector<std::size_t> until;
  Figures figures;
  for (std::size_t life = 0; life < lives; ++life) {
    std::array<double, 3> part{normal(random), normal(random), normal(random)};
    ModelContest contest;
    std::size_t better_at = probings_max + 1;
    std::size_t worse_at = probings_max + 1;
    for (std::size_t i = 1; i <= probings_max; ++i) {
      const double noise_um = 0.3 * (errors.has_outliers ? heavy(random) : normal(random));
      const double model_um = std::sqrt(0.5) * (part[0] + part[1]) + noise_um;
      const double candidate_um = errors.ratio * std::sqrt(0.5) * (part[0] + part[2]) + noise_um;
      contest.take(0, static_cast<int>(i) * pitch, model_um, candidate_um);
      for (double& each : part)
        each = alike * each + std::sqrt(1.0 - alike * alike) * normal(random);
      const ModelContest::Chances chances = ModelContest::chances(contest.score());
      if (chances.better >= 0.95) better_at = std::min(better_at, i);
      if (chances.worse >= 0.95) worse_at = std::min(worse_at, i);
    }
    until.push_back(better_at);
    figures.better_share += better_at <= probings_max ? 1.0 / lives : 0.0;
    figures.worse_share += worse_at < better_at ? 1.0 / lives : 0.0;
  }
  std::nth_element(until.begin(), until.begin() + lives / 2, until.end());
  figures.probings = until[lives / 2];
  INFO("ratio " << errors.ratio << ", alike " << errors.alike << ", outliers "
                << errors.has_outliers << ": better after " << figures.probings
                << " probings (median), in " << 100.0 * figures.better_share
                << " %, worse first in " << 100.0 * figures.worse_share << " %");
  SUCCEED("printed with -s");
  return figures;
}

}  // namespace

TEST_CASE("a model of half the error is called better after about 30 probings", "[contest]") {
  const double alike = GENERATE(0.0, 0.5, 0.7);
  const Figures figures = contests({0.5, alike, GENERATE(false, true)});
  CHECK(figures.probings <= 36);
  CHECK(figures.better_share > 0.98);
  CHECK(figures.worse_share < 0.01);
}

TEST_CASE("probings two hours apart decide sooner", "[contest]") {
  CHECK(contests({0.5, 0.5}, 2h).probings <= 26);
}

TEST_CASE("an equal or worse model is seldom called better", "[contest]") {
  const double alike = GENERATE(0.0, 0.5);
  CHECK(contests({1.0, alike, GENERATE(false, true)}).better_share <= 0.05);
  CHECK(contests({1.2, alike}).better_share <= 0.02);
}

TEST_CASE("equal errors decide nothing, and unknown ones are not counted", "[contest]") {
  ModelContest contest;
  for (int i = 0; i < 100; ++i) contest.take(1, i * 1h, 2.0, -2.0);
  contest.take(1, 100h, not_a_number, 1.0);
  CHECK(contest.score()[1].probings == 100.0);
  CHECK(ModelContest::chances(contest.score()).better == Approx(0.25));
  CHECK(ModelContest::chances(contest.score()).worse == Approx(0.25));
}

TEST_CASE("many probings at once count as one", "[contest]") {
  ModelContest once;
  ModelContest often;
  once.take(0, 1h, 3.0, 0.1);
  for (int i = 0; i < 50; ++i) often.take(0, 1h, 3.0, 0.1);
  CHECK(ModelContest::chances(often.score()).better ==
        Approx(ModelContest::chances(once.score()).better));
}
