#include "core/option_fields.h"

#include <algorithm>
#include <cmath>

#include "core/text.h"

namespace roomtex {
namespace {

std::string LimitText(double limit) { return Significant(limit, 15); }

bool Contains(const std::vector<std::string>& all, const std::string& one) {
  return std::find(all.begin(), all.end(), one) != all.end();
}

// "a, b or c"
std::string Listed(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
  }
  return text;
}

}  // namespace

OptionField& OptionField::Above(double low) {
  low_ = low;
  low_is_open_ = true;
  return *this;
}

OptionField& OptionField::AtLeast(double low) {
  low_ = low;
  low_is_open_ = false;
  return *this;
}

OptionField& OptionField::Below(double high) {
  high_ = high;
  high_is_open_ = true;
  return *this;
}

OptionField& OptionField::AtMost(double high) {
  high_ = high;
  high_is_open_ = false;
  return *this;
}

OptionField& OptionField::Finite() {
  finite_ = true;
  return *this;
}

OptionField& OptionField::Within(double low, double high, const std::string& unit) {
  AtLeast(low).AtMost(high);
  return Says("must be " + LimitText(low) + " to " + LimitText(high) +
              (unit.empty() ? "" : " " + unit));
}

OptionField& OptionField::Or(double value) {
  or_.push_back(value);
  return *this;
}

OptionField& OptionField::Also(bool holds) {
  also_ = holds;
  return *this;
}

OptionField& OptionField::Says(const std::string& phrase) {
  phrase_ = phrase;
  return *this;
}

OptionField& OptionField::SaysSentence(const std::string& sentence) {
  sentence_ = sentence;
  return *this;
}

OptionField& OptionField::Required() {
  required_ = true;
  return *this;
}

OptionField& OptionField::ZeroIs(const std::string& word) {
  word_of_zero_ = word;
  return *this;
}

OptionField& OptionField::Internal() {
  internal_ = true;
  return *this;
}

bool OptionField::Allows(double number) const {
  if (also_ || std::find(or_.begin(), or_.end(), number) != or_.end()) return true;
  if (finite_ && !std::isfinite(number)) return false;
  return (low_is_open_ ? number > low_ : number >= low_) &&
         (high_is_open_ ? number < high_ : number <= high_);
}

bool OptionField::IsFine() const {
  if (const auto* const number = std::get_if<int*>(&value_)) return Allows(**number);
  if (const auto* const number = std::get_if<double*>(&value_)) {
    const bool is_bound = std::isfinite(low_) || std::isfinite(high_) || finite_;
    return !is_bound || Allows(**number);
  }
  if (const auto* const text = std::get_if<std::string*>(&value_)) {
    return also_ || choices_.empty() || Contains(choices_, **text);
  }
  return true;
}

std::string OptionField::Phrase() const {
  if (!phrase_.empty()) return phrase_;
  if (!choices_.empty()) {
    return "must be " + Listed(choices_) + ", is " + *std::get<std::string*>(value_);
  }
  const bool has_low = std::isfinite(low_), has_high = std::isfinite(high_);
  if (has_low && has_high) {
    return "must lie between " + LimitText(low_) + " and " + LimitText(high_);
  }
  if (has_high) return (high_is_open_ ? "must be below " : "must be at most ") + LimitText(high_);
  if (!has_low) return "must be a finite number";
  if (low_ == 0) return low_is_open_ ? "must be positive" : "must not be negative";
  return (low_is_open_ ? "must be greater than " : "must be at least ") + LimitText(low_);
}

std::string OptionField::Sentence() const {
  if (!sentence_.empty()) return sentence_;
  return (internal_ ? "" : "--") + name_ + " " + Phrase();
}

OptionField& OptionFields::Declare(OptionField field) {
  fields_.push_back(std::move(field));
  return fields_.back();
}

OptionField& OptionFields::Bool(const std::string& name, bool* value, const std::string& help) {
  return Declare({name, value, help});
}

OptionField& OptionFields::Int(const std::string& name, int* value, const std::string& help) {
  return Declare({name, value, help});
}

OptionField& OptionFields::Number(const std::string& name, double* value, const std::string& help) {
  return Declare({name, value, help});
}

OptionField& OptionFields::Text(const std::string& name, std::string* value,
                                const std::string& help) {
  return Declare({name, value, help});
}

OptionField& OptionFields::Choice(const std::string& name, std::string* value,
                                  const std::vector<std::string>& choices,
                                  const std::string& help) {
  OptionField& field = Declare({name, value, help});
  field.choices_ = choices;
  return field;
}

OptionField& OptionFields::InputPath(const std::string& name, std::string* value,
                                     const std::string& help) {
  OptionField& field = Declare({name, value, help});
  field.kind_ = OptionField::Kind::kInputPath;
  return field;
}

void OptionFields::Require(bool holds, const std::string& sentence) {
  fields_.back().relations_.push_back({holds, sentence});
}

std::vector<std::string> OptionFields::Problems() const {
  std::vector<std::string> problems;
  const auto require = [&problems](bool holds, const std::string& sentence) {
    if (!holds && !Contains(problems, sentence)) problems.push_back(sentence);
  };
  for (const OptionField& field : fields_) {
    require(field.IsFine(), field.Sentence());
    for (const OptionField::Relation& relation : field.relations_) {
      require(relation.holds, relation.sentence);
    }
  }
  return problems;
}

std::vector<std::string> OptionFields::Sentences() const {
  std::vector<std::string> sentences;
  for (const OptionField& field : fields_) {
    sentences.push_back(field.Sentence());
    for (const OptionField::Relation& relation : field.relations_) {
      sentences.push_back(relation.sentence);
    }
  }
  return sentences;
}

OptionFields OptionFields::Only(const std::vector<std::string>& names) const {
  OptionFields some;
  std::copy_if(fields_.begin(), fields_.end(), std::back_inserter(some.fields_),
               [&](const OptionField& field) { return Contains(names, field.name()); });
  return some;
}

OptionFields OptionFields::Without(const std::vector<std::string>& names) const {
  OptionFields some;
  std::copy_if(fields_.begin(), fields_.end(), std::back_inserter(some.fields_),
               [&](const OptionField& field) { return !Contains(names, field.name()); });
  return some;
}

}  // namespace roomtex
