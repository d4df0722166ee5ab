/// Interview of `thermocomp init`.
#pragma once

#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include "cli/init/init_draft.hpp"
#include "report/command.hpp"

namespace thermocomp::cli {

/// Asks on a terminal and counts the questions. An invalid answer is asked for again; "<" goes
/// back: the interview is repeated with all answers but the last, printing only new questions.
class Questions {
 public:
  /// The input has ended, so interview() cannot ask again.
  class InputEnded : public Failure {
    using Failure::Failure;
  };

  Questions(std::istream& in, std::ostream& out) : in_(in), out_(out) {}

  /// Calls `body` until it succeeds. A Failure is printed and the last answer asked for again;
  /// without any answer it is rethrown.
  void interview(const std::function<void()>& body);
  /// Repeats the question until `take`, which may ask itself, throws no Failure.
  /// @param otherwise  default answer (Enter), shown in brackets
  void ask_until(const std::string& question, const std::string& otherwise,
                 const std::function<void(const std::string&)>& take);
  void print(const std::string& text);
  [[nodiscard]] int count() const noexcept { return count_; }

 private:
  struct GoBack {};
  [[nodiscard]] std::string ask(const std::string& question, const std::string& otherwise);

  std::istream& in_;
  std::ostream& out_;
  int count_{0};
  std::vector<std::string> answers_;
  std::size_t next_{0};  ///< index of the next answer to reuse
};

/// Queries to the machine during the interview. find_units and try_module are empty if no bus is to
/// be scanned.
struct MachineQueries {
  std::function<std::vector<int>(const InitBus&)> find_units;
  /// One line for each preset that contains the word.
  std::function<std::vector<std::string>(const std::string&)> preset_lines;
  /// Fills in the channels that give a temperature. @return one line for each channel
  /// @throws Failure if the module cannot be described this way
  std::function<std::vector<std::string>(const InitDraft&, InitModule&)> try_module;
};

/// @throws Failure if a module that is not tried has no channels
void refuse_unnamed_channels(const InitModule& module);

/// Asks for everything that the draft lacks; body of an interview.
void ask_for_rest(InitDraft& draft, bool has_controller, Questions& questions,
                  const MachineQueries& eyes);

[[nodiscard]] std::vector<std::string> missing_signals(const InitDraft& draft);

/// "3" and channel 2 -> "m3_2"; with several buses "b2m3_2".
[[nodiscard]] std::string sensor_name(const InitDraft& draft, const InitModule& module, int number);

}  // namespace thermocomp::cli
