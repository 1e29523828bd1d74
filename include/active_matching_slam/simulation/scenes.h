#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "active_matching_slam/simulation/named_choice.h"
#include "active_matching_slam/simulation/scene.h"

namespace active_matching_slam {

/// Names for createScene(), each with a line that describes it.
const std::vector<NamedChoice>& sceneChoices();

/// Builds a scene of textured rectangles, lit and ready to render. `seed` varies textures and the
/// places of small things, not the layout. Throws std::invalid_argument that lists the names for
/// any other name.
Scene createScene(const std::string& name, std::uint64_t seed = 1);

}  // namespace active_matching_slam
