#pragma once
// The fields of an options struct, said once each: name on the command line, help, allowed values.
// From this come a command's options (Command::Add) and the struct's Problems(); a default is what
// the member's initialiser says. Such a struct declares itself:
//
//   void TrustOptions::Declare(OptionFields* fields) {
//     fields->Number("Trust.max_scale_mad", &max_scale_mad, "Spread ...; larger = more tolerant.")
//         .Positive();
//   }
//   std::vector<std::string> TrustOptions::Problems() const { return ProblemsOf(*this); }
//
// Its header needs only `class OptionFields;`.

#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace roomtex {

// One field. What is said about it follows its declaration, in any order.
class OptionField {
 public:
  using Value = std::variant<bool*, int*, double*, std::string*>;
  enum class Kind { kPlain, kInputPath };

  // Bounds of a number. NaN is beyond all of them; infinity is not, unless Finite().
  OptionField& Above(double low);
  OptionField& AtLeast(double low);
  OptionField& Below(double high);
  OptionField& AtMost(double high);
  OptionField& Finite();
  OptionField& Positive() { return Above(0); }
  OptionField& NotNegative() { return AtLeast(0); }
  OptionField& Between(double low, double high) { return Above(low).Below(high); }
  // "must be LOW to HIGH UNIT": closed.
  OptionField& Within(double low, double high, const std::string& unit = "");
  // A value beyond the bounds that is fine as well: -1 = automatic.
  OptionField& Or(double value);
  // The value is fine when this holds, whatever its bounds or choices say.
  OptionField& Also(bool holds);

  // "must be positive" and the like follow from the bounds. Instead of them: what stands behind the
  // name, or the whole sentence (one that fields share is said once).
  OptionField& Says(const std::string& phrase);
  OptionField& SaysSentence(const std::string& sentence);

  OptionField& Required();  // on the command line
  // On the command line 0 is written and shown as this word ("auto"); integers.
  OptionField& ZeroIs(const std::string& word);
  // Programs set it, no command line does: sentences name it without "--".
  OptionField& Internal();

  const std::string& name() const { return name_; }  // without "--"
  const std::string& help() const { return help_; }
  const Value& value() const { return value_; }
  const std::vector<std::string>& choices() const { return choices_; }  // empty: any text
  Kind kind() const { return kind_; }
  bool required() const { return required_; }
  const std::string& word_of_zero() const { return word_of_zero_; }
  bool internal() const { return internal_; }

  double low() const { return low_; }  // infinite without a bound
  double high() const { return high_; }
  bool Allows(double number) const;
  // What is said of a value that is not allowed.
  std::string Sentence() const;

 private:
  friend class OptionFields;
  struct Relation {
    bool holds;
    std::string sentence;
  };

  OptionField(const std::string& name, Value value, const std::string& help)
      : name_(name), help_(help), value_(value) {}
  bool IsFine() const;
  std::string Phrase() const;

  std::string name_, help_;
  Value value_;
  std::vector<std::string> choices_;
  Kind kind_ = Kind::kPlain;
  bool required_ = false, internal_ = false, finite_ = false, also_ = false;
  double low_ = -std::numeric_limits<double>::infinity();
  double high_ = std::numeric_limits<double>::infinity();
  bool low_is_open_ = false, high_is_open_ = false;
  std::vector<double> or_;
  std::string phrase_, sentence_, word_of_zero_;
  std::vector<Relation> relations_;  // declared behind this field
};

// All fields of one struct, which they point into: it must outlive them.
class OptionFields {
 public:
  // name: without "--". help: what, unit, direction. The references hold until the next
  // declaration.
  OptionField& Bool(const std::string& name, bool* value, const std::string& help);
  OptionField& Int(const std::string& name, int* value, const std::string& help);
  OptionField& Number(const std::string& name, double* value, const std::string& help);
  OptionField& Text(const std::string& name, std::string* value, const std::string& help);
  OptionField& Choice(const std::string& name, std::string* value,
                      const std::vector<std::string>& choices, const std::string& help);
  // A file or folder that is read, listed among the report's inputs; not required.
  OptionField& InputPath(const std::string& name, std::string* value, const std::string& help);

  // What several fields owe each other; said behind the sentence of the last declared one.
  // `holds` is of the values now.
  void Require(bool holds, const std::string& sentence);

  // A sentence for everything that does not hold, each once, in the order of declaration.
  std::vector<std::string> Problems() const;
  // Every sentence that Problems() could say with these values.
  std::vector<std::string> Sentences() const;

  const std::vector<OptionField>& fields() const { return fields_; }
  // These alone, for options that stand apart in a command's help.
  OptionFields Only(const std::vector<std::string>& names) const;
  OptionFields Without(const std::vector<std::string>& names) const;

 private:
  OptionField& Declare(OptionField field);

  std::vector<OptionField> fields_;
};

template <typename Options>
OptionFields FieldsOf(Options* options) {
  OptionFields fields;
  options->Declare(&fields);
  return fields;
}

// By value: Declare() points to what it declares.
template <typename Options>
std::vector<std::string> ProblemsOf(Options options) {
  return FieldsOf(&options).Problems();
}

}  // namespace roomtex
