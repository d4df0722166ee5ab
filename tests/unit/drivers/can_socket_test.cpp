// Parts of the CAN socket that need no CAN in the kernel; the rest is in tests/vm.
#include "drivers/can/can_socket.hpp"

#include <chrono>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

TEST_CASE("a wall clock stamp becomes a monotonic time by its age", "[can]") {
  const nanoseconds realtime = 1'700'000'000s;
  const nanoseconds monotonic = 5000s;
  CHECK(monotonic_stamp(realtime - 3ms, realtime, monotonic) == monotonic - 3ms);
  CHECK(monotonic_stamp(realtime, realtime, monotonic) == monotonic);
}

TEST_CASE("a step of the wall clock makes no frame newer than now or older than a second",
          "[can]") {
  const nanoseconds realtime = 1'700'000'000s;
  const nanoseconds monotonic = 5000s;
  CHECK(monotonic_stamp(realtime + 3600s, realtime, monotonic) == monotonic);
  CHECK(monotonic_stamp(realtime - 3600s, realtime, monotonic) == monotonic - 1s);
}

TEST_CASE("a missing CAN interface is reported by name", "[can]") {
  CanSocket socket("nosuchcan0", {{0x123, false}});
  CHECK_FALSE(socket.open());
  CHECK_FALSE(socket.is_open());
  CHECK(socket.error().find("nosuchcan0") == 0);
  CHECK(socket.receive().empty());
  CHECK_FALSE(socket.send(CanFrame{}));
}

TEST_CASE("a CAN FD frame has a valid size", "[can]") {
  for (std::size_t size = 0; size <= 8; ++size) CHECK(whole_frame_bytes(size) == size);
  CHECK(whole_frame_bytes(9) == 12);
  CHECK(whole_frame_bytes(12) == 12);
  CHECK(whole_frame_bytes(33) == 48);
  CHECK(whole_frame_bytes(49) == 64);
  CHECK(whole_frame_bytes(64) == 64);
}

TEST_CASE("impossible CAN sockets are refused", "[can]") {
  CHECK_THROWS_AS(CanSocket("", {}), InvalidValue);
  CHECK_THROWS_AS(CanSocket("a_name_of_sixteen", {}), InvalidValue);
  std::vector<CanId> ids;
  for (std::uint32_t id = 0; id < 513; ++id) ids.push_back({id, true});
  CHECK_THROWS_AS(CanSocket("can0", ids), InvalidValue);
  ids.back() = ids.front();  // 512 different ones
  CHECK_NOTHROW(CanSocket("can0", ids));
}
