#include "gateway/http/http_server.hpp"

#include <arpa/inet.h>
#include <array>
#include <cstdarg>
#include <cstring>
#include <microhttpd.h>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include "config/toml/toml_reader.hpp"
#include "gateway/http/password_file.hpp"
#include "gateway/http/request_rules.hpp"

namespace thermocomp::gateway {
namespace {

constexpr std::size_t body_bytes_max = 4096;
constexpr std::size_t header_bytes_max = std::size_t{16} * 1024;
constexpr unsigned silence_s_max = 10;

/// Content policy: files of this gateway only, no frames.
constexpr const char* own_files_only =
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' "
    "data:; connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";
/// Policy for a page with inline scripts, from a file named by the administrator.
constexpr const char* own_scripts =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src "
    "'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
constexpr std::size_t gzip_bytes_min = 1400;  // about one packet
constexpr std::array<std::array<const char*, 2>, 5> headers_of_all{
    {{"X-Content-Type-Options", "nosniff"},
     {"X-Frame-Options", "DENY"},
     {"Referrer-Policy", "no-referrer"},
     {"Cross-Origin-Resource-Policy", "same-origin"},
     {"Cache-Control", "no-store"}}};

std::string_view header(MHD_Connection* connection, const char* name) {
  const char* value = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
  return value != nullptr ? value : "";
}

bool takes_gzip(MHD_Connection* connection) {
  return header(connection, MHD_HTTP_HEADER_ACCEPT_ENCODING).find("gzip") != std::string_view::npos;
}

void add_gzip_headers(MHD_Response* response) {
  if (response == nullptr) return;
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_ENCODING, "gzip");
  MHD_add_response_header(response, MHD_HTTP_HEADER_VARY, MHD_HTTP_HEADER_ACCEPT_ENCODING);
}

MHD_Result count_once(void* cls, MHD_ValueKind /*kind*/, const char* key, const char* /*value*/) {
  auto& facts = *static_cast<RequestFacts*>(cls);
  if (strcasecmp(key, MHD_HTTP_HEADER_HOST) == 0) ++facts.hosts_given;
  for (const char* name : {MHD_HTTP_HEADER_CONTENT_LENGTH, MHD_HTTP_HEADER_TRANSFER_ENCODING})
    if (strcasecmp(key, name) == 0) ++facts.lengths_given;
  return MHD_YES;
}

MHD_Result add_size(void* cls, MHD_ValueKind /*kind*/, const char* key, const char* value) {
  *static_cast<std::size_t*>(cls) += std::strlen(key) + (value != nullptr ? std::strlen(value) : 0);
  return MHD_YES;
}

int socket_of(MHD_Connection* connection) {
  const MHD_ConnectionInfo* info =
      MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
  return info != nullptr ? info->connect_fd : -1;
}

[[gnu::format(printf, 2, 0)]] void log_library(void* /*cls*/, const char* format,
                                               va_list arguments) {
  std::array<char, 300> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  spdlog::debug("http: {}", text.data());
}

/// Closes the connection after the answer, because bytes after a refused request may be its body
/// and must not be parsed as the next request.
void end_with(MHD_Response* response) {
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONNECTION, "close");
}

/// State of a request in progress.
struct Request {
  std::string body;
  bool is_too_large{false};
  std::optional<JsonAnswer> answer;
  std::string user;  ///< empty: no password file
};

struct Address {
  sockaddr_storage bytes{};
  bool is_six{false};
};

Address address_of(const HttpSettings& settings) {
  Address address;
  auto* four = reinterpret_cast<sockaddr_in*>(&address.bytes);
  if (inet_pton(AF_INET, settings.address.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    four->sin_port = htons(settings.port);
    return address;
  }
  auto* six = reinterpret_cast<sockaddr_in6*>(&address.bytes);
  six->sin6_family = AF_INET6;
  six->sin6_port = htons(settings.port);
  inet_pton(AF_INET6, settings.address.c_str(), &six->sin6_addr);
  address.is_six = true;
  return address;
}

}  // namespace

struct HttpServer::Parts {
  Parts(const HttpSettings& settings_in, const PageFiles& files_in, Handler handler_in);
  ~Parts();

  // libmicrohttpd's callbacks; `cls` is this object.
  static MHD_Result on_request(void* cls, MHD_Connection* connection, const char* path,
                               const char* method, const char* version, const char* data,
                               std::size_t* size, void** state);
  static void on_completed(void* cls, MHD_Connection* connection, void** state,
                           MHD_RequestTerminationCode code);
  static void on_connection(void* cls, MHD_Connection* connection, void** context,
                            MHD_ConnectionNotificationCode code);

  void listen();
  MHD_Result serve(MHD_Connection* connection, const char* path, const char* method,
                   const char* data, std::size_t* size, void** state);
  MHD_Result begin(MHD_Connection* connection, const char* path, const char* method, void** state);
  [[nodiscard]] std::optional<Refusal> judge(MHD_Connection* connection, const char* path,
                                             const char* method) const;
  std::optional<MHD_Result> refuse_stranger(MHD_Connection* connection, Request& request);
  MHD_Result answer(MHD_Connection* connection, unsigned status, const char* type,
                    std::string text);
  MHD_Result queue(MHD_Connection* connection, unsigned status, const char* type,
                   MHD_Response* response, const char* policy = own_files_only);
  MHD_Result send(MHD_Connection* connection, const PageFile& file);

  const HttpSettings& settings;
  const PageFiles& files;
  Handler handler;
  HostRules hosts;
  std::optional<PasswordFile> passwords;
  SlowConnections connections;
  std::atomic<std::uint64_t> requests{0};
  std::atomic<std::uint64_t> refused{0};
  std::string certificate;  // libmicrohttpd keeps pointers to both
  std::string key;
  MHD_Daemon* daemon{nullptr};
  std::uint16_t port{0};
};

/// One request during its handler.
class HttpServer::Exchange final : public HttpExchange {
 public:
  Exchange(Parts& server, MHD_Connection* connection, const char* path, bool is_post,
           Request& request)
      : server_(server),
        connection_(connection),
        path_(path),
        is_post_(is_post),
        request_(request) {}

  [[nodiscard]] std::string_view path() const override { return path_; }
  [[nodiscard]] bool is_post() const override { return is_post_; }
  [[nodiscard]] std::string_view header(const char* name) const override {
    return gateway::header(connection_, name);
  }
  [[nodiscard]] std::string_view argument(const char* name) const override {
    const char* value = MHD_lookup_connection_value(connection_, MHD_GET_ARGUMENT_KIND, name);
    return value != nullptr ? value : "";
  }
  [[nodiscard]] const std::string& user() const override { return request_.user; }
  [[nodiscard]] const std::string& body() const override { return request_.body; }
  void answer(unsigned status, const char* type, std::string text) override {
    result_ = server_.answer(connection_, status, type, std::move(text));
  }
  void later(AnswerThread& answers, AnswerThread::Work work) override;
  void stream(EventStreams& streams) override;
  [[nodiscard]] MHD_Result result() const { return result_; }

 private:
  Parts& server_;
  MHD_Connection* connection_;
  std::string_view path_;
  bool is_post_;
  Request& request_;
  MHD_Result result_{MHD_NO};
};

/// When the answer is ready, libmicrohttpd calls on_request() again.
void HttpServer::Exchange::later(AnswerThread& answers, AnswerThread::Work work) {
  // The request is complete: the time of its answer counts, not the idle time before it.
  server_.connections.is_at(socket_of(connection_), SlowConnections::Stage::answer,
                            SlowConnections::Clock::now());
  MHD_suspend_connection(connection_);
  const auto done = [&request = request_, connection = connection_](JsonAnswer made) {
    request.answer = std::move(made);
    MHD_resume_connection(connection);
  };
  if (!answers.ask(std::move(work), done))
    done({MHD_HTTP_SERVICE_UNAVAILABLE, error_text("too many requests are waiting")});
  result_ = MHD_YES;
}

/// Open pages leave a tenth of the connections to everything else: the metrics, new pages' files.
void HttpServer::Exchange::stream(EventStreams& streams) {
  const std::size_t most = server_.settings.connections_max;
  if (streams.count() + std::max<std::size_t>(1, most / 10) >= most) {
    result_ = server_.answer(connection_, MHD_HTTP_SERVICE_UNAVAILABLE, json_type,
                             error_text("too many pages are open (connections_max)"));
    return;
  }
  server_.connections.is_at(socket_of(connection_), SlowConnections::Stage::stream,
                            SlowConnections::Clock::now());
  result_ = server_.queue(connection_, MHD_HTTP_OK, "text/event-stream", streams.open(connection_));
}

HttpServer::Parts::Parts(const HttpSettings& settings_in, const PageFiles& files_in,
                         Handler handler_in)
    : settings(settings_in),
      files(files_in),
      handler(std::move(handler_in)),
      hosts(settings_in.address, settings_in.names),
      connections(settings_in.connections_max) {
  if (!settings.passwords.empty()) passwords.emplace(settings.passwords);
  if (settings.has_tls()) {
    certificate = read_text_file(settings.certificate);
    key = read_text_file(settings.key);
  }
  listen();
}

HttpServer::Parts::~Parts() {
  if (daemon != nullptr) MHD_stop_daemon(daemon);
}

MHD_Result HttpServer::Parts::queue(MHD_Connection* connection, unsigned status, const char* type,
                                    MHD_Response* response, const char* policy) {
  if (response == nullptr) return MHD_NO;
  MHD_add_response_header(response, "Content-Security-Policy", policy);
  for (const auto& [name, value] : headers_of_all) MHD_add_response_header(response, name, value);
  MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
  if (status >= MHD_HTTP_BAD_REQUEST) end_with(response);
  if (settings.has_tls())
    MHD_add_response_header(response, "Strict-Transport-Security", "max-age=31536000");
  const MHD_Result queued = MHD_queue_response(connection, status, response);
  MHD_destroy_response(response);
  ++requests;
  return queued;
}

MHD_Result HttpServer::Parts::answer(MHD_Connection* connection, unsigned status, const char* type,
                                     std::string text) {
  connections.is_at(socket_of(connection), SlowConnections::Stage::answer,
                    SlowConnections::Clock::now());
  std::string gzip;
  if (text.size() >= gzip_bytes_min && takes_gzip(connection)) gzip = gzipped(text);
  const std::string& sent = gzip.empty() ? text : gzip;
  MHD_Response* response = MHD_create_response_from_buffer(
      sent.size(), const_cast<char*>(sent.data()), MHD_RESPMEM_MUST_COPY);
  if (!gzip.empty()) add_gzip_headers(response);
  return queue(connection, status, type, response);
}

MHD_Result HttpServer::Parts::send(MHD_Connection* connection, const PageFile& file) {
  connections.is_at(socket_of(connection), SlowConnections::Stage::answer,
                    SlowConnections::Clock::now());
  const bool is_gzip = !file.gzip.empty() && takes_gzip(connection);
  const std::string& sent = is_gzip ? file.gzip : file.bytes;
  MHD_Response* response = MHD_create_response_from_buffer(
      sent.size(), const_cast<char*>(sent.data()), MHD_RESPMEM_PERSISTENT);
  if (is_gzip) add_gzip_headers(response);
  return queue(connection, MHD_HTTP_OK, file.type.c_str(), response,
               file.has_own_scripts ? own_scripts : own_files_only);
}

std::optional<Refusal> HttpServer::Parts::judge(MHD_Connection* connection, const char* path,
                                                const char* method) const {
  RequestFacts facts{method,
                     path,
                     header(connection, MHD_HTTP_HEADER_HOST),
                     header(connection, "Origin"),
                     header(connection, "Sec-Fetch-Site"),
                     0,
                     0};
  MHD_get_connection_values(connection, MHD_HEADER_KIND, &count_once, &facts);
  MHD_get_connection_values(connection, MHD_GET_ARGUMENT_KIND, &add_size, &facts.query_bytes);
  return judge_request(facts, hosts);
}

/// @return nullopt: the request may proceed
std::optional<MHD_Result> HttpServer::Parts::refuse_stranger(MHD_Connection* connection,
                                                             Request& request) {
  if (!passwords) return std::nullopt;
  char* password = nullptr;
  char* user = MHD_basic_auth_get_username_password(connection, &password);
  const bool is_given = user != nullptr && password != nullptr;
  const PasswordFile::Answer checked =
      is_given ? passwords->check(user, password, PasswordFile::Clock::now())
               : PasswordFile::Answer::wrong;
  if (is_given) request.user = user;
  MHD_free(user);
  MHD_free(password);
  if (checked == PasswordFile::Answer::right) return std::nullopt;
  ++refused;
  if (checked == PasswordFile::Answer::too_many)
    return answer(connection, MHD_HTTP_TOO_MANY_REQUESTS, json_type,
                  error_text("too many wrong passwords; try again in a few seconds"));
  const std::string text = error_text("user and password are required");
  MHD_Response* response = MHD_create_response_from_buffer(
      text.size(), const_cast<char*>(text.data()), MHD_RESPMEM_MUST_COPY);
  if (response == nullptr) return MHD_NO;
  end_with(response);
  const MHD_Result queued = MHD_queue_basic_auth_fail_response(connection, "thermocomp", response);
  MHD_destroy_response(response);
  return queued;
}

MHD_Result HttpServer::Parts::begin(MHD_Connection* connection, const char* path,
                                    const char* method, void** state) {
  auto request = std::make_unique<Request>();
  Request& begun = *request;
  *state = request.release();  // deleted by on_completed()
  if (const std::optional<Refusal> refusal = judge(connection, path, method)) {
    ++refused;
    return answer(connection, refusal->status, json_type, error_text(refusal->text));
  }
  if (const std::optional<MHD_Result> done = refuse_stranger(connection, begun)) return *done;
  return MHD_YES;
}

MHD_Result HttpServer::Parts::serve(MHD_Connection* connection, const char* path,
                                    const char* method, const char* data, std::size_t* size,
                                    void** state) {
  if (*state == nullptr) return begin(connection, path, method, state);
  Request& request = *static_cast<Request*>(*state);
  if (*size > 0) {
    request.is_too_large = request.is_too_large || request.body.size() + *size > body_bytes_max;
    if (!request.is_too_large) request.body.append(data, *size);
    *size = 0;
    return MHD_YES;
  }
  if (request.is_too_large) {
    ++refused;
    return answer(connection, MHD_HTTP_CONTENT_TOO_LARGE, json_type,
                  error_text("a body must have at most 4096 bytes"));
  }
  if (request.answer)
    return answer(connection, request.answer->status, json_type, std::move(request.answer->text));
  const bool is_post = std::strcmp(method, "POST") == 0;
  const PageFile* file = is_post ? nullptr : files.find(path);
  if (file != nullptr) return send(connection, *file);
  Exchange exchange(*this, connection, path, is_post, request);
  handler(exchange);
  return exchange.result();
}

void HttpServer::Parts::listen() {
  const Address address = address_of(settings);
  std::vector<MHD_OptionItem> options;
  const auto add = [&options](MHD_OPTION option, std::intptr_t value, void* pointer = nullptr) {
    options.push_back({option, value, pointer});
  };
  const auto callback = [](auto* function) { return reinterpret_cast<std::intptr_t>(function); };
  add(MHD_OPTION_EXTERNAL_LOGGER, callback(&log_library));
  add(MHD_OPTION_NOTIFY_COMPLETED, callback(&on_completed), this);
  add(MHD_OPTION_NOTIFY_CONNECTION, callback(&on_connection), this);
  add(MHD_OPTION_CONNECTION_LIMIT, settings.connections_max);
  add(MHD_OPTION_CONNECTION_TIMEOUT, silence_s_max);
  add(MHD_OPTION_CONNECTION_MEMORY_LIMIT, header_bytes_max);
  add(MHD_OPTION_STRICT_FOR_CLIENT, 1);
  add(MHD_OPTION_SOCK_ADDR, 0, const_cast<sockaddr_storage*>(&address.bytes));
  unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG;
  if (address.is_six) flags |= MHD_USE_IPv6;
  if (settings.has_tls()) {
    flags |= MHD_USE_TLS;
    add(MHD_OPTION_HTTPS_MEM_CERT, 0, certificate.data());
    add(MHD_OPTION_HTTPS_MEM_KEY, 0, key.data());
    add(MHD_OPTION_HTTPS_PRIORITIES, 0,
        const_cast<char*>("SECURE128:-VERS-ALL:+VERS-TLS1.3:+VERS-TLS1.2"));
  }
  add(MHD_OPTION_END, 0);
  daemon = MHD_start_daemon(flags, settings.port, nullptr, nullptr, &on_request, this,
                            MHD_OPTION_ARRAY, options.data(), MHD_OPTION_END);
  const std::string place = settings.address + " port " + std::to_string(settings.port);
  if (daemon == nullptr)
    throw std::runtime_error(
        "cannot listen on " + place +
        (settings.has_tls()
             ? " (in use, not an address of this computer, or certificate and key do not match)"
             : " (in use, or not an address of this computer)"));
  const MHD_DaemonInfo* info = MHD_get_daemon_info(daemon, MHD_DAEMON_INFO_BIND_PORT);
  port = info != nullptr ? info->port : settings.port;
}

MHD_Result HttpServer::Parts::on_request(void* cls, MHD_Connection* connection, const char* path,
                                         const char* method, const char* /*version*/,
                                         const char* data, std::size_t* size, void** state) {
  try {
    return static_cast<Parts*>(cls)->serve(connection, path, method, data, size, state);
  } catch (const std::exception& error) {
    spdlog::error("http: {}", error.what());
    return MHD_NO;  // closes the connection
  }
}

void HttpServer::Parts::on_completed(void* cls, MHD_Connection* connection, void** state,
                                     MHD_RequestTerminationCode /*code*/) {
  delete static_cast<Request*>(*state);
  *state = nullptr;
  static_cast<Parts*>(cls)->connections.is_at(
      socket_of(connection), SlowConnections::Stage::request, SlowConnections::Clock::now());
}

void HttpServer::Parts::on_connection(void* cls, MHD_Connection* connection, void** /*context*/,
                                      MHD_ConnectionNotificationCode code) {
  SlowConnections& connections = static_cast<Parts*>(cls)->connections;
  if (code == MHD_CONNECTION_NOTIFY_STARTED)
    connections.opened(socket_of(connection), SlowConnections::Clock::now());
  else
    connections.closed(socket_of(connection));
}

HttpServer::HttpServer(const HttpSettings& settings, const PageFiles& files, Handler handler)
    : parts_(std::make_unique<Parts>(settings, files, std::move(handler))) {}
HttpServer::~HttpServer() = default;

void HttpServer::end_slow_connections() {
  parts_->connections.end_slow(SlowConnections::Clock::now());
}

std::uint16_t HttpServer::port() const noexcept {
  return parts_->port;
}

std::uint64_t HttpServer::requests() const noexcept {
  return parts_->requests;
}

std::atomic<std::uint64_t>& HttpServer::refused() noexcept {
  return parts_->refused;
}

}  // namespace thermocomp::gateway
