#include "config/text/units.hpp"

#include "files.hpp"

using namespace thermocomp;

TEST_CASE("the unit is the longest registered suffix", "[config][units]") {
  CHECK(unit_of("t1_degC").symbol == "degC");
  CHECK(unit_of("difference_K").kind == QuantityKind::temperature);
  CHECK(unit_of("z_um").kind == QuantityKind::displacement);
  CHECK(unit_of("b_urad").kind == QuantityKind::tilt);
  CHECK(unit_of("x_mm").kind == QuantityKind::position);
  CHECK(unit_of("feed_mm_per_min").symbol == "mm/min");
  CHECK(unit_of("feed_mm_per_min").kind == QuantityKind::signal);
  CHECK(unit_of("coolant_on").suffix == "_on");
  CHECK(unit_of("time_s").kind == QuantityKind::time);
}

TEST_CASE("a column without a registered suffix is a signal without unit", "[config][units]") {
  for (const char* name : {"load", "tool", "x_cm", "degC", "_degC", "t_degc", "dwell_s"}) {
    INFO(name);
    CHECK(unit_of(name).symbol.empty());
    CHECK(kind_of(name) == QuantityKind::signal);
  }
}

TEST_CASE("names that a run file cannot contain are not column names", "[config][units]") {
  for (const char* name : {"t1_degC", "oil temperature_degC", "\xC3\xB6l_degC"}) {
    CHECK(is_column_name(name));
  }
  for (const char* name : {"", " a", "a ", "#a", "a,b", "a\"b", "a|b", "a\nb", "a\tb"}) {
    INFO(name);
    CHECK_FALSE(is_column_name(name));
  }
}
