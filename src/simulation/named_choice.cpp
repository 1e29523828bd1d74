#include "active_matching_slam/simulation/named_choice.h"

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

void checkChoice(const std::string& what, const std::string& name,
                 const std::vector<NamedChoice>& choices) {
  std::vector<std::string> names;
  for (const NamedChoice& choice : choices) names.push_back(choice.name);
  checkChoice(what, name, names);
}

}  // namespace active_matching_slam
