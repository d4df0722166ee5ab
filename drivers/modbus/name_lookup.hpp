/// Host names to addresses without ever blocking the caller for longer than it wants to.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <sys/socket.h>

namespace thermocomp {

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length{0};
};

/// A numeric address is known at once; a name is looked up by a thread of its own, which may
/// outlive this object (the name service cannot be interrupted).
class NameLookup {
 public:
  NameLookup(const std::string& host, int port);
  NameLookup(const NameLookup&) = delete;
  NameLookup& operator=(const NameLookup&) = delete;
  ~NameLookup();

  /// Readable once done() can be called.
  [[nodiscard]] int done_fd() const noexcept;
  [[nodiscard]] bool done() const noexcept;
  /// @pre done()
  /// @return the address, or nothing with `error` set
  [[nodiscard]] std::optional<SocketAddress> result(std::string& error) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace thermocomp
