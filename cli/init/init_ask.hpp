/// The questions of `thermocomp init`.
#pragma once

#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include "cli/init/init_draft.hpp"
#include "report/command.hpp"

namespace thermocomp::cli {

/// Asks on a terminal and counts; an answer that cannot be understood is asked for again, and "<"
/// goes back to the question before. The answers are kept: the interview is then gone through anew
/// with all but the last of them, and only shows what is new.
class Questions {
 public:
  /// @throws Failure that interview() could not take an answer back for: the input has ended
  class InputEnded : public Failure {
    using Failure::Failure;
  };

  Questions(std::istream& in, std::ostream& out) : in_(in), out_(out) {}

  /// Calls `body` until it ends. A Failure that it throws is shown, and the last answer asked for
  /// again; one without any answer is the caller's.
  void interview(const std::function<void()>& body);
  /// Until `take` does not throw a Failure. It may ask itself.
  /// @param otherwise  what Enter means; shown in brackets
  void ask_until(const std::string& question, const std::string& otherwise,
                 const std::function<void(const std::string&)>& take);
  void say(const std::string& text);
  [[nodiscard]] int count() const noexcept { return count_; }

 private:
  struct GoBack {};
  [[nodiscard]] std::string ask(const std::string& question, const std::string& otherwise);

  std::istream& in_;
  std::ostream& out_;
  int count_{0};
  std::vector<std::string> answers_;
  std::size_t next_{0};  ///< of them: up to here they were gone through
};

/// What the questions need to know of the machine while they are asked.
struct InitEyes {
  /// The units that answer on a bus.
  std::function<std::vector<int>(const InitBus&)> find_units;
  /// A line for each preset that has the word.
  std::function<std::vector<std::string>(const std::string&)> preset_lines;
  /// Fills in the channels that give a temperature, and says what was read, a line a channel.
  /// @throws Failure when the module cannot be described so
  std::function<std::vector<std::string>(const InitDraft&, InitModule&)> try_module;
};

/// Asks for what the draft does not have yet: part of an interview.
void ask_for_rest(InitDraft& draft, bool has_controller, Questions& questions,
                  const InitEyes& eyes);

/// Signals that the model needs and that nothing is said of yet.
[[nodiscard]] std::vector<std::string> missing_signals(const InitDraft& draft);

/// "3" and channel 2 -> "m3_2"; with several buses "b2m3_2".
[[nodiscard]] std::string sensor_name(const InitDraft& draft, const InitModule& module, int number);

}  // namespace thermocomp::cli
