#include "report/files.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <iostream>
#include <iterator>
#include <unistd.h>

#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <system_error>

#include "report/command.hpp"

namespace thermocomp::cli {

RunLoader::RunLoader(const std::string& columns)
    : has_map_(!columns.empty()), map_(has_map_ ? load_column_map(columns) : ColumnMap{}) {}

RunFile RunLoader::load(const std::string& argument) {
  RunFile run = load_run(parse_selection(argument), has_map_ ? &map_ : nullptr);
  run.argument = argument;
  print_interpretation(run);
  return run;
}

std::vector<RunFile> RunLoader::load(const std::vector<std::string>& arguments) {
  std::vector<RunFile> runs;
  runs.reserve(arguments.size());
  for (const std::string& argument : arguments) {
    RunFile run = load(argument);
    if (run.references.empty()) {
      runs.push_back(std::move(run));
      continue;
    }
    std::vector<RunFile> parts = between_references(run);
    std::fprintf(stderr, "%s: displacement counts anew from each reference: read as %zu runs\n",
                 run.name.c_str(), parts.size());
    std::move(parts.begin(), parts.end(), std::back_inserter(runs));
  }
  return runs;
}

void RunLoader::print_interpretation(const RunFile& run) {
  if (run.understood.empty()) return;
  const auto is_reported = [this](const std::string& line) {
    return std::find(reported_.begin(), reported_.end(), line) != reported_.end();
  };
  std::fprintf(stderr, "%s: read as follows%s\n", run.name.c_str(),
               reported_.empty() ? "" : " and above");
  for (const std::string& line : run.understood) {
    if (is_reported(line)) continue;
    std::fprintf(stderr, "  %s\n", line.c_str());
    reported_.push_back(line);
  }
}

namespace {

namespace fs = std::filesystem;

// The file that an interrupt must remove; a plain array for the signal handler.
char temporary_name[4096];
constexpr int interrupts[] = {SIGINT, SIGTERM, SIGHUP};

void remove_and_die(int signal) {
  ::unlink(temporary_name);
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void remove_on_interrupt(const std::string& name) {
  if (name.size() >= sizeof temporary_name) return;
  std::memcpy(temporary_name, name.c_str(), name.size() + 1);
  for (const int signal : interrupts) std::signal(signal, remove_and_die);
}

void interrupts_as_usual() {
  for (const int signal : interrupts) std::signal(signal, SIG_DFL);
}

Failure cannot_write(const std::string& name, int error) {
  return Failure("cannot write " + name + ": " + std::generic_category().message(error));
}

}  // namespace

OutputFile::OutputFile(const std::string& destination)
    : name_(destination), destination_(destination), stream_(&file_) {
  if (destination == "-") {
    stream_ = &std::cout;
    return;
  }
  std::error_code error;
  if (fs::is_symlink(destination_, error)) destination_ = fs::weakly_canonical(destination_, error);
  const fs::file_status status = fs::status(destination_, error);
  if (fs::is_directory(status)) throw cannot_write(name_, EISDIR);
  // Written directly: a rename would replace /dev/null or a pipe by a regular file.
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    refuse_what_hangs();
    file_.open(destination_);
    if (!file_) throw cannot_write(name_, errno);
    return;
  }
  open_temporary();
}

/// Refuses a pipe without a reader, on which open() would block, and devices such as serial ports.
void OutputFile::refuse_what_hangs() const {
  const int descriptor = ::open(destination_.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  if (descriptor < 0) {
    if (errno == ENXIO) {
      throw Failure("cannot write " + name_ + ": it is a pipe or socket without a reader");
    }
    throw cannot_write(name_, errno);
  }
  struct stat there {};
  struct stat output {};
  const bool is_known = ::fstat(descriptor, &there) == 0;
  const bool is_output = ::fstat(STDOUT_FILENO, &output) == 0 && there.st_rdev == output.st_rdev;
  ::close(descriptor);
  constexpr unsigned memory_devices = 1;  // /dev/null, /dev/full
  const bool is_device = S_ISCHR(there.st_mode) || S_ISBLK(there.st_mode);
  const bool is_harmless =
      S_ISCHR(there.st_mode) && (major(there.st_rdev) == memory_devices || is_output);
  if (!is_known || (is_device && !is_harmless)) {
    throw Failure("cannot write " + name_ + ": it is a device; -o must be a file, a pipe or -");
  }
}

void OutputFile::open_temporary() {
  std::string pattern = (destination_.parent_path() / ".").string();
  pattern += destination_.filename().string();
  pattern += ".XXXXXX";
  const int descriptor = ::mkstemp(pattern.data());
  if (descriptor < 0) throw cannot_write(name_, errno);
  const mode_t mask = ::umask(0);
  ::umask(mask);
  ::fchmod(descriptor, 0666 & ~mask);
  ::close(descriptor);
  temporary_ = pattern;
  remove_on_interrupt(pattern);
  file_.open(temporary_);
  if (!file_) throw cannot_write(name_, errno);
}

OutputFile::~OutputFile() {
  if (temporary_.empty()) return;
  std::error_code ignored;
  fs::remove(temporary_, ignored);
  interrupts_as_usual();
}

void OutputFile::commit() {
  errno = 0;
  stream_->flush();
  if (file_.is_open()) file_.close();
  if (!stream_->good()) throw cannot_write(name_, errno != 0 ? errno : EIO);
  if (temporary_.empty()) return;
  std::error_code error;
  fs::rename(temporary_, destination_, error);
  if (error) throw cannot_write(name_, error.value());
  temporary_.clear();
  interrupts_as_usual();
}

void write_file(const std::string& destination, const std::string& text) {
  OutputFile file(destination);
  file.stream() << text;
  file.commit();
}

}  // namespace thermocomp::cli
