#pragma once

#include <string>
#include <vector>

namespace active_matching_slam {

/// One of a list that users choose from by name.
struct NamedChoice {
  std::string name;
  std::string description;
};

/// Throws std::invalid_argument "<what> = '<name>' is not one of a, b, c" unless it is listed.
void checkChoice(const std::string& what, const std::string& name,
                 const std::vector<NamedChoice>& choices);

}  // namespace active_matching_slam
