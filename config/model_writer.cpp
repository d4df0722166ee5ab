#include <algorithm>
#include <cctype>
#include <string>

#include "config/model_file.hpp"
#include "config/number_text.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

/// A TOML basic string.
std::string toml_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      constexpr std::string_view digits = "0123456789ABCDEF";
      const auto code = static_cast<unsigned char>(c);
      result.append("\\u00") += digits[code >> 4u];
      result += digits[code & 15u];
    } else {
      result += c;
    }
  }
  return result + '"';
}

std::string key(std::string_view name) {
  const auto bare = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
  };
  return !name.empty() && std::all_of(name.begin(), name.end(), bare) ? std::string(name)
                                                                      : toml_string(name);
}

/// A TOML float: unlike JSON's it needs a point or an exponent to be one.
std::string number(double value) {
  std::string text = number_text(value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

template <class Values, class Show>
std::string list(const Values& values, Show show) {
  std::string text = "[";
  for (const auto& value : values) text.append(text.size() == 1 ? "" : ", ").append(show(value));
  return text + "]";
}

std::string rows(const std::vector<std::vector<double>>& values) {
  std::string text = "[\n";
  for (const auto& row : values) text.append("  ").append(list(row, number)).append(",\n");
  return text + "]\n";
}

std::string shared_value(const TermSpec& term, const std::string& name, double value) {
  const TermKind* kind = find_term_kind(term.kind, term.subject);
  THERMOCOMP_ENSURE(kind != nullptr);
  for (const TermParameter& parameter : kind->parameters) {
    if (parameter.name == name && parameter.whole_number) {
      return std::to_string(static_cast<long long>(value));
    }
  }
  return number(value);
}

std::string term_text(const TermSpec& term) {
  std::string text = "\n[[term]]\nkind = " + toml_string(term.kind);
  text.append("\nsubject = ").append(toml_string(term.subject)).append("\n");
  for (const auto& [name, value] : term.shared) {
    text.append(key(name)).append(" = ").append(shared_value(term, name, value)).append("\n");
  }
  for (const auto& [name, outputs] : term.per_output) {
    const auto entry = [](const auto& output) {
      return key(output.first) + " = " + number(output.second);
    };
    std::string table = list(outputs, entry);
    table.front() = '{';
    table.back() = '}';
    text.append(key(name)).append(" = ").append(table).append("\n");
  }
  return text;
}

std::string guideway_text(const GuidewaySpec& guideway) {
  std::string text =
      "\n[guideway." + key(guideway.name) + "]\naxis = " + toml_string(guideway.axis);
  text.append("\npositions_mm = ").append(list(guideway.positions_mm, number)).append("\n");
  for (const auto& [output, values] : guideway.rows_um_per_K) {
    text.append("rows_um_per_K.").append(key(output)).append(" = ").append(rows(values));
  }
  return text;
}

}  // namespace

std::string write_covariance(const ThermalModel& model) {
  const CovarianceGrowth& growth = model.covariance_growth;
  const CovarianceGrowth plain;
  std::string text = "[covariance]\nmatrix_K2 = " + rows(model.covariance_K2);
  const auto add = [&text](const char* name, double value, double otherwise) {
    if (value != otherwise) text.append(name).append(" = ").append(number(value)).append("\n");
  };
  const auto add_list = [&text](const char* name, const std::vector<double>& values) {
    if (!values.empty()) text.append(name).append(" = ").append(list(values, number)).append("\n");
  };
  add("noise_K", growth.noise_K, plain.noise_K);
  add_list("drift_factor", growth.drift_factor);
  add("drift_time_s", growth.drift_time_s, plain.drift_time_s);
  add_list("scatter_factor", growth.scatter_factor);
  add("scatter_time_s", growth.scatter_time_s, plain.scatter_time_s);
  return text;
}

std::string write_model(const ThermalModel& model) {
  std::string text = "format = 1\ninputs = " + list(model.inputs, toml_string);
  text.append("\noutputs = ").append(list(model.outputs, toml_string)).append("\nreference = ");
  text += model.reference_degC.empty() ? toml_string("first_sample")
                                       : list(model.reference_degC, number);
  text.append("\nmatrix_um_per_K = ").append(rows(model.matrix_um_per_K));
  for (const GuidewaySpec& guideway : model.guideways) text += guideway_text(guideway);
  for (const TermSpec& term : model.terms) text += term_text(term);
  if (!model.covariance_K2.empty()) text.append("\n").append(write_covariance(model));
  return text;
}

}  // namespace thermocomp
