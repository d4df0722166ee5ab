// Locks of files and names: refusal, its message, and release.
#include "daemon/locks/locks.hpp"

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <fstream>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>

#include "daemon/controller_lock.hpp"
#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

std::string refusal(const std::function<void()>& take) {
  try {
    take();
  } catch (const LockHeld& held) {
    return held.what();
  }
  return {};
}

std::string this_process() {
  return "process " + std::to_string(getpid());
}

/// A child process that creates something and then waits.
class Child {
 public:
  explicit Child(const std::function<void()>& take) {
    int ready[2];
    REQUIRE(pipe(ready) == 0);
    process_ = fork();
    if (process_ == 0) {
      take();
      static_cast<void>(write(ready[1], "x", 1) == 1);
      for (;;) pause();
    }
    close(ready[1]);
    char byte = 0;
    REQUIRE(read(ready[0], &byte, 1) == 1);
    close(ready[0]);
  }
  ~Child() { kill(); }
  void kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = 0;
  }

 private:
  pid_t process_{0};
};

std::string own_name() {
  return "test " + std::to_string(getpid());
}

ModbusControllerConfig at(const std::string& host, int port, int unit) {
  ModbusControllerConfig config;
  config.line.link = ModbusTcp{host, port};
  config.unit = unit;
  return config;
}

}  // namespace

TEST_CASE("a locked file is refused with its holder, until released", "[locks]") {
  const TempFolder folder;
  {
    const FileLock lock(folder / "history.db");
    const std::string printed = refusal([&] { FileLock second(folder / "history.db"); });
    CHECK(printed.find((folder / "history.db").string()) != std::string::npos);
    CHECK(printed.find(this_process()) != std::string::npos);
  }
  CHECK_FALSE(std::filesystem::exists(folder / "history.db.lock"));
  const FileLock again(folder / "history.db");
}

TEST_CASE("a file has one lock, independent of the path", "[locks]") {
  const TempFolder folder;
  std::ofstream(folder / "history.db") << "x";
  std::filesystem::create_symlink(folder.path(), folder / "link");
  std::filesystem::create_symlink(folder / "history.db", folder / "other.db");
  const FileLock lock(folder / "history.db");
  CHECK_FALSE(refusal([&] { FileLock second(folder / "link/history.db"); }).empty());
  CHECK_FALSE(refusal([&] { FileLock second(folder / "link/other.db"); }).empty());
  const FileLock another(folder / "state.json");
}

TEST_CASE("a lock ends with its process, however that ends", "[locks]") {
  const TempFolder folder;
  const std::string ours = own_name();
  Child child([&] {
    new FileLock(folder / "history.db");
    new NameLock(ours);
  });
  CHECK_FALSE(refusal([&] { FileLock second(folder / "history.db"); }).empty());
  CHECK_FALSE(refusal([&] { NameLock second(ours); }).empty());
  child.kill();
  const FileLock file(folder / "history.db");
  const NameLock name(ours);
}

TEST_CASE("a lock that cannot be created is not reported as held", "[locks]") {
  const TempFolder folder;
  CHECK_THROWS_WITH(FileLock(folder / "missing/history.db"),
                    Catch::Contains("missing: there is no such folder: make it"));
  std::filesystem::create_directory(folder / "history.db.lock");
  CHECK_THROWS_AS(FileLock(folder / "history.db"), LockImpossible);
  // A link to another file is not followed either.
  std::ofstream(folder / "precious") << "x";
  std::filesystem::create_symlink(folder / "precious", folder / "state.json.lock");
  CHECK_THROWS_AS(FileLock(folder / "state.json"), LockImpossible);
}

TEST_CASE("a held name is refused with its holder", "[locks]") {
  const std::string long_name = std::string(300, 'n') + own_name();
  for (const std::string& name : {own_name(), long_name}) {
    const NameLock lock(name);
    CHECK(refusal([&] { NameLock second(name); }).find(this_process()) != std::string::npos);
    const NameLock other(name + "2");
  }
}

TEST_CASE("a lock answers any number of queries", "[locks]") {
  const std::string name = own_name();
  NameLock lock(name);
  for (int i = 0; i < 50; ++i) {
    CHECK_FALSE(refusal([&] { NameLock second(name); }).empty());
    lock.drain();
  }
}

TEST_CASE("of two processes started at the same moment exactly one gets the name", "[locks]") {
  for (int round = 0; round < 20; ++round) {
    const std::string name = own_name() + " " + std::to_string(round);
    int go[2];
    int shown[2];
    REQUIRE(pipe(go) == 0);
    REQUIRE(pipe(shown) == 0);
    std::vector<pid_t> children;
    for (int i = 0; i < 2; ++i) {
      children.push_back(fork());
      if (children.back() != 0) continue;
      char byte = 0;
      static_cast<void>(read(go[0], &byte, 1) == 1);
      try {
        new NameLock(name);
        byte = 'x';
      } catch (const LockHeld&) {
        byte = '-';
      }
      static_cast<void>(write(shown[1], &byte, 1) == 1);
      for (;;) pause();
    }
    REQUIRE(write(go[1], "ab", 2) == 2);
    std::string results(2, '?');
    for (char& result : results) CHECK(read(shown[0], &result, 1) == 1);
    CHECK(std::count(results.begin(), results.end(), 'x') == 1);
    for (const pid_t child : children) {
      ::kill(child, SIGKILL);
      waitpid(child, nullptr, 0);
    }
    for (const int fd : {go[0], go[1], shown[0], shown[1]}) close(fd);
  }
}

TEST_CASE("a user with read access only cannot lock the file", "[locks]") {
  const TempFolder folder;
  std::ofstream(folder / "state.json.lock") << "of an earlier version";
  const FileLock lock(folder / "state.json");
  const auto rights = std::filesystem::status(folder / "state.json.lock").permissions();
  CHECK((rights & (std::filesystem::perms::group_all | std::filesystem::perms::others_all)) ==
        std::filesystem::perms::none);
}

TEST_CASE("controllers with the same registers or frames have the same name", "[locks]") {
  const auto names = [](const ControllerConfig& config) { return controller_names(config); };
  CHECK(names(at("CNC.local", 502, 1)) == names(at("cnc.local", 502, 1)));
  CHECK(names(at("cnc.local", 502, 1)) != names(at("cnc.local", 502, 2)));
  CHECK(names(at("cnc.local", 502, 1)) != names(at("cnc.local", 503, 1)));

  ModbusControllerConfig serial;
  serial.line.link = ModbusRtu{"/dev/null"};
  ModbusControllerConfig same_device = serial;
  same_device.line.link = ModbusRtu{"/dev/../dev/null", 19200};
  CHECK(names(serial) == names(same_device));

  CanControllerConfig can;
  can.interface = "can0";
  can.axes.resize(2);
  can.axes[0].offset.id = can.axes[1].offset.id = 0x200;
  CHECK(names(can).size() == 1);
  can.axes[1].offset.id = 0x201;
  CHECK(names(can).size() == 2);
  CanControllerConfig other = can;
  other.interface = "can1";
  CHECK(names(can) != names(other));

  // A dry run needs no lock, except for a serial line, which has one master.
  CHECK(controller_names(can, true).empty());
  CHECK(controller_names(serial, true) == controller_names(serial));

  CHECK(names(DryRunControllerConfig{}).empty());
  CHECK(names(BridgeControllerConfig{}).empty());
}
