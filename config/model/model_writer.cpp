#include <algorithm>
#include <string>

#include "config/model/model_file.hpp"
#include "config/model/model_tables.hpp"
#include "config/toml/toml_text.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

std::string shared_value(const TermSpec& term, const std::string& name, double value) {
  const TermKind* kind = find_term_kind(term.kind, term.subject);
  THERMOCOMP_ENSURE(kind != nullptr);
  for (const TermParameter& parameter : kind->parameters) {
    if (parameter.name == name && parameter.whole_number) {
      return std::to_string(static_cast<long long>(value));
    }
  }
  return toml_number(value);
}

std::string bank_text(const TermSpec& term) {
  const LagBankSpec& bank = term.bank;
  std::string text = "\n[[term]]\nkind = " + toml_string(term.kind);
  text.append("\nsubjects = ").append(toml_list(bank.subjects, toml_string));
  if (!bank.powers.empty()) text.append("\npowers = ").append(toml_list(bank.powers, toml_number));
  text.append("\ntau_s = ").append(toml_list(bank.taus_s, toml_number)).append("\n");
  for (const auto& [output, gains] : bank.gain_um_per_unit) {
    text.append("gain_um_per_unit.")
        .append(toml_key(output))
        .append(" = ")
        .append(toml_rows(gains));
  }
  return text;
}

std::string term_text(const TermSpec& term) {
  if (term.is_bank()) return bank_text(term);
  std::string text = "\n[[term]]\nkind = " + toml_string(term.kind);
  text.append("\nsubject = ").append(toml_string(term.subject)).append("\n");
  for (const auto& [name, value] : term.shared) {
    text.append(toml_key(name)).append(" = ").append(shared_value(term, name, value)).append("\n");
  }
  for (const auto& [name, outputs] : term.per_output) {
    const auto entry = [](const auto& output) {
      return toml_key(output.first) + " = " + toml_number(output.second);
    };
    std::string table = toml_list(outputs, entry);
    table.front() = '{';
    table.back() = '}';
    text.append(toml_key(name)).append(" = ").append(table).append("\n");
  }
  return text;
}

std::string guideway_text(const GuidewaySpec& guideway) {
  std::string text =
      "\n[guideway." + toml_key(guideway.name) + "]\naxis = " + toml_string(guideway.axis);
  text.append("\npositions_mm = ")
      .append(toml_list(guideway.positions_mm, toml_number))
      .append("\n");
  for (const auto& [output, values] : guideway.rows_um_per_K) {
    text.append("rows_um_per_K.").append(toml_key(output)).append(" = ").append(toml_rows(values));
  }
  return text;
}

}  // namespace

std::string write_covariance(const ThermalModel& model) {
  const CovarianceGrowth& growth = model.covariance_growth;
  const CovarianceGrowth plain;
  std::string text = "[covariance]\nmatrix_K2 = " + toml_rows(model.covariance_K2);
  const auto add = [&text](const char* name, double value, double otherwise) {
    if (value != otherwise) text.append(name).append(" = ").append(toml_number(value)).append("\n");
  };
  const auto add_list = [&text](const char* name, const std::vector<double>& values) {
    if (!values.empty())
      text.append(name).append(" = ").append(toml_list(values, toml_number)).append("\n");
  };
  add("noise_K", growth.noise_K, plain.noise_K);
  add_list("drift_factor", growth.drift_factor);
  add("drift_time_s", growth.drift_time_s, plain.drift_time_s);
  add_list("scatter_factor", growth.scatter_factor);
  add("scatter_time_s", growth.scatter_time_s, plain.scatter_time_s);
  return text;
}

std::string write_model(const ThermalModel& model) {
  std::string text = "format = 1\ninputs = " + toml_list(model.inputs, toml_string);
  text.append("\noutputs = ")
      .append(toml_list(model.outputs, toml_string))
      .append("\nreference = ");
  text += model.reference_degC.empty() ? toml_string("first_sample")
                                       : toml_list(model.reference_degC, toml_number);
  text.append("\nmatrix_um_per_K = ").append(toml_rows(model.matrix_um_per_K));
  for (const GuidewaySpec& guideway : model.guideways) text += guideway_text(guideway);
  for (const TermSpec& term : model.terms) text += term_text(term);
  for (const DiameterSpec& diameter : model.diameters) {
    text.append("\n[[diameter]]\noutput = ").append(toml_string(diameter.output));
    text.append("\naxis = ").append(toml_string(diameter.axis)).append("\n");
    if (diameter.sign < 0) text.append("sign = \"-\"\n");
  }
  if (!model.covariance_K2.empty()) text.append("\n").append(write_covariance(model));
  if (model.made_from) text.append("\n").append(write_made_from(model));
  if (model.course) text.append("\n").append(write_course(model));
  return text;
}

}  // namespace thermocomp
