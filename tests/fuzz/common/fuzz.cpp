#include "fuzz.hpp"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <unistd.h>

namespace thermocomp::fuzz {

namespace {

const Problem* problem_in_check = nullptr;  ///< the problem being checked

}  // namespace

void broken(const char* condition, const char* file, int line) {
  if (problem_in_check != nullptr)
    std::fprintf(stderr, "of: %s\n", to_string(*problem_in_check).c_str());
  std::fprintf(stderr, "%s:%d: broken promise: %s\n", file, line, condition);
  std::abort();
}

std::uint8_t ByteFeed::u8() noexcept {
  if (bytes_.empty()) return 0;
  const std::uint8_t byte = bytes_.front();
  bytes_ = bytes_.subspan(1);
  return byte;
}

std::uint16_t ByteFeed::u16() noexcept {
  const unsigned low = u8();
  return static_cast<std::uint16_t>(low | unsigned{u8()} << 8);
}

std::uint64_t ByteFeed::u64() noexcept {
  std::uint64_t value = 0;
  for (unsigned i = 0; i < 8; ++i) value |= std::uint64_t{u8()} << (8 * i);
  return value;
}

double ByteFeed::f64() noexcept {
  return std::bit_cast<double>(u64());
}

std::vector<std::uint8_t> ByteFeed::take(std::size_t count) {
  const auto front = bytes_.first(std::min(count, bytes_.size()));
  bytes_ = bytes_.subspan(front.size());
  return {front.begin(), front.end()};
}

namespace {

/// A folder that the caller of this process cleans up, else memory, else the disk.
std::filesystem::path scratch_folder() {
  const char* given = std::getenv("THERMOCOMP_FUZZ_SCRATCH");
  if (given != nullptr) return given;
  return access("/dev/shm", W_OK) == 0 ? "/dev/shm" : std::filesystem::temp_directory_path();
}

}  // namespace

ScratchFile::ScratchFile(std::string_view name) {
  std::string folder = (scratch_folder() / "thermocomp-fuzz-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    std::perror(folder.c_str());
    std::exit(1);
  }
  folder_ = folder;
  path_ = folder_ / name;
}

ScratchFile::~ScratchFile() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

void ScratchFile::write(std::span<const std::uint8_t> bytes) const {
  const int fd = open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const bool whole =
      fd >= 0 && ::write(fd, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
  if (fd >= 0) close(fd);
  if (whole) return;
  std::perror(path_.c_str());
  std::exit(1);
}

namespace {

/// Zeros that a logger left end a line, too, and carriage returns where there is no line feed. In
/// JSON each record counts.
int lines_of(std::string_view text) {
  const char end = text.find('\n') == std::string_view::npos ? '\r' : '\n';
  int lines = 1 + static_cast<int>(std::count(text.begin(), text.end(), '{') +
                                   std::count(text.begin(), text.end(), '['));
  for (std::size_t i = 0; i < text.size(); ++i)
    if (text[i] == end || (text[i] == '\0' && (i == 0 || text[i - 1] != '\0'))) ++lines;
  return lines;
}

}  // namespace

void check_problems(const std::vector<Problem>& problems, std::span<const NamedText> files) {
  FUZZ_REQUIRE(!problems.empty());
  std::vector<int> lines;  // counted once for possibly thousands of problems
  for (const NamedText& known : files) lines.push_back(lines_of(known.text));
  for (const Problem& problem : problems) {
    problem_in_check = &problem;
    const auto file = std::find_if(files.begin(), files.end(), [&](const NamedText& known) {
      return known.name == problem.file;
    });
    FUZZ_REQUIRE(file != files.end());
    FUZZ_REQUIRE(problem.line >= 0);
    FUZZ_REQUIRE(problem.line <= lines[static_cast<std::size_t>(file - files.begin())]);
    FUZZ_REQUIRE(!problem.rule.empty());
    const bool of_a_key = !problem.key.empty();
    FUZZ_REQUIRE(!of_a_key || !problem.value.empty());
    FUZZ_REQUIRE(to_string(problem).find('\n') == std::string::npos);
  }
  problem_in_check = nullptr;
}

}  // namespace thermocomp::fuzz
