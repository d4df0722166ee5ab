/// Files that only this computer may read: passwords, certificates and their keys.
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace thermocomp::gateway {

[[nodiscard]] bool is_user_name(const std::string& name);

/// Hashes after crypt(5), by user, from lines `user:hash`; empty lines and those that begin with #
/// are passed over. @throws ConfigurationError naming file, line and rule; also without any user
[[nodiscard]] std::map<std::string, std::string> read_passwords(const std::filesystem::path& file);

/// @throws ConfigurationError unless it is a certificate in PEM
void read_certificate(const std::filesystem::path& file);
/// @throws ConfigurationError unless it is a private key in PEM, without a password
void read_key(const std::filesystem::path& file);
/// @throws ConfigurationError where one of them is none
[[nodiscard]] bool fit_each_other(const std::filesystem::path& certificate,
                                  const std::filesystem::path& key);

}  // namespace thermocomp::gateway
