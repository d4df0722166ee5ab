// Proving move of an axis, by which an indicator confirms its sign.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "axis_bench.hpp"

using namespace thermocomp;
using namespace thermocomp::test;
using namespace std::chrono_literals;

TEST_CASE("a proving move goes out and back and ends where it began", "[axis]") {
  Bench bench;
  bench.steps(50, 4.0);
  bench.prove(6.0);
  CHECK(bench.axis().proving());
  double largest_um = 0.0;
  int steps = 0;
  double before_um = bench.axis().offset_um();
  while (bench.axis().proving() && steps < 1000) {
    bench.step(-30.0);  // the compensation pauses
    if (bench.axis().proving()) CHECK(bench.axis().offset_um() >= 4.0);
    CHECK(std::abs(bench.axis().offset_um() - before_um) <= 0.2 + 1e-12);
    before_um = bench.axis().offset_um();
    largest_um = std::max(largest_um, before_um);
    ++steps;
  }
  CHECK(largest_um == 10.0);
  CHECK(bench.axis().offset_um() == 4.0);
  CHECK(steps >= 30 + 30 + 30);  // 3 s out, 3 s there, 3 s back
  bench.step(-30.0);
  CHECK(bench.axis().offset_um() == Approx(3.8));
}

TEST_CASE("a proving move is one of the tool: the offset goes by the axis' sign", "[axis]") {
  AxisConfig axis = axis_of();
  axis.sign = -1.0;
  Bench bench(true, axis);
  bench.step(0.0);
  double least_um = 0.0;
  bench.prove(6.0);
  while (bench.axis().proving()) {
    bench.step(0.0);
    least_um = std::min(least_um, bench.axis().offset_um());
  }
  CHECK(least_um == -6.0);
  CHECK(bench.axis().offset_um() == 0.0);
}

TEST_CASE("a proving move stays within the bound", "[axis]") {
  Bench bench(true, axis_of(5, 10));
  bench.steps(20, 4.0);
  bench.prove(9.0);
  double largest_um = 0.0;
  for (int i = 0; i < 200; ++i) {
    bench.step(not_a_number);
    largest_um = std::max(largest_um, bench.axis().offset_um());
  }
  CHECK(largest_um == 5.0);
  CHECK(bench.axis().offset_um() == 4.0);
  CHECK_FALSE(bench.axis().proving());
}

TEST_CASE("a proving move that is too long, NaN or of an axis not driven is ignored", "[axis]") {
  Bench bench;
  bench.prove(5.0);
  CHECK_FALSE(bench.axis().proving());
  bench.step(0.0);
  for (const double move_um : {10.1, -10.1, not_a_number}) {
    bench.prove(move_um);
    CHECK_FALSE(bench.axis().proving());
  }
  bench.prove(-10.0);
  CHECK(bench.axis().proving());
}

TEST_CASE("losing the link ends a proving move", "[axis]") {
  Bench bench;
  bench.steps(5, 0.0);
  bench.prove(5.0);
  bench.steps(5, 0.0);
  bench.input.link_epoch = 2;
  bench.input.online = false;
  bench.step(0.0);
  CHECK_FALSE(bench.axis().proving());
}
