#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/stat.h>

#include "../temp_folder.hpp"
#include "cli/observe/watch_text.hpp"
#include "report/command.hpp"
#include "report/files.hpp"

namespace {

namespace fs = std::filesystem;
using thermocomp::cli::OutputFile;

struct Folder : thermocomp::testing::TempFolder {
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(path()), fs::directory_iterator());
  }
};

std::string content(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST_CASE("without commit the old file stays and nothing else is left", "[cli][output]") {
  const Folder folder;
  const fs::path path = folder / "out.csv";
  std::ofstream(path) << "old";
  {
    OutputFile file(path.string());
    file.stream() << "half of the new";
  }
  CHECK(content(path) == "old");
  CHECK(folder.files() == 1);
}

TEST_CASE("after commit the file has the new content", "[cli][output]") {
  const Folder folder;
  const fs::path path = folder / "out.csv";
  OutputFile file(path.string());
  file.stream() << "new";
  file.commit();
  CHECK(content(path) == "new");
  CHECK(folder.files() == 1);
}

TEST_CASE("a symbolic link stays a link", "[cli][output]") {
  const Folder folder;
  std::ofstream(folder / "real.csv") << "old";
  fs::create_symlink("real.csv", folder / "link.csv");
  OutputFile file((folder / "link.csv").string());
  file.stream() << "new";
  file.commit();
  CHECK(fs::is_symlink(folder / "link.csv"));
  CHECK(content(folder / "real.csv") == "new");
}

TEST_CASE("a device is written, not replaced", "[cli][output]") {
  OutputFile file("/dev/null");
  file.stream() << "away";
  file.commit();
  CHECK(fs::is_character_file("/dev/null"));
}

TEST_CASE("a pipe with a reader is written, one without is refused at once", "[cli][output]") {
  const Folder folder;
  const std::string pipe = (folder / "pipe").string();
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(OutputFile(pipe), Catch::Matchers::Contains("without a reader"));
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  REQUIRE(reader >= 0);
  OutputFile file(pipe);
  file.stream() << "text";
  file.commit();
  char got[8] = {};
  CHECK(::read(reader, got, sizeof got) == 4);
  CHECK(std::string(got) == "text");
  ::close(reader);
}

TEST_CASE("a device that cannot hold a file is refused", "[cli][output]") {
  CHECK_THROWS_WITH(OutputFile("/dev/ptmx"), Catch::Matchers::Contains("is a device"));
}

TEST_CASE("a full device and a missing folder are failures that name the file", "[cli][output]") {
  OutputFile full("/dev/full");
  full.stream() << "text";
  CHECK_THROWS_WITH(full.commit(), Catch::Matchers::Contains("/dev/full"));
  CHECK_THROWS_WITH(OutputFile("/nonexistent/out.csv"),
                    Catch::Matchers::Contains("/nonexistent/out.csv"));
}

TEST_CASE("a file that is being written shows its last whole row", "[cli][watch]") {
  const Folder folder;
  const fs::path path = folder / "truth.csv";
  thermocomp::cli::TruthFile truth(path);
  CHECK(truth.newest() == nullptr);
  std::ofstream writer(path);
  writer << "# simulated\ntime_s,z_um\n0,1.5\n10,4.0\n20,9" << std::flush;
  REQUIRE(truth.newest() != nullptr);
  CHECK(truth.newest()->value("z_um") == 4.0);
  CHECK(truth.newest()->change("z_um") == 2.5);
  writer << ".5\n" << std::flush;
  CHECK(truth.newest()->value("z_um") == 9.5);
}

}  // namespace
