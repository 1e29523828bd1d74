#include "active_matching_slam/math/option_field.h"

#include <algorithm>
#include <stdexcept>

namespace active_matching_slam {

std::string OptionField::text() const {
  const std::string in_brackets = *unit ? " [" + std::string(unit) + "]" : "";
  return meaning + in_brackets;
}

void refuseOption(const std::string& message) { throw std::invalid_argument(message); }

void checkChoice(const std::string& name, const std::string& value,
                 const std::vector<std::string>& choices) {
  if (std::find(choices.begin(), choices.end(), value) != choices.end()) return;
  std::string list;
  for (const std::string& choice : choices) list += (list.empty() ? "" : ", ") + choice;
  refuseOption(name + " = '" + value + "' is not one of " + list);
}

}  // namespace active_matching_slam
