#include "config/text/clean_output.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ext/stdio_sync_filebuf.h>
#include <iostream>
#include <unistd.h>
#include <utility>

#include <sys/random.h>

#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

/// Replaces ESC in marks; nullptr: no cleaning. Its first byte is invalid in UTF-8. Never freed,
/// since the streams are flushed after everything else has ended.
const std::string* code_mark = nullptr;

struct Stream {
  int fd;
  std::string pending;  ///< incomplete character or mark at the end of the last write
};

/// Number of bytes at the end of `text` that begin a mark or a multibyte character.
std::size_t cut_off_bytes(std::string_view text) {
  const std::size_t mark = text.rfind('\xFF');
  if (mark != std::string_view::npos && text.size() - mark < code_mark->size() &&
      code_mark->starts_with(text.substr(mark)))
    return text.size() - mark;
  for (std::size_t back = 1; back <= std::min<std::size_t>(3, text.size()); ++back) {
    const auto byte = static_cast<std::uint8_t>(text[text.size() - back]);
    if ((byte & 0xC0u) == 0x80u) continue;
    const std::size_t length = byte >= 0xF0 ? 4 : byte >= 0xE0 ? 3 : byte >= 0xC0 ? 2 : 1;
    return byte < 0xF5 && length > back ? back : 0;
  }
  return 0;
}

std::string cleaned(std::string_view text) {
  std::string shown;
  for (;;) {
    const std::size_t end = text.find_first_of(std::string_view("\n\t\xFF", 3));
    shown += printable_text(text.substr(0, end));
    if (end == std::string_view::npos) return shown;
    text.remove_prefix(end);
    if (text.starts_with(*code_mark)) {
      shown += '\033';
      text.remove_prefix(code_mark->size());
    } else {
      shown += text.front() == '\xFF' ? '?' : text.front();
      text.remove_prefix(1);
    }
  }
}

bool write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(fd, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

/// @return `size`, or 0 on a write error (see errno)
ssize_t write_cleaned(void* cookie, const char* bytes, std::size_t size) {
  Stream& stream = *static_cast<Stream*>(cookie);
  std::string text = std::move(stream.pending);
  text.append(bytes, size);
  const std::size_t whole = text.size() - cut_off_bytes(text);
  stream.pending = text.substr(whole);
  text.resize(whole);
  return write_all(stream.fd, cleaned(text)) ? static_cast<ssize_t>(size) : 0;
}

std::FILE* cleaned_stream(Stream& stream, int mode) {
  cookie_io_functions_t functions{};
  functions.write = &write_cleaned;
  std::FILE* file = fopencookie(&stream, "w", functions);
  if (file != nullptr) std::setvbuf(file, nullptr, mode, BUFSIZ);
  return file;
}

}  // namespace

void clean_standard_output() {
  if (code_mark != nullptr) return;
  std::array<std::uint64_t, 2> number{};
  static_cast<void>(!getrandom(number.data(), sizeof number, 0));
  std::array<char, 48> mark{};
  std::snprintf(mark.data(), mark.size(), "\xFF%016llx%016llx;",
                static_cast<unsigned long long>(number[0]),
                static_cast<unsigned long long>(number[1]));
  code_mark = new std::string(mark.data());
  static auto& output = *new Stream{STDOUT_FILENO, {}};
  static auto& error = *new Stream{STDERR_FILENO, {}};
  std::FILE* clean_output = cleaned_stream(output, ::isatty(STDOUT_FILENO) == 1 ? _IOLBF : _IOFBF);
  std::FILE* clean_error = cleaned_stream(error, _IONBF);
  if (clean_output == nullptr || clean_error == nullptr) std::abort();
  std::cout.flush();
  std::fflush(stdout);
  stdout = clean_output;
  stderr = clean_error;
  using Buffer = __gnu_cxx::stdio_sync_filebuf<char>;
  std::cout.rdbuf(new Buffer(stdout));
  std::cerr.rdbuf(new Buffer(stderr));
  std::clog.rdbuf(std::cerr.rdbuf());
}

std::string terminal_code(std::string_view code) {
  std::string text = code_mark == nullptr ? "\033" : *code_mark;
  return text.append(code);
}

}  // namespace thermocomp
