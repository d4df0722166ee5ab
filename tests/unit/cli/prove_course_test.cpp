#include "cli/operate/prove_course.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using Catch::Matchers::Contains;
using nlohmann::json;
using thermocomp::cli::ProveCourse;

namespace {

json axis(double offset_um, const json& applied_um, bool proving) {
  return {{"name", "z"}, {"offset", offset_um}, {"applied", applied_um}, {"proving", proving}};
}

}  // namespace

TEST_CASE("a move there and back passes from any start", "[cli][prove]") {
  const double began_um = GENERATE(0.0, 12.5, -3.0);
  const double move_um = GENERATE(5.0, -5.0);
  const double sign = GENERATE(1.0, -1.0);  // of the axis
  ProveCourse course(sign * move_um, axis(began_um, began_um + 0.1, false));
  course.take(axis(began_um + 0.5 * move_um, began_um + 0.4 * move_um, true));
  CHECK_FALSE(course.over());
  CHECK_THAT(course.progress(), Contains("sent ") && Contains("read back "));
  course.take(axis(began_um + move_um, began_um + 0.98 * move_um, true));
  CHECK_FALSE(course.passed());
  course.take(axis(began_um, began_um + move_um, false));  // its read-back is late
  CHECK(course.over());
  CHECK_FALSE(course.is_back());
  course.take(axis(began_um, began_um + 0.1 * move_um, false));
  CHECK(course.is_back());
  CHECK_FALSE(course.is_settled());  // still on its way
  course.take(axis(began_um, began_um + 0.1, false));
  CHECK(course.is_settled());
  CHECK(course.passed());
  CHECK_THAT(course.verdict("z"), Contains("axis z: moved and came back"));
}

TEST_CASE("a controller that does not move fails, with what was read", "[cli][prove]") {
  ProveCourse course(5.0, axis(0.0, 0.0, false));
  course.take(axis(5.0, 0.02, true));
  course.take(axis(0.0, 0.01, false));
  CHECK_FALSE(course.passed());
  CHECK_THAT(course.verdict("z"),
             Contains("did NOT move as commanded") &&
                 Contains("sent +5.00 um at the farthest, read back +0.02 um"));
}

TEST_CASE("a controller that moves the other way fails as such", "[cli][prove]") {
  ProveCourse course(5.0, axis(0.0, 0.0, false));
  course.take(axis(5.0, -4.9, true));
  course.take(axis(0.0, 0.0, false));
  CHECK_FALSE(course.passed());
  CHECK_THAT(course.verdict("z"), Contains("the OTHER way") && Contains("-4.90 um"));
}

TEST_CASE("an axis that stays where it was moved to fails", "[cli][prove]") {
  ProveCourse course(5.0, axis(0.0, 0.0, false));
  course.take(axis(5.0, 5.0, true));
  course.take(axis(0.0, 5.0, false));
  CHECK_FALSE(course.passed());
  CHECK_THAT(course.verdict("z"), Contains("did NOT come back"));
}

TEST_CASE("a move that was ended on the way, or never begun, fails", "[cli][prove]") {
  ProveCourse ended(5.0, axis(0.0, 0.0, false));
  ended.take(axis(2.0, 2.0, true));
  ended.take(axis(0.0, 0.0, false));
  CHECK_FALSE(ended.passed());
  CHECK_THAT(ended.verdict("z"), Contains("was NOT moved all the way") && Contains("+2.00 um"));
  ProveCourse silent(5.0, axis(0.0, 0.0, false));
  CHECK_FALSE(silent.over());
  silent.take(json::object());
  CHECK_FALSE(silent.passed());
}

TEST_CASE("a move that is still under way is reported as such", "[cli][prove]") {
  ProveCourse course(5.0, axis(0.0, 0.0, false));
  course.take(axis(2.0, 1.9, true));
  CHECK_FALSE(course.passed());
  CHECK_THAT(course.verdict("z"), Contains("the move is not over: sent +2.00 um"));
}

TEST_CASE("without a read-back the offset sent is reported as unconfirmed", "[cli][prove]") {
  ProveCourse course(5.0, axis(0.0, nullptr, false));
  course.take(axis(5.0, nullptr, true));
  CHECK_THAT(course.progress(), Contains("nothing is read back"));
  course.take(axis(0.0, nullptr, false));
  CHECK(course.passed());
  CHECK_THAT(course.verdict("z"), Contains("only an indicator shows"));
}
