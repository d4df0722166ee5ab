#include "fleet/store/machine_rows.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <pqxx/pqxx>
#include <stdexcept>
#include <utility>

#include <nlohmann/json.hpp>

#include "config/model/model_file.hpp"
#include "status/status.hpp"

namespace thermocomp::fleet {
namespace {

/// Builds an array literal: '{1.5,NULL}'.
class ArrayText {
 public:
  template <class Value>
  void add(Value value) {
    text_ += text_.size() > 1 ? "," : "";
    if (!std::isfinite(static_cast<double>(value))) {
      text_ += "NULL";
      return;
    }
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text_.append(digits.data(), end);
  }
  void add_text(const std::string& text) {
    text_ += text_.size() > 1 ? ",\"" : "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') text_ += '\\';
      text_ += c;
    }
    text_ += '"';
  }
  [[nodiscard]] std::string text() const { return text_ + "}"; }

 private:
  std::string text_{"{"};
};

/// Range of times that the store accepts [s since 1970].
struct SoundTimes {
  explicit SoundTimes(pqxx::work& work) {
    const pqxx::row row = work.exec1(
        "SELECT extract(epoch FROM fleet.oldest_time()), extract(epoch FROM fleet.newest_time())");
    oldest_s = row[0].as<double>();
    newest_s = row[1].as<double>();
  }
  [[nodiscard]] bool has(double time_s) const { return time_s >= oldest_s && time_s <= newest_s; }
  double oldest_s{0.0};
  double newest_s{0.0};
};

constexpr const char* insert_samples =
    "INSERT INTO fleet.sample (machine, setup, at, value) SELECT $1, $2, to_timestamp(at), "
    "mean::real[]"
    " FROM unnest($3::bigint[], $4::text[]) AS given (at, mean) ON CONFLICT DO NOTHING";
constexpr const char* insert_probings =
    "INSERT INTO fleet.probing (machine, at, output, number, displacement_um, measured_um, "
    "modelled_um,"
    " claimed_um, sd_um, source) SELECT $1, to_timestamp(at), output, number, displacement, "
    "measured,"
    " modelled, claimed, sd, source FROM unnest($2::float8[], $3::text[], $4::int[], $5::float8[],"
    " $6::float8[], $7::float8[], $8::float8[], $9::float8[], $10::text[])"
    " AS given (at, output, number, displacement, measured, modelled, claimed, sd, source)"
    " ON CONFLICT DO NOTHING";
constexpr const char* insert_events =
    "INSERT INTO fleet.event (machine, at, run, number, kind, what, record) SELECT $1, "
    "to_timestamp(at),"
    " run, number, kind, what, record::jsonb FROM unnest($2::float8[], $3::bigint[], $4::bigint[],"
    " $5::text[], $6::text[], $7::text[]) AS given (at, run, number, kind, what, record)"
    " ON CONFLICT DO NOTHING";
constexpr const char* note_position =
    "UPDATE fleet.uplink SET segment = $3, segment_wall_ns = $4, cycle = $5, sent = sent + $6,"
    " refused = refused + $7, repeated = repeated + $8, newest = greatest(newest, "
    "to_timestamp(nullif($9::float8, 0))),"
    " seen = now(), program_version = $10 WHERE machine = $1 AND history = $2";

}  // namespace

MachineRows::MachineRows(pqxx::connection& store, const std::string& machine, std::string history)
    : store_(store), history_(std::move(history)) {
  pqxx::work work(store_);
  const pqxx::result found =
      machine.empty() ? work.exec("SELECT fleet.my_machine()")
                      : work.exec_params("SELECT id FROM fleet.machine WHERE name = $1", machine);
  if (found.empty() || found[0][0].is_null())
    throw std::runtime_error(machine.empty() ? "the role that logged in belongs to no machine"
                                             : machine + ": no such machine in the store");
  machine_ = found[0][0].as<int>();
  work.exec_params(
      "INSERT INTO fleet.uplink (machine, history) VALUES ($1, $2) ON CONFLICT DO NOTHING",
      machine_, history_);
  work.commit();
}

Progress MachineRows::progress() {
  pqxx::work work(store_);
  const pqxx::row row = work.exec_params1(
      "SELECT segment, segment_wall_ns, cycle, event_run, event_number FROM fleet.uplink"
      " WHERE machine = $1 AND history = $2",
      machine_, history_);
  position_ = {row[0].as<std::int64_t>(), row[1].as<std::int64_t>(), row[2].as<std::uint64_t>()};
  return {*position_, row[3].as<std::int64_t>(), row[4].as<std::uint64_t>()};
}

/// Number of the configuration, model and version; the first row adds them to the store.
int MachineRows::setup_number(pqxx::work& work, const MeansBatch& batch) {
  const std::string configuration = sha256_hex(batch.setup.config_text);
  const std::string model = sha256_hex(batch.setup.model_text);
  const auto find = [&] {
    return work.exec_params(
        "SELECT number FROM fleet.setup WHERE machine = $1 AND configuration = $2 AND model = $3"
        " AND program_version = $4",
        machine_, configuration, model, batch.program_version);
  };
  if (const pqxx::result known = find(); !known.empty()) return known[0][0].as<int>();
  constexpr const char* add =
      "INSERT INTO fleet.document (checksum, kind, content) VALUES ($1, $2, $3)"
      " ON CONFLICT DO NOTHING";
  work.exec_params(add, configuration, "configuration", batch.setup.config_text);
  work.exec_params(add, model, "model", batch.setup.model_text);
  ArrayText columns;
  for (const std::string& column : batch.columns) columns.add_text(column);
  work.exec_params(
      "INSERT INTO fleet.setup (machine, number, configuration, model, columns, program_version)"
      " SELECT $1, 1 + coalesce(max(number), 0), $2, $3, $4::text[], $5 FROM fleet.setup"
      " WHERE machine = $1",
      machine_, configuration, model, columns.text(), batch.program_version);
  return find().at(0)[0].as<int>();
}

/// True if the store's position differs from that left by this sender.
bool MachineRows::is_moved(pqxx::work& work) const {
  const pqxx::result found = work.exec_params(
      "SELECT segment, segment_wall_ns, cycle FROM fleet.uplink WHERE machine = $1 AND history = "
      "$2 FOR UPDATE",
      machine_, history_);
  return !found.empty() && (found[0][0].as<std::int64_t>() != position_->segment ||
                            found[0][1].as<std::int64_t>() != position_->wall_ns ||
                            found[0][2].as<std::uint64_t>() != position_->cycle);
}

Taken MachineRows::send(const MeansBatch& batch) {
  pqxx::work work(store_);
  const SoundTimes sound(work);
  const int setup = setup_number(work, batch);
  Taken taken;
  ArrayText at, means;
  std::int64_t end_s = 0;
  std::uint64_t given = 0;
  for (const MeanRow& row : batch.rows) {
    if (!sound.has(static_cast<double>(row.at_s))) continue;
    at.add(row.at_s);
    ArrayText mean;
    for (const float value : row.mean) mean.add(value);
    means.add_text(mean.text());
    end_s = std::max(end_s, row.at_s + mean_s);
    ++given;
  }
  const pqxx::result inserted =
      work.exec_params(insert_samples, machine_, setup, at.text(), means.text());
  taken.sent = batch.rows.size();
  taken.refused = taken.sent - given;
  taken.repeated = given - inserted.affected_rows();

  ArrayText time, output, number, displacement, measured, modelled, claimed, sd, source;
  for (const RecordedProbing& probing : batch.probings) {
    const double at_s = 1e-9 * static_cast<double>(probing.wall_ns);
    if (!sound.has(at_s) || !std::isfinite(probing.displacement_um)) continue;
    time.add(at_s);
    output.add_text(probing.output);
    number.add(probing.number);
    displacement.add(probing.displacement_um);
    measured.add(probing.measured_um);
    modelled.add(probing.modelled_um);
    claimed.add(probing.claimed_um);
    sd.add(probing.sd_um);
    source.add_text(probing.source);
  }
  work.exec_params(insert_probings, machine_, time.text(), output.text(), number.text(),
                   displacement.text(), measured.text(), modelled.text(), claimed.text(), sd.text(),
                   source.text());
  taken.by_another = position_ && is_moved(work);
  work.exec_params0(note_position, machine_, history_, batch.after.segment, batch.after.wall_ns,
                    batch.after.cycle, taken.sent, taken.refused, taken.repeated, end_s,
                    THERMOCOMP_VERSION);
  work.commit();
  if (position_) position_ = batch.after;
  return taken;
}

void MachineRows::send(const std::vector<RecordedEvent>& events) {
  if (events.empty()) return;
  pqxx::work work(store_);
  const SoundTimes sound(work);
  ArrayText at, run, number, kind, what, record;
  for (const RecordedEvent& event : events) {
    if (!sound.has(event.wall_s)) continue;
    at.add(event.wall_s);
    run.add(event.run);
    number.add(event.number);
    kind.add_text(std::string(to_string(event.kind)));
    what.add_text(event_text(event));
    record.add_text(json_of(static_cast<const Event&>(event)).dump());
  }
  work.exec_params(insert_events, machine_, at.text(), run.text(), number.text(), kind.text(),
                   what.text(), record.text());
  work.exec_params0(
      "UPDATE fleet.uplink SET event_run = $3, event_number = $4, seen = now()"
      " WHERE machine = $1 AND history = $2",
      machine_, history_, events.back().run, events.back().number);
  work.commit();
}

void MachineRows::greet(std::uint64_t damaged) {
  pqxx::work work(store_);
  work.exec_params0(
      "UPDATE fleet.uplink SET seen = now(), damaged = $3 WHERE machine = $1 AND history = $2",
      machine_, history_, damaged);
  work.commit();
}

}  // namespace thermocomp::fleet
