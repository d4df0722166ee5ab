/// Opens files that may have been replaced by something else.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace thermocomp {

/// Owns a file descriptor; -1: none.
class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) noexcept : fd_(fd) {}
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  [[nodiscard]] int get() const noexcept { return fd_; }

 private:
  int fd_;
};

/// Opens regular files only: opening a pipe blocks until its other end is opened, and reading a
/// device may never end.
/// @param flags  of open(2); O_NONBLOCK and O_CLOEXEC are added
/// @throws std::runtime_error "no such file", "must be a regular file", "cannot be opened: ..."
[[nodiscard]] FileDescriptor open_regular_file(const std::filesystem::path& path, int flags);

/// The whole content. @throws as above, and if it exceeds `bytes_max`
[[nodiscard]] std::string read_regular_file(const std::filesystem::path& path,
                                            std::uintmax_t bytes_max);

/// For a library that opens the file itself.
/// @throws std::runtime_error "must be a regular file" if it exists and is not one
void require_regular_or_missing(const std::filesystem::path& path);

}  // namespace thermocomp
