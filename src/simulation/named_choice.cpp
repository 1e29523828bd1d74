#include "active_matching_slam/simulation/named_choice.h"

#include <stdexcept>

namespace active_matching_slam {

void checkChoice(const std::string& what, const std::string& name,
                 const std::vector<NamedChoice>& choices) {
  std::string list;
  for (const NamedChoice& choice : choices) {
    if (choice.name == name) return;
    list += (list.empty() ? "" : ", ") + choice.name;
  }
  throw std::invalid_argument(what + " is '" + name + "', must be one of " + list);
}

}  // namespace active_matching_slam
