/// Signatures (Ed25519, RFC 8032) by which a person approves a model for a machine.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace thermocomp {

/// The signed data: valid for one machine, model, release and order only.
struct ReleaseOrder {
  std::string machine;
  std::uint64_t release{0};
  std::string checksum;  ///< SHA-256 of the model's text
  bool takes_back{false};

  [[nodiscard]] std::string text() const;
};

/// @param key  PEM of a private key: openssl genpkey -algorithm ed25519
/// @return 128 hexadecimal digits. @throws ConfigurationError naming the file
[[nodiscard]] std::string sign_order(const ReleaseOrder& order, const std::filesystem::path& key);

/// Finds the signer among the public keys NAME.pem in a folder (openssl pkey -pubout).
/// @return NAME; empty: none. @throws ConfigurationError if a key or the folder is unreadable
[[nodiscard]] std::string signer_of(const ReleaseOrder& order, const std::string& signature,
                                    const std::filesystem::path& folder);

}  // namespace thermocomp
