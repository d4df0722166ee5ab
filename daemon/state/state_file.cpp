#include "daemon/state/state_file.hpp"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fcntl.h>
#include <map>
#include <stdexcept>
#include <unistd.h>
#include <utility>

#include <nlohmann/json.hpp>
#include <system_error>

#include "config/text/regular_file.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

/// Incremented when older programs would misread the file.
constexpr int format = 1;
constexpr std::uintmax_t size_bytes_max = 1u << 20;

/// A file of a newer program, to be renamed so that it is not overwritten.
class NewerFormat : public std::runtime_error {
 public:
  explicit NewerFormat(std::int64_t newer)
      : std::runtime_error("a newer thermocompd wrote it (format " + std::to_string(newer) +
                           ", this one reads format " + std::to_string(format) + ")"),
        ending(".format-" + std::to_string(newer)) {}
  const std::string ending;
};

json numbers(const std::map<std::string, double>& values) {
  json object = json::object();
  for (const auto& [name, value] : values) {
    // JSON has no NaN; a missing name means NaN.
    if (std::isfinite(value)) object[name] = value;
  }
  return object;
}

std::map<std::string, double> numbers(const json& file, const char* key) {
  std::map<std::string, double> values;
  const json& object = file.at(key);
  if (!object.is_object()) throw std::runtime_error(std::string(key) + " is not a table");
  for (const auto& [name, value] : object.items()) {
    if (!value.is_number())
      throw std::runtime_error(std::string(key) + "." + name + " is not a number");
    const auto number = value.get<double>();
    if (!std::isfinite(number)) {
      throw std::runtime_error(std::string(key) + "." + name + " is not finite");
    }
    values[name] = number;
  }
  return values;
}

/// Informative only: an unreadable entry does not invalidate the reference.
ReferenceRecord record_in(const json& file) {
  const auto found = file.find("reference_taken");
  if (found == file.end() || !found->is_object()) return {};
  const json& wall_s = found->value("wall_s", json());
  const json& by = found->value("by", json());
  if (!wall_s.is_number() || !by.is_string()) return {};
  ReferenceRecord record;
  record.wall_s = wall_s.get<double>();
  for (const ReferenceOrigin origin :
       {ReferenceOrigin::first_values, ReferenceOrigin::command, ReferenceOrigin::reload})
    if (by.get<std::string>() == to_string(origin)) record.origin = origin;
  if (const json& changed = found->value("changed", json()); changed.is_string())
    record.changed = changed.get<std::string>();
  return record.is_known() ? record : ReferenceRecord{};
}

std::string to_text(const PersistentState& state, bool reference_lost,
                    const ReferenceRecord& reference) {
  json file;
  file["format"] = format;
  file["program"] = "thermocomp";
  file["enabled"] = state.enabled;
  if (reference_lost) file["reference_lost"] = true;
  file["reference_degC"] = numbers(state.reference_degC);
  if (reference.is_known()) {
    json& taken = file["reference_taken"];
    taken = {{"wall_s", reference.wall_s}, {"by", to_string(reference.origin)}};
    if (!reference.changed.empty()) taken["changed"] = reference.changed;
  }
  file["model_reference_degC"] = numbers(state.model_reference_degC);
  file["reference_signals"] = numbers(state.reference_signals);
  file["offset_um"] = numbers(state.offset_um);
  file["sign"] = numbers(state.sign);
  file["controller"] = state.controller;
  file["corridor_um"] = numbers(state.corridor_um);
  file["temp_degC"] = numbers(state.temp_degC);
  if (!state.jumped_from_degC.empty()) file["jumped_from_degC"] = numbers(state.jumped_from_degC);
  file["held_degC"] = numbers(state.held_degC);
  file["held_signals"] = numbers(state.held_signals);
  file["correction"] = numbers(state.correction);
  return file.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

PersistentState from_text(const std::string& text, bool& reference_lost,
                          ReferenceRecord& reference) {
  const json file = json::parse(text);
  if (!file.is_object() || file.value("program", "") != "thermocomp") {
    throw std::runtime_error("is not a state file of thermocomp");
  }
  // Compared and printed as JSON: the value may be any number, or a deeply nested list.
  const json& its_format = file.at("format");
  if (its_format.is_number_integer() && its_format > format)
    throw NewerFormat(its_format.get<std::int64_t>());
  if (its_format != format) {
    throw std::runtime_error("is of format " +
                             (its_format.is_number() ? its_format.dump() : "(no number)") +
                             ", not " + std::to_string(format));
  }
  PersistentState state;
  state.enabled = file.at("enabled").get<bool>();
  reference_lost = file.contains("reference_lost") && file["reference_lost"].get<bool>();
  state.reference_degC = numbers(file, "reference_degC");
  reference = record_in(file);
  state.model_reference_degC = numbers(file, "model_reference_degC");
  state.reference_signals = numbers(file, "reference_signals");
  state.offset_um = numbers(file, "offset_um");
  state.temp_degC = numbers(file, "temp_degC");
  state.held_degC = numbers(file, "held_degC");
  state.held_signals = numbers(file, "held_signals");
  state.correction = numbers(file, "correction");
  // Not written by version 0.1.0.
  if (file.contains("sign")) state.sign = numbers(file, "sign");
  state.controller = file.value("controller", "");
  if (file.contains("corridor_um")) state.corridor_um = numbers(file, "corridor_um");
  if (file.contains("jumped_from_degC")) state.jumped_from_degC = numbers(file, "jumped_from_degC");
  return state;
}

/// Renames a file or folder that is in the way of the next save.
std::string move_aside(const std::filesystem::path& file, const std::string& ending) {
  constexpr int names_max = 9;
  std::error_code error;
  for (int name = 1; name <= names_max; ++name) {
    std::string aside = file.string() + ending;
    if (name > 1) aside += "." + std::to_string(name);
    // Replaces an older file; if that fails (a folder), the next name is tried.
    std::filesystem::rename(file, aside, error);
    if (!error) return "moved to " + aside;
  }
  return "it could not be moved aside (" + error.message() + ")";
}

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(what + ": " + std::strerror(errno));
}

void write_flushed(const std::string& path, const std::string& text) {
  // Created anew, since a leftover file or a pipe may have this name.
  unlink(path.c_str());
  const FileDescriptor file(open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640));
  if (file.get() < 0) fail(path);
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t count = write(file.get(), text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(path);
    done += static_cast<std::size_t>(count);
  }
  if (fsync(file.get()) != 0) fail(path);
}

}  // namespace

LoadedState load_state_file(const std::filesystem::path& file,
                            const PersistentState& fallback) noexcept {
  LoadedState loaded;
  try {
    loaded.state = fallback;
    std::error_code error;
    const auto status = std::filesystem::status(file, error);
    if (status.type() == std::filesystem::file_type::not_found) return loaded;
    if (error) throw std::runtime_error(error.message());
    loaded.state =
        from_text(read_regular_file(file, size_bytes_max), loaded.reference_lost, loaded.reference);
    loaded.found = true;
  } catch (const std::exception& error) {
    loaded.damaged = true;
    loaded.reference_lost = false;
    loaded.reference = {};
    try {
      loaded.state = fallback;
      const auto* newer = dynamic_cast<const NewerFormat*>(&error);
      loaded.warning = "state file " + file.string() + " cannot be used: " + error.what() + "; " +
                       move_aside(file, newer != nullptr ? newer->ending : ".unusable");
    } catch (const std::exception&) {
      loaded.found = false;  // out of memory for a message
    }
  }
  return loaded;
}

std::string save_state_file(const std::filesystem::path& file, const PersistentState& state,
                            bool reference_lost, const ReferenceRecord& reference) noexcept {
  try {
    const std::string beside = file.string() + ".new";
    write_flushed(beside, to_text(state, reference_lost, reference));
    if (rename(beside.c_str(), file.c_str()) != 0) fail(file.string());
    const std::filesystem::path folder =
        file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    const FileDescriptor directory(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (directory.get() < 0 || fsync(directory.get()) != 0) fail(folder.string());
    return {};
  } catch (const std::exception& error) {
    return std::string("state file: ") + error.what();
  }
}

StateKeeper::StateKeeper(std::filesystem::path file, PersistentState start, bool is_on_disk,
                         bool reference_lost, const ReferenceRecord& reference)
    : file_(std::move(file)),
      on_disk_{0, std::move(start), reference_lost, reference, 0},
      is_on_disk_(is_on_disk),
      reference_lost_(reference_lost),
      reference_(reference) {}

void StateKeeper::note(const PersistentState& state, Clock::time_point now) {
  poll(now);
  const bool is_due = now >= next_offsets_;
  if (must_be_written(state) || (is_due && state.offset_um != newest().state.offset_um))
    hand_over(state, now);
}

void StateKeeper::save(const PersistentState& state, Clock::time_point now) {
  poll(now);
  if (must_be_written(state) || state.offset_um != newest().state.offset_um) hand_over(state, now);
}

void StateKeeper::poll(Clock::time_point now) {
  now_ = now;
  if (writing_ == nullptr) return;
  if (thread_.is_busy()) {
    if (now - begun_ > disk_answers_within)
      error_ = "state file: the disk does not answer, nothing newer is saved until it does";
    return;
  }
  const std::shared_ptr<Writing> done = std::exchange(writing_, nullptr);
  attempted_ = done->what.serial;
  error_ = done->error;
  if (error_.empty()) {
    on_disk_ = std::move(done->what);
    is_on_disk_ = true;
  }
  if (waiting_) begin(*std::exchange(waiting_, std::nullopt), now);
}

bool StateKeeper::wait(Clock::duration at_most) {
  const Clock::time_point begun = Clock::now();
  const Clock::time_point given = now_;
  const auto waited = [begun] { return Clock::now() - begun; };
  poll(given);
  while (is_busy()) {
    const bool ended = thread_.wait(at_most - waited());
    poll(given + waited());
    if (!ended) return false;
  }
  return true;
}

StateKeeper::Saving StateKeeper::saving(std::uint64_t serial) const noexcept {
  if (serial <= on_disk_.serial && is_on_disk_) return Saving::on_disk;
  return serial <= attempted_ ? Saving::failed : Saving::under_way;
}

void StateKeeper::reference_taken() noexcept {
  if (!reference_lost_) return;
  reference_lost_ = false;
  ++references_;
}

void StateKeeper::note_reference(const ReferenceRecord& reference) noexcept {
  reference_ = reference;
  ++references_;
}

bool StateKeeper::must_be_written(const PersistentState& state) const {
  const SavedState& last = newest();
  return must_be_saved(state, last.state) || references_ != last.references ||
         (writing_ == nullptr && !is_on_disk_);
}

/// The state last handed over, with which changes are compared.
const SavedState& StateKeeper::newest() const noexcept {
  if (waiting_) return *waiting_;
  return writing_ != nullptr ? writing_->what : on_disk_;
}

void StateKeeper::hand_over(const PersistentState& state, Clock::time_point now) {
  next_offsets_ = now + offsets_saved_every;
  SavedState what{++serial_, state, reference_lost_, reference_, references_};
  if (writing_ != nullptr)
    waiting_ = std::move(what);
  else
    begin(std::move(what), now);
}

void StateKeeper::begin(SavedState what, Clock::time_point now) {
  begun_ = now;
  writing_ = std::make_shared<Writing>(Writing{std::move(what), {}});
  thread_.start([file = file_, writing = writing_] {
    const SavedState& state = writing->what;
    writing->error = save_state_file(file, state.state, state.reference_lost, state.reference);
  });
}

}  // namespace thermocomp
