#include "config/buses/buses.hpp"
#include "config/sections/can_signals.hpp"
#include "config/sections/common.hpp"

namespace thermocomp::sections {
namespace {

/// The frame of the value, with its page, as text.
std::string frame_of(const std::string& interface, const CanSignal& signal) {
  std::string place = interface;
  const auto add = [&place](auto number) { place.append(" ").append(std::to_string(number)); };
  add(signal.id);
  add(signal.extended_id ? 1 : 0);
  for (const CanSelector& selector : signal.selectors) {
    add(selector.field.start_bit);
    add(selector.pages.front().first);
  }
  return place;
}

class CanSection final : public BusSection {
 public:
  CanSection(const TomlTable& table, const std::string& name, BusFiles& files) : files_(files) {
    bus_.name = name;
    bus_.interface = read_interface(table);
    // Polling for an interface is cheap, and a restored bus must be read within 2 s.
    bus_.reconnect_s = table.number("reconnect_s", Range::between(0.01, 1), bus_.reconnect_s);
    refuse_all(table,
               {"host", "port", "device", "baud", "parity", "data_bits", "stop_bits", "rs485",
                "timeout_ms", "inter_frame_delay_ms", "backoff_s_max", "retries"},
               "does not apply to kind = \"can\"");
    database_ = files.dbc.read(table);
  }

  void read_device(const TomlTable& table, const std::string& name) override {
    refuse_all(table,
               {"unit", "period_s", "registers_per_request_max", "gap_registers_max",
                "one_register_a_request", "renewal", "table", "encoding", "word_order"},
               "does not apply on a CAN bus");
    bus_.devices.push_back({name, {}});
  }

  void read_channel(const ChannelTables& tables, std::size_t device) override {
    refuse_all(tables.sensor, {"table", "address", "encoding", "word_order"},
               "does not apply on a CAN bus");
    std::vector<std::string> warnings;
    CanChannel channel =
        read_can_channel(tables.sensor, tables.device, database_, tables.stale_after_s, warnings);
    for (const std::string& text : warnings) files_.warn(tables, text);
    channel.sensor = tables.index;
    files_.note_bits(tables, frame_of(bus_.interface, channel.signal), frame_bits(channel.signal));
    bus_.devices[device].channels.push_back(std::move(channel));
  }

  [[nodiscard]] bool has_devices() const override { return !bus_.devices.empty(); }
  [[nodiscard]] BusConfig take() override { return std::move(bus_); }

 private:
  CanBusConfig bus_;
  BusFiles& files_;
  CanDatabase database_;
};

}  // namespace

std::unique_ptr<BusSection> open_can(const TomlTable& bus, const std::string& name,
                                     const std::string& /*kind*/, BusFiles& files) {
  return std::make_unique<CanSection>(bus, name, files);
}

}  // namespace thermocomp::sections
