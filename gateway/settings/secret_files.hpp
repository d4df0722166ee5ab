/// Files readable only by this computer: passwords, certificates and their keys.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace thermocomp::gateway {

[[nodiscard]] bool is_user_name(const std::string& name);

/// crypt(5) hashes by user, from lines `user:hash`; empty lines and lines with # are skipped.
/// @throws ConfigurationError naming file, line and rule; also if there is no user
[[nodiscard]] std::map<std::string, std::string> read_passwords(const std::filesystem::path& file);

/// @throws ConfigurationError unless the file is a certificate in PEM
void read_certificate(const std::filesystem::path& file);
/// @throws ConfigurationError unless the file is a private key in PEM, without a password
void read_key(const std::filesystem::path& file);
/// @throws ConfigurationError if a file is invalid
[[nodiscard]] bool fit_each_other(const std::filesystem::path& certificate,
                                  const std::filesystem::path& key);

}  // namespace thermocomp::gateway
