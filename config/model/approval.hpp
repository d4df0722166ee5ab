/// Signatures (Ed25519, RFC 8032) by which a person approves a model for a machine, wherever the
/// words travel in between.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace thermocomp {

/// What is signed: neither another machine, nor another model, nor an earlier release, nor the
/// contrary can be made of it.
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

/// Whose key signed it, by the files NAME.pem of a folder with public keys (openssl pkey -pubout).
/// @return NAME; empty: none of them did. @throws ConfigurationError: a key or the folder cannot be
/// read
[[nodiscard]] std::string signer_of(const ReleaseOrder& order, const std::string& signature,
                                    const std::filesystem::path& folder);

}  // namespace thermocomp
