#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "modelling/diagnosis/rank/search.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

Hypothesis hypothesis(const char* cause, const char* subject) {
  Hypothesis of;
  of.cause = cause;
  of.subject = subject;
  return of;
}

/// @param left_out  ln of the RMS before over after
Explanation explanation(const Hypothesis& of, double score, double left_out) {
  Explanation each;
  each.hypothesis = &of;
  each.gains = {Eigen::VectorXd::Ones(1)};
  each.score = score;
  each.left_out = each.left_out_of_best = left_out;
  return each;
}

double none_beside(std::vector<Explanation> all, Round round = Round::first) {
  return weigh_against_each_other(all, round).none;
}

}  // namespace

TEST_CASE("probabilities of explanations, families and none add up to one", "[diagnosis]") {
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  const Hypothesis heat = hypothesis("missing_heat_source", "spindle_rpm");
  std::vector<Explanation> all = {explanation(heat, 100.0, 0.9), explanation(lag, 45.0, 0.5)};
  const Posterior posterior = weigh_against_each_other(all, Round::first);
  CHECK(all[0].probability + all[1].probability + posterior.none == Approx(1.0));
  CHECK(posterior.families.at("heat") == Approx(all[0].probability));
  CHECK(posterior.families.at("structure") == Approx(all[1].probability));
  CHECK(posterior.families.at("none") == Approx(posterior.none));
  CHECK(all[0].probability > all[1].probability);
}

TEST_CASE("an explanation without cross-validated gain is unlikely", "[diagnosis]") {
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  CHECK(none_beside({}) == 1.0);
  CHECK(none_beside({explanation(lag, 5.0, 0.02)}) > 0.9);
  CHECK(none_beside({explanation(lag, 500.0, 1.5)}) < 0.1);
}

TEST_CASE("the same evidence gives a lower probability in later rounds", "[diagnosis]") {
  const Hypothesis heat = hypothesis("missing_heat_source", "spindle_rpm");
  const std::vector<Explanation> alone = {explanation(heat, 60.0, 0.8)};
  CHECK(none_beside(alone, Round::later) > none_beside(alone));
}

TEST_CASE("fitted coefficients lower the probability of a lag, not of a datum cause",
          "[diagnosis]") {
  const Hypothesis line = hypothesis("periodic_disturbance", "x_um");
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  const auto none_of = [](const Hypothesis& of, bool beside_fit) {
    std::vector<Explanation> alone = {explanation(of, 60.0, 0.8)};
    return weigh_against_each_other(alone, Round::first, beside_fit).none;
  };
  CHECK(none_of(line, true) == none_of(line, false));
  CHECK(none_of(lag, true) > none_of(lag, false));
}

TEST_CASE("evidence of the reading itself changes the utility of its fault", "[diagnosis]") {
  const Hypothesis step = hypothesis("sensor_step", "t1_degC");
  const auto utility_of = [&](double witness) {
    Explanation each = explanation(step, 50.0 + witness, 0.3);
    each.witness = witness;
    return utility(each);
  };
  CHECK(utility_of(0.0) < utility_of(500.0));
  CHECK(utility_of(-500.0) < utility_of(0.0));
}

TEST_CASE("one gain more lowers the utility", "[diagnosis]") {
  Hypothesis wrong = hypothesis("wrong_coefficient", "t1_degC");
  wrong.gains = {"delta_um_per_K"};
  Hypothesis along = hypothesis("position_dependence", "t1_degC|x_mm");
  along.gains = {"gain_um_per_K_mm", "p0_mm"};
  CHECK(utility(explanation(along, 100.0, 0.8)) < utility(explanation(wrong, 100.0, 0.8)));
}

TEST_CASE("a cause gets no weight if its special case explains nearly as much", "[diagnosis]") {
  Hypothesis room = hypothesis("missing_temperature", "room_degC");
  room.gains = {"gain_um_per_K"};
  Hypothesis heat = hypothesis("missing_heat_source", "spindle_rpm");
  heat.gains = {"gain_um_per_unit", "gain_um_per_K"};
  heat.simpler_cause = room.cause;
  heat.simpler_subject = room.subject;
  const auto share_of_heat = [&](double score, double left_out) {
    std::vector<Explanation> both = {explanation(room, 100.0, 0.8),
                                     explanation(heat, score, left_out)};
    CHECK(weigh_against_each_other(both, Round::first).none < 0.5);
    return both[1].probability;
  };
  CHECK(share_of_heat(99.0, 2.0) == 0.0);
  CHECK(share_of_heat(101.0, 0.85) == 0.0);
  CHECK(share_of_heat(200.0, 1.2) > 0.5);
}

TEST_CASE("the probabilities of indistinguishable places add up", "[diagnosis]") {
  const PlaceGroups groups = {{"t1_degC", {"t1_degC", "t2_degC"}},
                              {"t2_degC", {"t2_degC", "t1_degC"}},
                              {"t3_degC", {"t3_degC"}}};
  CHECK(same_places(groups, "t1_degC|x_mm", "t2_degC|x_mm"));
  CHECK_FALSE(same_places(groups, "t1_degC", "t3_degC"));
  CHECK(group_of(groups, "t2_degC") == std::vector<std::string>{"t2_degC", "t1_degC"});
  const Hypothesis one = hypothesis("thermal_lag", "t1_degC");
  const Hypothesis other = hypothesis("thermal_lag", "t2_degC");
  const Hypothesis third = hypothesis("hysteresis", "t3_degC");
  std::vector<Explanation> all = {explanation(one, 0, 0), explanation(other, 0, 0),
                                  explanation(third, 0, 0)};
  all[0].probability = 0.3;
  all[1].probability = 0.25;
  all[2].probability = 0.4;
  const Choice choice = likeliest(all, groups);
  CHECK(choice.index == 0);
  CHECK(choice.probability == Approx(0.55));
}

TEST_CASE("a place between two likelier ones is not named instead of them", "[diagnosis]") {
  const PlaceGroups groups = {{"t1_degC", {"t1_degC", "t2_degC"}},
                              {"t2_degC", {"t2_degC", "t1_degC", "t3_degC"}},
                              {"t3_degC", {"t3_degC", "t2_degC"}}};
  const Hypothesis first = hypothesis("nonlinear_expansion", "t1_degC");
  const Hypothesis between = hypothesis("nonlinear_expansion", "t2_degC");
  const Hypothesis last = hypothesis("nonlinear_expansion", "t3_degC");
  std::vector<Explanation> all = {explanation(first, 0, 0), explanation(between, 0, 0),
                                  explanation(last, 0, 0)};
  all[0].probability = 0.6;
  all[1].probability = 0.1;
  all[2].probability = 0.2;
  CHECK(likeliest(all, groups).index == 0);
}

TEST_CASE("a likely cause at ambiguous places is named with all of them", "[diagnosis]") {
  const Hypothesis first = hypothesis("missing_temperature", "t1_degC");
  const Hypothesis other = hypothesis("missing_temperature", "t3_degC");
  const Hypothesis unlikely = hypothesis("missing_temperature", "t4_degC");
  const Hypothesis lag = hypothesis("thermal_lag", "t1_degC");
  std::vector<Explanation> all = {explanation(lag, 0, 0), explanation(first, 0, 0),
                                  explanation(other, 0, 0), explanation(unlikely, 0, 0)};
  all[0].probability = 0.4;
  all[1].probability = 0.3;
  all[2].probability = 0.25;
  all[3].probability = 0.01;
  const Choice choice = likeliest(all, {});
  CHECK(choice.index == 1);
  CHECK(choice.probability == Approx(0.56));
  CHECK(choice.other_subjects == std::vector<std::string>{"t3_degC"});
  CHECK(group_of({{"t1_degC", {"t1_degC", "t2_degC"}}}, "t1_degC", {"t3_degC", "t2_degC|x_mm"}) ==
        std::vector<std::string>{"t1_degC", "t2_degC", "t3_degC", "x_mm"});
}
