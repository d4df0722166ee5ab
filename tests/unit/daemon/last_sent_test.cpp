// The last-sent record across the end of a process at any moment.
#include "daemon/recording/last_sent.hpp"

#include <cmath>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include <catch2/catch.hpp>

#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

std::vector<AxisConfig> two_axes(double sign_of_x = 1.0) {
  return {{"z", "z_um", 1.0, {}, {}}, {"x", "x_um", sign_of_x, {}, {}}};
}

OffsetCommand command(double z_um, double x_um, bool x_is_driven = true) {
  OffsetCommand made;
  made.offset_um = {z_um, x_um};
  made.valid = {true, x_is_driven};
  return made;
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

Offsets left_in(const std::filesystem::path& file, const std::vector<AxisConfig>& axes = two_axes(),
                const std::string& controller = "cnc") {
  return LastSent(file, controller, axes).before();
}

}  // namespace

TEST_CASE("the next process finds the offsets sent last", "[last_sent]") {
  const TempFolder folder;
  CHECK(left_in(folder / "sent").empty());
  {
    LastSent sent(folder / "sent", "cnc", two_axes());
    sent.note(command(-3.25, 7.0), 0);
    sent.note(command(-3.5, 99.0, false), 0);
  }
  CHECK(left_in(folder / "sent") == Offsets{{"z", -3.5}, {"x", 7.0}});
  // Before it drives the axes, it keeps the previous process' offsets.
  CHECK(left_in(folder / "sent") == Offsets{{"z", -3.5}, {"x", 7.0}});
  {
    LastSent sent(folder / "sent", "cnc", two_axes());
    sent.note(command(-3.75, 0.0, false), 0b10);
  }
  // The controller had lost the offset of x.
  const Offsets left = left_in(folder / "sent");
  CHECK(left.at("z") == -3.75);
  CHECK(std::isnan(left.at("x")));
}

TEST_CASE("offsets for another controller, axis or sign are not used", "[last_sent]") {
  const TempFolder folder;
  { LastSent(folder / "sent", "cnc", two_axes()).note(command(1.0, 2.0), 0); }
  CHECK(left_in(folder / "sent", two_axes(), "other").empty());
  CHECK(left_in(folder / "sent", two_axes(-1.0)).empty());
  std::vector<AxisConfig> swapped = two_axes();
  std::swap(swapped[0], swapped[1]);
  CHECK(left_in(folder / "sent", swapped).empty());
  CHECK(left_in(folder / "sent").size() == 2);
}

TEST_CASE("a foreign record never reappears once an offset was sent", "[last_sent]") {
  const TempFolder folder;
  const auto file = folder / "sent";
  { LastSent(file, "cnc", two_axes()).note(command(1.0, 2.0), 0); }
  { LastSent(file, "cnc", two_axes(-1.0)).note(command(9.0, -9.0), 0); }
  // The controller has 9.0 now; the offset sent with the other sign is obsolete.
  CHECK(left_in(file).empty());
}

TEST_CASE("a record of another format is reported, and replaced once an offset is sent",
          "[last_sent]") {
  const TempFolder folder;
  const auto file = folder / "sent";
  {
    LastSent sent(file, "cnc", two_axes());
    CHECK(sent.problem().empty());
    sent.note(command(1.0, 2.0), 0);
    sent.note(command(1.5, 2.5), 0);
  }
  std::string newer = bytes_of(file);
  newer[8] = 2;
  write(file, newer);
  {
    LastSent sent(file, "cnc", two_axes());
    CHECK_THAT(sent.problem(), Catch::Contains("is of format 2, this program reads format 1"));
    CHECK(sent.before().empty());
    CHECK(bytes_of(file) == newer);
    sent.note(OffsetCommand{}, 0b11);  // the offsets of both axes are lost
    CHECK(bytes_of(file) == newer);
    sent.note(command(7.0, 8.0), 0);
  }
  CHECK(left_in(file) == Offsets{{"z", 7.0}, {"x", 8.0}});
  // The newer program finds nothing of its record.
  std::string back = bytes_of(file);
  CHECK(back[8] == 1);
  write(file, "something else that is long enough to have a format");
  CHECK_THAT(LastSent(file, "cnc", two_axes()).problem(),
             Catch::Contains("not written by this program"));
}

TEST_CASE("a process that ends while recording leaves the old or the new record", "[last_sent]") {
  const TempFolder folder;
  const auto file = folder / "sent";
  std::string before;
  std::string after;
  {
    LastSent sent(file, "cnc", two_axes());
    sent.note(command(1.0, 2.0), 0);
    sent.note(command(1.5, 2.5), 0);
    before = bytes_of(file);
    sent.note(command(-40.0, 40.0), 0);
    after = bytes_of(file);
  }
  REQUIRE(before.size() == after.size());
  std::mt19937 random(3);
  for (int i = 0; i < 400; ++i) {
    // Any subset of the differing bytes may have been stored.
    std::string torn = before;
    for (std::size_t k = 0; k < torn.size(); ++k)
      if (random() % 2 == 0) torn[k] = after[k];
    write(file, torn);
    const Offsets left = left_in(file);
    CHECK((left == Offsets{{"z", 1.5}, {"x", 2.5}} || left == Offsets{{"z", -40.0}, {"x", 40.0}}));
  }
  for (std::size_t k = 0; k < after.size(); ++k) {
    write(file, after.substr(0, k) + std::string(after.size() - k, '\xa5'));
    for (const auto& [axis, um] : left_in(file)) CHECK(std::abs(um) <= 40.0);
  }
}

TEST_CASE("a record that is not a regular file is refused", "[last_sent]") {
  const TempFolder folder;
  std::filesystem::create_directory(folder / "sent");
  CHECK_THROWS(left_in(folder / "sent"));
  std::filesystem::create_symlink(folder / "elsewhere", folder / "link");
  CHECK_THROWS(left_in(folder / "link"));
  CHECK_THROWS(left_in("/nowhere/sent"));
  write(folder / "short", "x");
  CHECK(left_in(folder / "short").empty());
}
