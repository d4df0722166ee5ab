/// Users of the page and their passwords, as crypt(5) hashes.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <string>

namespace thermocomp::gateway {

class PasswordFile {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Answer { right, wrong, too_many };

  /// @throws ConfigurationError as read_passwords()
  explicit PasswordFile(const std::filesystem::path& file);

  /// A hash takes some hundredths of a second by design. The last correct password of each user is
  /// therefore cached (as a digest with a key of this process), and other attempts are
  /// rate-limited: guessing is slow and does not lock out logged-in users.
  [[nodiscard]] Answer check(const std::string& user, const std::string& password,
                             Clock::time_point now);

  static constexpr double looked_at_per_s = 4.0;
  static constexpr double looked_at_burst = 8.0;

 private:
  [[nodiscard]] std::string digest(const std::string& user, const std::string& password) const;

  std::map<std::string, std::string> hashes_;  ///< by user
  std::map<std::string, std::string> right_;   ///< digest of the last correct password, by user
  std::string key_;                            ///< random
  double tokens_{looked_at_burst};
  Clock::time_point filled_at_{};
};

/// Line for the file. @throws std::runtime_error if user name or password is not allowed
[[nodiscard]] std::string password_line(const std::string& user, const std::string& password);

}  // namespace thermocomp::gateway
