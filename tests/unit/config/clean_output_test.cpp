#include "config/text/clean_output.hpp"

#include <array>
#include <cstdio>
#include <functional>
#include <iostream>
#include <string>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/wait.h>

using namespace thermocomp;

namespace {

/// Output of a child process on stdout and stderr.
std::string written_by(const std::function<void()>& program) {
  std::array<int, 2> ends{};
  REQUIRE(pipe(ends.data()) == 0);
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    dup2(ends[1], STDERR_FILENO);
    close(ends[0]);
    close(ends[1]);
    clean_standard_output();
    program();
    std::cout.flush();
    std::fflush(stdout);
    _exit(0);
  }
  close(ends[1]);
  std::string text;
  std::array<char, 4096> bytes{};
  for (ssize_t count = 0; (count = read(ends[0], bytes.data(), bytes.size())) > 0;)
    text.append(bytes.data(), static_cast<std::size_t>(count));
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  REQUIRE(status == 0);
  return text;
}

constexpr const char* hostile = "a\033]0;owned\a\033[2Jb\u202Ec\u009Bd\re";
constexpr const char* harmless = "a ]0;owned  [2Jb<U+202E>c<U+009B>d e";

}  // namespace

TEST_CASE("printed text cannot send control codes to a terminal", "[terminal]") {
  const std::string expected = std::string(harmless) + "\n";
  CHECK(written_by([] { std::printf("%s\n", hostile); }) == expected);
  CHECK(written_by([] { std::fprintf(stderr, "%s\n", hostile); }) == expected);
  CHECK(written_by([] { std::cout << hostile << '\n'; }) == expected);
  CHECK(written_by([] { std::cerr << hostile << std::endl; }) == expected);
  CHECK(written_by([] { std::puts(hostile); }) == expected);
}

TEST_CASE("line ends, tabulators and all scripts are unchanged", "[terminal]") {
  const std::string text = "Spindel\t床前 주축 Ось äöü € \U0001F525\n";
  CHECK(written_by([&] { std::fputs(text.c_str(), stdout); }) == text);
  // Cut anywhere by the end of a buffer.
  CHECK(written_by([&] {
          for (const char c : text) {
            std::fputc(c, stdout);
            std::fflush(stdout);
          }
        }) == text);
  CHECK(written_by([] {
          for (const char c : std::string(hostile)) std::fputc(c, stderr);
        }) == harmless);
  std::string large;
  for (int i = 0; i < 20000; ++i) large += text;
  CHECK(written_by([&] { std::cout << large; }) == large);
}

TEST_CASE("own codes reach the terminal, and other text cannot imitate them", "[terminal]") {
  CHECK(terminal_code("[32m") == "\033[32m");  // no cleaning in this process
  CHECK(written_by([] { std::cout << terminal_code("[32m") << "yes" << terminal_code("[0m"); }) ==
        "\033[32myes\033[0m");
  CHECK(written_by([] {
          for (const char c : terminal_code("[K")) {
            std::fputc(c, stdout);
            std::fflush(stdout);
          }
        }) == "\033[K");
  CHECK(written_by([] { std::fputs("\xFF[2J \xFF\xFF; \033[0m\n", stdout); }) == "?[2J ??;  [0m\n");
}
