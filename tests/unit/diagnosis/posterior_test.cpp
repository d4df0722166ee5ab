#include "modelling/diagnosis/evidence/posterior.hpp"

#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/false_reading.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/evidence/headroom.hpp"
#include "modelling/diagnosis/hypothesis/hypothesis.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

Hypothesis hypothesis(const char* cause, const char* subject) {
  Hypothesis of;
  of.cause = cause;
  of.subject = subject;
  return of;
}

Explanation explanation(const Hypothesis& of, double score, double log_left) {
  Explanation each;
  each.hypothesis = &of;
  each.score = score;
  each.log_left = log_left;
  each.left_out_gain = each.left_out_gain_of_best = 1.0 - std::exp(log_left);
  return each;
}

/// t1 and t2 move alike, t3 does not; the model has t1 with a lag, and leaves 2 (t3 lagged).
RunFile two_bodies(int rows) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 0.05);
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s", "t1_degC", "t2_degC", "t3_degC", "z_um"};
  run.values.resize(5);
  double late_K = 0.0;
  for (int row = 0; row < rows; ++row) {
    const double one_K = 5.0 * std::sin(row / 60.0);
    const double other_K = 4.0 * std::sin(row / 23.0 + 1.0) - 4.0 * std::sin(1.0);
    late_K += (other_K - late_K) * -std::expm1(-60.0 / 900.0);
    run.values[0].push_back(60.0 * row);
    run.values[1].push_back(20.0 + one_K);
    run.values[2].push_back(22.0 + 0.8 * one_K + noise(random));
    run.values[3].push_back(21.0 + other_K);
    run.values[4].push_back(5.0 * one_K + 2.0 * late_K + noise(random));
  }
  run.selected_end = run.rows();
  return run;
}

ThermalModel model_of_one() {
  ThermalModel model;
  model.inputs = {"t1_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{5.0}};
  return model;
}

ThermalModel model_with_lag() {
  ThermalModel model = model_of_one();
  model.terms.push_back(
      {"thermal_lag", "t1_degC", {{"tau_s", 900.0}}, {{"gain_um_per_K", {{"z_um", 2.0}}}}});
  return model;
}

/// t1 settles at 5 um/K, of which 2 are at once; t3 acts late alone.
ThermalModel model_with_bank() {
  ThermalModel model = model_of_one();
  model.inputs = {"t1_degC", "t3_degC"};
  model.matrix_um_per_K = {{2.0, 0.0}};
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = {"t3_degC", "t1_degC"};
  term.bank.taus_s = {300.0, 900.0};
  term.bank.gain_um_per_unit["z_um"] = {{0.3, 0.6}, {1.0, 2.0}};
  model.terms.push_back(std::move(term));
  return model;
}

MeasuredData data_of(const ThermalModel& model, int rows) {
  const std::vector<RunFile> runs = {two_bodies(rows)};
  return training_data(model, runs, {"run.csv"}, shared_columns(model, runs));
}

}  // namespace

TEST_CASE("probabilities of explanations, families and nothing add to one", "[diagnosis]") {
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  const Hypothesis heat = hypothesis("missing_heat_source", "spindle_rpm");
  const Posterior all =
      posterior({explanation(heat, 200.0, -0.8), explanation(lag, 90.0, -0.5)}, Round::first);
  CHECK(all.of[0] + all.of[1] + all.none == Approx(1.0));
  CHECK(all.families.at("heat") == Approx(all.of[0]));
  CHECK(all.families.at("structure") == Approx(all.of[1]));
  CHECK(all.of[0] > all.of[1]);
}

TEST_CASE("what takes nothing of rows left out is no explanation", "[diagnosis]") {
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  CHECK(posterior({}, Round::first).none == 1.0);
  CHECK(posterior({explanation(lag, 10.0, -0.02)}, Round::first).none > 0.9);
  CHECK(posterior({explanation(lag, 2000.0, -1.5)}, Round::first).none < 0.1);
}

TEST_CASE("beside what is named already the same evidence makes a cause less likely",
          "[diagnosis]") {
  const Hypothesis heat = hypothesis("missing_heat_source", "spindle_rpm");
  const std::vector<Explanation> alone = {explanation(heat, 200.0, -0.8)};
  CHECK(posterior(alone, Round::first).of.front() > 0.85);
  CHECK(posterior(alone, Round::later).none > 2.0 * posterior(alone, Round::first).none);
  const std::vector<Explanation> plain = {explanation(heat, 2000.0, -2.0)};
  CHECK(posterior(plain, Round::later).of.front() > 0.85);
}

TEST_CASE("a cause among rivals that take as much is less likely than one alone", "[diagnosis]") {
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  const Hypothesis other_lag = hypothesis("thermal_lag", "t3_degC");
  const Hypothesis heat = hypothesis("missing_heat_source", "spindle_rpm");
  const Hypothesis drift = hypothesis("displacement_drift", "z_um");
  const auto odds_of_first = [](const std::vector<Explanation>& all) {
    const Posterior of = posterior(all, Round::first);
    return of.of[0] / of.none;
  };
  const Explanation first = explanation(lag, 200.0, -0.8);
  const double alone = odds_of_first({first});
  const double beside_place = odds_of_first({first, explanation(other_lag, 190.0, -0.78)});
  CHECK(beside_place < alone);
  CHECK(odds_of_first({first, explanation(other_lag, 190.0, -0.3)}) == Approx(alone));
  CHECK(odds_of_first({first, explanation(heat, 190.0, -0.78)}) == Approx(alone));
  CHECK(odds_of_first({first, explanation(heat, 190.0, -0.82)}) < alone);
  // Less of a rival where its likelihood is far behind.
  const double beside_unlikely = odds_of_first({first, explanation(other_lag, -2000.0, -0.78)});
  CHECK(beside_unlikely > beside_place);
  CHECK(beside_unlikely < alone);
  // Far behind the likeliest.
  CHECK(odds_of_first({first, explanation(drift, 2000.0, -0.1)}) < alone);
}

TEST_CASE("what helps one output and makes all together worse is doubted", "[diagnosis]") {
  Hypothesis lag = hypothesis("thermal_lag", "spindle_degC");
  lag.shape = {{"tau_s", {60.0, 600.0}}};
  Explanation each = explanation(lag, 1475.0, -1.03);
  each.gains = {Eigen::VectorXd::Ones(1)};
  CHECK(posterior({each}, Round::first).none < 0.2);
  each.left_out_gain = -0.31;
  CHECK(posterior({each}, Round::first).none > 0.5);
}

TEST_CASE("what the other sensors say of a fault of a reading counts", "[diagnosis]") {
  const Hypothesis step = hypothesis("sensor_step", "t1_degC");
  const auto probability = [&](double witness) {
    Explanation each = explanation(step, 100.0, -0.3);
    add_witness(each, witness);
    CHECK(each.score == 100.0 + witness);
    return posterior({each}, Round::first).of.front();
  };
  CHECK(probability(1500.0) > 0.8);
  CHECK(probability(0.0) < probability(1500.0));
  CHECK(probability(-1500.0) < probability(0.0));
}

TEST_CASE("of two explanations the one that was free to choose more is less likely",
          "[diagnosis]") {
  Hypothesis late = hypothesis("slow_sensor", "t1_degC");
  late.form = Form::no_gain;
  late.shape = {{"tau_s", {60.0, 600.0}}};
  Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  lag.shape = late.shape;
  Explanation fixed = explanation(late, 200.0, -0.8);
  Explanation free = explanation(lag, 200.0, -0.8);
  fixed.gains = free.gains = {Eigen::VectorXd::Ones(1), Eigen::VectorXd::Ones(1)};
  CHECK(free_parameters(fixed) == 1);
  CHECK(free_parameters(free) == 3);
  CHECK(posterior({fixed}, Round::first).of.front() > posterior({free}, Round::first).of.front());
  lag.shape.front().discrete = true;
  CHECK(free_parameters(free) == 2);
  lag.form = Form::shared_gain;
  CHECK(free_parameters(free) == 1);
}

TEST_CASE("places that move alike are one group, whose probabilities add", "[diagnosis]") {
  const MeasuredData data = data_of(model_of_one(), 600);
  const PlaceGroups groups = place_groups(data);
  CHECK(groups.at("t1_degC").size() == 2);
  CHECK(groups.at("t3_degC") == std::vector<std::string>{"t3_degC"});
  CHECK(same_places(groups, "t1_degC|x_mm", "t2_degC|x_mm"));
  CHECK_FALSE(same_places(groups, "t1_degC", "t3_degC"));
  CHECK(group_of(groups, "t2_degC") == std::vector<std::string>{"t2_degC", "t1_degC"});
  const Hypothesis one = hypothesis("thermal_lag", "t1_degC");
  const Hypothesis other = hypothesis("thermal_lag", "t2_degC");
  const std::vector<Explanation> both = {explanation(one, 300.0, -0.9),
                                         explanation(other, 290.0, -0.89)};
  const Posterior all = posterior(both, Round::first);
  CHECK(probability_of_group(both, all, groups, 1) == Approx(all.of[0] + all.of[1]));
}

TEST_CASE("a place between two others is not named in their place", "[diagnosis]") {
  const PlaceGroups groups = {{"t1_degC", {"t1_degC", "t2_degC"}},
                              {"t2_degC", {"t2_degC", "t1_degC", "t3_degC"}},
                              {"t3_degC", {"t3_degC", "t2_degC"}}};
  const Hypothesis first = hypothesis("nonlinear_expansion", "t1_degC");
  const Hypothesis between = hypothesis("nonlinear_expansion", "t2_degC");
  const Hypothesis last = hypothesis("nonlinear_expansion", "t3_degC");
  const std::vector<Explanation> all = {explanation(first, 1100.0, -3.0),
                                        explanation(between, 600.0, -1.6),
                                        explanation(last, 600.0, -1.5)};
  const Posterior of = posterior(all, Round::first);
  REQUIRE(probability_of_group(all, of, groups, 1) > probability_of_group(all, of, groups, 0));
  CHECK(likeliest(all, of, groups) == 0);
}

TEST_CASE("a cause that is clear at places that are not is named with them", "[diagnosis]") {
  const Hypothesis first = hypothesis("missing_temperature", "t1_degC");
  const Hypothesis other = hypothesis("missing_temperature", "t3_degC");
  const Hypothesis unlikely = hypothesis("missing_temperature", "t4_degC");
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  Hypothesis drift = hypothesis("displacement_drift", "z_um");
  drift.output = 0;
  const std::vector<Explanation> all = {
      explanation(first, 300.0, -1.0), explanation(other, 298.0, -1.02),
      explanation(drift, 290.0, -1.2), explanation(lag, 280.0, -0.8),
      explanation(unlikely, 10.0, -0.1)};
  const Posterior of = posterior(all, Round::first);
  REQUIRE(of.of[2] > of.of[0]);
  const CauseAnywhere cause = cause_anywhere(all, of);
  CHECK(cause.likeliest == (of.of[0] > of.of[1] ? 0 : 1));
  CHECK(cause.probability == Approx(of.of[0] + of.of[1] + of.of[4]));
  CHECK(cause.others == std::vector<std::string>{cause.likeliest == 0 ? "t3_degC" : "t1_degC"});
  CHECK(group_of({{"t1_degC", {"t1_degC", "t2_degC"}}}, "t1_degC", {"t3_degC", "t2_degC|x_mm"}) ==
        std::vector<std::string>{"t1_degC", "t2_degC", "t3_degC", "x_mm"});
  CHECK(cause_anywhere({}, posterior({}, Round::first)).probability == 0.0);
}

TEST_CASE("what recorded places predict is told from what they do not", "[diagnosis]") {
  const MeasuredData data = data_of(model_of_one(), 900);
  const StackedRows rows = stacked_rows(data);
  const OutputEvidence evidence(data, rows, 0);
  CHECK(predictable_share(rows, evidence, lag_bank(data, rows)) > 0.8);
  const Headroom of = headroom(0.1, 0.5, 0.7);
  CHECK(of.named == Approx(0.45));
  CHECK(of.predictable == Approx(0.25));
  CHECK(of.noise + of.named + of.predictable + of.not_recorded == Approx(1.0));
}

TEST_CASE("a false reading acts through every term as the prediction does", "[diagnosis]") {
  const auto [name, model] = GENERATE(values<std::pair<const char*, ThermalModel>>(
      {{"lag", model_with_lag()}, {"bank of lags", model_with_bank()}}));
  INFO(name);
  const MeasuredData data = data_of(model, 300);
  REQUIRE(has_terms_of(data.model, 0));
  const MeasuredRun& run = data.runs.front();
  Panel errors_K = Panel::Zero(run.rows(), 2);
  errors_K.col(0).tail(100).setOnes();
  errors_K.col(1).setLinSpaced(-0.5, 2.0);
  Panel answers_um = errors_K;
  answer_to_errors(data, run, 0, 0, answers_um);
  for (Eigen::Index i = 0; i < errors_K.cols(); ++i) {
    MeasuredRun wrong = run;
    wrong.inputs_K[0] += errors_K.col(i);
    const Column expected = model_over(model, wrong, data)[0] - model_over(model, run, data)[0];
    CHECK((answers_um.col(i) - expected).cwiseAbs().maxCoeff() < 1e-9);
  }
  CHECK(answers_um(201, 0) < 3.5);
  CHECK(answers_um(299, 0) > 4.9);
}

TEST_CASE("faults of a reading have the columns that a prediction with them has", "[diagnosis]") {
  const ThermalModel model = model_with_bank();
  const MeasuredData data = data_of(model, 300);
  const MeasuredRun& run = data.runs.front();
  const Column right_um = model_over(model, run, data)[0];
  std::size_t faults = 0;
  for (const Hypothesis& fault : hypotheses(data, stacked_rows(data))) {
    if (!fault.sensor || *fault.sensor != 0) continue;
    const Shape shape = {fault.shape[0].grid[fault.shape[0].grid.size() / 3]};
    MeasuredRun wrong = run;
    wrong.inputs_K[0] += cause_named(fault.cause).error_of_reading(data, run, 0, shape[0]);
    const Column missing_um = right_um - model_over(model, wrong, data)[0];
    INFO(fault.cause);
    CHECK((fault.columns({shape}, 0).col(0) - missing_um).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(missing_um.cwiseAbs().maxCoeff() > 0.1);
    ++faults;
  }
  CHECK(faults == 3);  // step, drift, loose
}

TEST_CASE("exchanged readings and play of one act through a bank of lags", "[diagnosis]") {
  const ThermalModel model = model_with_bank();
  const MeasuredData data = data_of(model, 300);
  MeasuredRun calm = data.runs.front();
  calm.inputs_K = calm.calm_inputs_K;
  const Column before_um = model_over(model, calm, data)[0];
  for (const Hypothesis& of : hypotheses(data, stacked_rows(data))) {
    const bool play = of.cause == "hysteresis" && of.subject == "t1_degC";
    if (of.cause != "sensor_swap" && !play) continue;
    const Shape shape = play ? Shape{of.shape[0].grid[5]} : Shape{};
    ThermalModel extended = model;
    extended.terms.push_back({of.cause, of.subject, {}, {}});
    if (play) extended.terms.back().shared["width_K"] = shape[0];
    const Column more_um = model_over(extended, calm, data)[0] - before_um;
    INFO(of.cause);
    CHECK((of.columns({shape}, 0).col(0) - more_um).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(more_um.cwiseAbs().maxCoeff() > 0.1);
  }
}

TEST_CASE("the lag of a place may take what coefficient and bank give it in the end",
          "[diagnosis]") {
  const MeasuredData data = data_of(model_with_bank(), 300);
  CHECK(settled_um_per_K(data, 0, 0) == Approx(5.0));
  CHECK(settled_um_per_K(data, 0, 1) == Approx(0.9));
  for (const Hypothesis& lag : hypotheses(data, stacked_rows(data))) {
    if (lag.cause != "thermal_lag" || lag.subject != "t1_degC") continue;
    CHECK(lag.possible(4.5, 0));
    CHECK_FALSE(lag.possible(-1.0, 0));
    CHECK_FALSE(lag.possible(7.0, 0));
  }
}
