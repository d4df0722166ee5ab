// Completeness of the table of modes, reasons and faults.
#include "status/codes.hpp"

#include <catch2/catch.hpp>

using namespace thermocomp;

TEST_CASE("every reason has a meaning, a remedy and a name that maps back to it", "[status]") {
  for (std::size_t bit = 0; bit < reasons_count; ++bit) {
    const auto reason = static_cast<Reason>(1u << bit);
    const CodeText text = code_text(reason);
    INFO(text.name);
    CHECK(text.meaning != text.name);
    CHECK_FALSE(text.remedy.empty());
    CHECK(text.remedy.find("thermocomp ") ==
          std::string_view::npos);  // remedies are also shown on pages
    CHECK(reason_named(text.name) == reason);
  }
  CHECK_FALSE(reason_named("no such reason"));
}

TEST_CASE("every fault has a meaning and a name that maps back to it", "[status]") {
  for (std::size_t i = 0; i < faults_count; ++i) {
    const auto fault = static_cast<Fault>(i);
    const CodeText text = code_text(fault);
    INFO(text.name);
    CHECK(text.meaning != text.name);
    CHECK(fault_named(text.name) == fault);
    CHECK(text.remedy.find("thermocomp ") == std::string_view::npos);
    CHECK((text.severity == Severity::normal) == (fault == Fault::none));
  }
}

TEST_CASE("a dry run is a name of the mode `compensating`", "[status]") {
  for (const Mode mode :
       {Mode::starting, Mode::disabled, Mode::compensating, Mode::holding, Mode::ramping_to_zero})
    for (const bool dry_run : {false, true})
      CHECK(mode_named(code_text(mode, dry_run).name) == mode);
  CHECK(code_text(Mode::compensating, true).name == "dry_run");
  CHECK(code_text(Mode::holding, true).name == "holding");
}

TEST_CASE("reasons are listed worst first", "[status]") {
  const auto set = static_cast<std::uint32_t>(Reason::cutting) |
                   static_cast<std::uint32_t>(Reason::at_bound) |
                   static_cast<std::uint32_t>(Reason::not_written);
  CHECK(by_severity(set) ==
        std::vector<Reason>{Reason::not_written, Reason::at_bound, Reason::cutting});
}
