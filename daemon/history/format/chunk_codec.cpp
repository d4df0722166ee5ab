#include "daemon/history/format/chunk_codec.hpp"

#include <bit>
#include <utility>

namespace thermocomp {
namespace {

constexpr std::size_t seal_bytes = 8;

void write_value(ByteWriter& writer, std::uint64_t difference) {
  if (difference == 0) {
    writer.u8(0);
    return;
  }
  const auto low = static_cast<unsigned>(std::countr_zero(difference)) / 8;
  const auto high = static_cast<unsigned>(std::countl_zero(difference)) / 8;
  const unsigned length = 8 - low - high;
  writer.u8(static_cast<std::uint8_t>(low << 4 | length));
  difference >>= 8 * low;
  for (unsigned i = 0; i < length; ++i, difference >>= 8) {
    writer.u8(static_cast<std::uint8_t>(difference));
  }
}

std::uint64_t read_value(ByteReader& reader) {
  const unsigned head = reader.u8();
  const unsigned low = head >> 4;
  const unsigned length = head & 0xF;
  if (low + length > 8) throw HistoryError("damaged: a value is too long");
  std::uint64_t difference = 0;
  for (unsigned i = 0; i < length; ++i) {
    difference |= static_cast<std::uint64_t>(reader.u8()) << (8 * (low + i));
  }
  return difference;
}

/// Unsigned arithmetic, since differences may wrap around.
std::int64_t minus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}
std::int64_t plus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}

}  // namespace

nanoseconds grid_time_from(std::int64_t time_ns) {
  require_sound(time_ns >= 0 && time_ns <= (std::int64_t{1} << 61), "an impossible time");
  return nanoseconds(time_ns);
}

Fault fault_from(std::uint8_t code) {
  require_sound(code < faults_count, "unknown fault");
  return static_cast<Fault>(code);
}

std::uint64_t* RecordPrediction::value_bits(RecordKind kind, std::uint32_t index) {
  if (index >= indices_max) return nullptr;
  auto& values = values_[static_cast<std::size_t>(kind)];
  if (index >= values.size()) values.resize(index + std::size_t{1}, 0);
  return &values[index];
}

void ChunkEncoder::add(const Record& record) {
  const auto kind = static_cast<std::size_t>(record.kind);
  writer_.u8(static_cast<std::uint8_t>(kind));
  writer_.u8(record.detail);
  writer_.varint(zigzag(static_cast<std::int64_t>(record.cycle - last_.cycle)));
  writer_.varint(record.index);
  writer_.varint(zigzag(minus(record.time_ns, last_.time_ns[kind])));
  const auto bits = std::bit_cast<std::uint64_t>(record.value);
  std::uint64_t* last_bits = last_.value_bits(record.kind, record.index);
  write_value(writer_, bits ^ (last_bits != nullptr ? *last_bits : 0));
  if (last_bits != nullptr) *last_bits = bits;
  last_.cycle = record.cycle;
  last_.time_ns[kind] = record.time_ns;
  ++count_;
}

std::vector<std::byte> ChunkEncoder::take() {
  std::vector<std::byte> bytes = std::move(writer_.bytes());
  *this = ChunkEncoder();
  return bytes;
}

ChunkDecoder::ChunkDecoder(std::vector<std::byte> bytes, std::uint64_t count)
    : bytes_(std::move(bytes)), reader_(bytes_), left_(count) {}

bool ChunkDecoder::next(Record& out) {
  if (left_ == 0) {
    if (!reader_.at_end()) throw HistoryError("damaged: bytes after the last record");
    return false;
  }
  --left_;
  const std::uint8_t kind = reader_.u8();
  if (kind >= record_kinds_count) throw HistoryError("damaged: unknown kind of record");
  out = Record{};
  out.kind = static_cast<RecordKind>(kind);
  out.detail = reader_.u8();
  out.cycle = last_.cycle + static_cast<std::uint64_t>(unzigzag(reader_.varint()));
  out.index = static_cast<std::uint32_t>(reader_.varint());
  out.time_ns = plus(last_.time_ns[kind], unzigzag(reader_.varint()));
  std::uint64_t bits = read_value(reader_);
  if (std::uint64_t* last_bits = last_.value_bits(out.kind, out.index)) {
    bits ^= *last_bits;
    *last_bits = bits;
  }
  out.value = std::bit_cast<double>(bits);
  last_.cycle = out.cycle;
  last_.time_ns[kind] = out.time_ns;
  return true;
}

void add_seal(std::vector<std::byte>& bytes) {
  const std::uint64_t hash = fnv_1a(bytes);
  for (std::size_t i = 0; i < seal_bytes; ++i) {
    bytes.push_back(static_cast<std::byte>(hash >> (8 * i)));
  }
}

void take_seal(std::vector<std::byte>& bytes) {
  if (bytes.size() < seal_bytes) throw HistoryError("damaged: the estimator's state is cut short");
  std::vector<std::byte> state(bytes.begin(), bytes.end() - seal_bytes);
  add_seal(state);
  if (state != bytes)
    throw HistoryError("damaged: the estimator's state does not fit its checksum");
  bytes.erase(bytes.end() - seal_bytes, bytes.end());
}

std::vector<std::byte> encode_inputs(std::span<const Reading> readings,
                                     const ControllerState& controller) {
  ByteWriter writer;
  writer.varint(readings.size());
  for (const Reading& reading : readings) {
    writer.f64(reading.temp_degC);
    writer.varint(zigzag(reading.taken_at.count()));
    writer.u8(static_cast<std::uint8_t>(reading.fault));
  }
  writer.varint(zigzag(controller.taken_at.count()));
  writer.varint(controller.link_epoch);
  writer.u8(link_bits(controller));
  for (const double value : controller.applied_um) writer.f64(value);
  for (const double value : controller.signals) writer.f64(value);
  return std::move(writer.bytes());
}

void decode_inputs(std::span<const std::byte> bytes, std::vector<Reading>& readings,
                   ControllerState& controller) {
  ByteReader reader(bytes);
  const std::uint64_t count = reader.varint();
  if (count > bytes.size()) throw HistoryError("damaged: too many readings");
  readings.assign(count, Reading{});
  for (Reading& reading : readings) {
    reading.temp_degC = reader.f64();
    reading.taken_at = grid_time_from(unzigzag(reader.varint()));
    reading.fault = fault_from(reader.u8());
  }
  controller.taken_at = grid_time_from(unzigzag(reader.varint()));
  controller.link_epoch = static_cast<std::uint32_t>(reader.varint());
  set_link_bits(reader.u8(), controller);
  for (double& value : controller.applied_um) value = reader.f64();
  for (double& value : controller.signals) value = reader.f64();
  if (!reader.at_end()) throw HistoryError("damaged: bytes after the inputs");
}

}  // namespace thermocomp
