#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "active_matching_slam/math/option_field.h"
#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/tracker/tracker_options.h"

namespace XmlRpc {
class XmlRpcValue;
}

namespace active_matching_slam {

using OptionValue = std::variant<bool, std::int64_t, double, std::string>;

/// One setting as data: its description, its range, and a way to read and write it.
class BoundOption {
 public:
  BoundOption(const OptionField& field, bool* target) : field_(field), target_(target) {}
  BoundOption(const OptionField& field, std::string* target) : field_(field), target_(target) {}
  BoundOption(const OptionField& field, UpdateRule* target) : field_(field), target_(target) {}
  template <class Number>
  BoundOption(const OptionField& field, Number* target, Number minimum, Number maximum)
      : field_(field),
        target_(target),
        minimum_(static_cast<double>(minimum)),
        maximum_(static_cast<double>(maximum)) {}

  std::string name() const { return field_.name; }
  const OptionField& field() const { return field_; }
  bool isNumber() const;
  double minimum() const { return minimum_; }  ///< of a number; closed range
  double maximum() const { return maximum_; }

  OptionValue get() const;
  /// Writes without a check of the range. Throws std::invalid_argument, naming the setting, when
  /// the type does not fit (whole numbers fit where a fraction is asked for, not the other way
  /// round).
  void set(const OptionValue& value) const;

 private:
  OptionField field_;
  std::variant<bool*, std::string*, UpdateRule*, int*, double*, std::int64_t*, std::uint64_t*>
      target_;
  double minimum_ = 0.0, maximum_ = 0.0;
};

/// Every setting of the objects, which must outlive the result.
std::vector<BoundOption> bindOptions(TrackerOptions* tracker, NodeOptions* node);

/// Takes the values of a parameter tree (a private namespace) over the present ones. Throws
/// std::invalid_argument with the full name (`prefix` + name) of a parameter that is unknown, of
/// the wrong type, or out of range. Namespaces of others (topics' plugins) are passed over.
void readParameterTree(const std::vector<BoundOption>& options, XmlRpc::XmlRpcValue& tree,
                       const std::string& prefix);

/// Moves numbers into their range; appends a sentence for each that was moved.
OptionValue clipToRange(const BoundOption& option, const OptionValue& value,
                        std::vector<std::string>* warnings);

std::string toText(const OptionValue& value);

}  // namespace active_matching_slam
