/// Common parts of the fuzz targets: checked promises, fields from input bytes, temporary files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/text/problems.hpp"

namespace thermocomp::fuzz {

/// Ends the program, so that libFuzzer keeps the input.
[[noreturn]] void broken(const char* condition, const char* file, int line);

/// Fields from the front of an input; zeros after its end.
class ByteFeed {
 public:
  ByteFeed(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}
  [[nodiscard]] bool empty() const noexcept { return bytes_.empty(); }
  [[nodiscard]] std::uint8_t u8() noexcept;
  [[nodiscard]] std::uint16_t u16() noexcept;
  [[nodiscard]] std::uint64_t u64() noexcept;
  [[nodiscard]] double f64() noexcept;
  /// Up to `count` bytes.
  [[nodiscard]] std::vector<std::uint8_t> take(std::size_t count);
  [[nodiscard]] std::span<const std::uint8_t> rest() const noexcept { return bytes_; }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// A file of this process in memory (in /dev/shm if it exists), removed at the end.
class ScratchFile {
 public:
  explicit ScratchFile(std::string_view name);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }
  void write(std::span<const std::uint8_t> bytes) const;

 private:
  std::filesystem::path folder_;
  std::filesystem::path path_;
};

/// Requirements for every refusal: at least one problem; each names a file that was read, an
/// existing line, a key or a value (unless it concerns the whole file or its syntax), and the rule;
/// printable, on one line.
struct NamedText {
  std::string_view name;
  std::string_view text;
};
void check_problems(const std::vector<Problem>& problems, std::span<const NamedText> files);

}  // namespace thermocomp::fuzz

#define FUZZ_REQUIRE(expression)       \
  ((expression) ? static_cast<void>(0) \
                : ::thermocomp::fuzz::broken(#expression, __FILE__, __LINE__))
