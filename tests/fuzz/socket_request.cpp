/// The status socket with the operators' methods: for any client input, in any pieces, every output
/// line is a JSON-RPC answer, and the next client is served.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <optional>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/un.h>

#include "common/fuzz.hpp"
#include "common/recorded_history.hpp"
#include "daemon/methods/methods.hpp"
#include "daemon/socket/status_server.hpp"
#include "estimator/pipeline/estimator.hpp"

using namespace thermocomp;
using nlohmann::json;
using std::chrono::milliseconds;

namespace {

/// Largest change of modelled displacement per step, with any gains.
constexpr double rise_um_a_step = 0.5;
constexpr std::uint8_t client_waits = 0xFF;  ///< not part of UTF-8: the client waits one round

/// A daemon without threads: commands are checked and reach an estimator that learns from probings
/// and follows cycle ends.
class Rig {
 public:
  Rig()
      : file_("status.sock"),
        config_(with_socket(file_.path())),
        estimator_(config_.estimator, config_.model),
        readings_(config_.estimator.sensors.size()),
        report_(estimator_.make_report()),
        server_(config_.socket, without_rates()) {
    controller_.online = true;
    controller_.written = controller_.online;
    controller_.link_epoch = 1;
    controller_.applied_um.fill(0.0);
    step();
    add_status_methods(server_, [this] { return view(); });
    add_operator_methods(
        server_, {[this] { return view(); }, [this](const Command& asked) { return take(asked); },
                  [](const std::optional<std::filesystem::path>&) -> RpcPending {
                    return []() -> std::optional<json> {
                      throw ConfigurationError({{"config.toml", 3, "format", "2", "must be 1"}});
                    };
                  }});
  }
  StatusServer& server() { return server_; }
  [[nodiscard]] const std::filesystem::path& path() const { return file_.path(); }

 private:
  static DaemonConfig with_socket(const std::filesystem::path& path) {
    DaemonConfig config = fuzz::small_config();
    config.socket.path = path;
    // The promised step limit concerns probings; smoothed values change once per period.
    for (SensorConfig& sensor : config.estimator.sensors) {
      sensor.smoothing.form = SmoothingForm::off;
      sensor.screening.settle_s = 0.0;
    }
    config.estimator.compensation.update = UpdateRule::each_cycle;
    config.estimator.compensation.enabled_at_first_start = true;
    CorrectionConfig& correction = config.estimator.correction;
    correction.form = CorrectionForm::recursive;
    for (const std::string& input : config.model.inputs) correction.groups.push_back({input});
    correction.bias_drift_um_per_sqrt_h = 5.0;
    return config;
  }
  /// Time does not advance between two inputs: rate limits would only make clients wait.
  static SocketLimits without_rates() {
    SocketLimits limits;
    limits.requests_per_s = limits.requests_burst = 1e9;
    limits.all_requests_per_s = limits.all_requests_burst = 1e9;
    return limits;
  }
  StatusView view() {
    return {config_, report_, controller_, timing_, {},    {},
            {},      {},      {},          1.0,     false, server_.statistics()};
  }
  /// Every other command is answered one round later.
  RpcPending take(const Command& asked) {
    FUZZ_REQUIRE(asked.axis < config_.estimator.axes.size());
    FUZZ_REQUIRE(std::isfinite(asked.value_um));
    const double before_um = displacement_um(asked.axis);
    estimator_.apply(asked);
    step();
    const CorrectionConfig& correction = config_.estimator.correction;
    for (std::size_t g = 0; g < correction.groups.size(); ++g) {
      const double gain = report_.axes[asked.axis].correction.gain[g];
      FUZZ_REQUIRE(gain >= correction.gain_min && gain <= correction.gain_max);
    }
    // A new reference removes the learned bias; before the first prediction there is none.
    if (asked.kind != CommandKind::reference && std::isfinite(before_um))
      FUZZ_REQUIRE(std::abs(displacement_um(asked.axis) - before_um) <=
                   correction.step_um_max + rise_um_a_step);
    bool later = steps_ % 2 == 0;
    return [later]() mutable -> std::optional<json> {
      if (std::exchange(later, false)) return std::nullopt;
      return json{{"done", true}};
    };
  }
  /// One cycle, with a small temperature rise.
  void step() {
    ++steps_;
    now_ += milliseconds(100);
    for (Reading& reading : readings_)
      reading = {20.0 + 0.001 * static_cast<double>(std::min(steps_, 5000L)), now_, Fault::none};
    controller_.taken_at = now_;
    OffsetCommand command;
    estimator_.step(now_, readings_, controller_, command);
    controller_.applied_um = command.offset_um;
    estimator_.report(report_);
  }
  [[nodiscard]] double displacement_um(std::size_t axis) const {
    return report_.axes[axis].displacement_um;
  }

  fuzz::ScratchFile file_;
  DaemonConfig config_;
  Estimator estimator_;
  nanoseconds now_{std::chrono::hours(1)};
  long steps_{0};
  std::vector<Reading> readings_;
  Report report_;
  ControllerState controller_;
  CycleTiming timing_;
  StatusServer server_;
};

class Client {
 public:
  explicit Client(const std::filesystem::path& path)
      : fd_(socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    FUZZ_REQUIRE(connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
  }
  ~Client() { close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void send(std::span<const std::uint8_t> bytes, Rig& rig) {
    while (!bytes.empty()) {
      const ssize_t count = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (count < 0 && errno != EAGAIN) return;  // the daemon has closed the connection
      if (count > 0) bytes = bytes.subspan(static_cast<std::size_t>(count));
      rig.server().handle(milliseconds(0));
      receive();
    }
    rig.server().handle(milliseconds(0));
    receive();
  }
  /// The server then answers the rest, one request per round, and closes unless we subscribed.
  void end_input(Rig& rig, std::size_t rounds) {
    shutdown(fd_, SHUT_WR);
    for (std::size_t i = 0; i < rounds && !closed_; ++i) {
      rig.server().handle(milliseconds(0));
      receive();
    }
  }
  [[nodiscard]] const std::string& received() const { return received_; }

 private:
  void receive() {
    char bytes[65536];
    for (ssize_t count = 1; count > 0;) {
      count = recv(fd_, bytes, sizeof bytes, 0);
      if (count > 0) received_.append(bytes, static_cast<std::size_t>(count));
      closed_ = closed_ || count == 0 || (count < 0 && errno == ECONNRESET);
    }
  }

  int fd_;
  std::string received_;
  bool closed_{false};
};

void check_answer(const json& answer) {
  FUZZ_REQUIRE(answer.is_object() && answer.value("jsonrpc", "") == "2.0");
  if (answer.contains("method")) {  // a subscription's notification
    FUZZ_REQUIRE(answer.contains("params") && !answer.contains("id"));
    return;
  }
  FUZZ_REQUIRE(answer.contains("id"));
  FUZZ_REQUIRE(answer.contains("result") != answer.contains("error"));
  if (!answer.contains("error")) return;
  const json& error = answer["error"];
  FUZZ_REQUIRE(error.is_object() && error["code"].is_number_integer());
  FUZZ_REQUIRE(error["message"].is_string() && !error["message"].get<std::string>().empty());
  // No client input causes an internal error.
  FUZZ_REQUIRE(error["code"] != rpc::internal_error);
}

void check_answers(const std::string& text) {
  std::size_t begin = 0;
  for (std::size_t end = 0; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    const json answer = json::parse(text.substr(begin, end - begin), nullptr, false);
    FUZZ_REQUIRE(!answer.is_discarded());
    check_answer(answer);
  }
  FUZZ_REQUIRE(begin == text.size());
}

void check_next_client(Rig& rig) {
  Client client(rig.path());
  rig.server().handle(milliseconds(0));
  const std::string ask = "{\"jsonrpc\":\"2.0\",\"id\":7,\"method\":\"offsets\"}\n";
  client.send({reinterpret_cast<const std::uint8_t*>(ask.data()), ask.size()}, rig);
  FUZZ_REQUIRE(client.received().find("\"result\"") != std::string::npos);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Rig rig;
  static unsigned inputs = 0;
  std::span<const std::uint8_t> bytes(data, size);
  {
    Client client(rig.path());
    rig.server().handle(milliseconds(0));
    while (!bytes.empty()) {
      const auto end = std::find(bytes.begin(), bytes.end(), client_waits);
      const auto length = static_cast<std::size_t>(end - bytes.begin());
      client.send(bytes.first(length), rig);
      bytes = bytes.subspan(std::min(length + 1, bytes.size()));
    }
    const auto lines = std::count(data, data + size, std::uint8_t{'\n'});
    client.end_input(rig, 8 + 2 * static_cast<std::size_t>(lines));
    check_answers(client.received());
  }
  for (int i = 0; i < 8; ++i) rig.server().handle(milliseconds(0));
  FUZZ_REQUIRE(rig.server().statistics().clients == 0);
  if (++inputs % 16 == 0) check_next_client(rig);
  return 0;
}
