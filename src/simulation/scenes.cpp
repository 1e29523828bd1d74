#include "active_matching_slam/simulation/scenes.h"

#include "scene_builder.h"

namespace active_matching_slam {

const std::vector<NamedChoice>& sceneChoices() {
  static const std::vector<NamedChoice> choices = {
      {"room", "a furnished room: desk, bookcase, pictures, carpet, boxes"},
      {"office", "a larger office: four desks, partitions, bookcases, pillar, windows"},
      {"walkway", "outdoors: paving, colonnade, facade and a far background"},
      {"desk", "a desk top seen closely"},
      {"checkerboard", "a checkerboard on the floor: the same corner over and over"},
      {"two_depths", "a table with boxes in front of a wall far behind"},
      {"corridor", "two long walls with posters and doors"},
      {"corridor_end", "two walls with posters, nothing on the wall ahead"},
      {"corridor_loop", "a corridor round a block, for the motion loop"},
      {"rooms", "four rooms with doors, opposite ones alike, for the motion loop"},
      {"wall", "one long wall, for moving sideways"},
      {"planks", "a corridor of planks: edges along the way, hardly a corner"},
  };
  return choices;
}

Scene createScene(const std::string& name, std::uint64_t seed) {
  checkChoice("scene", name, sceneChoices());
  if (name == "room") return makeRoom(seed);
  if (name == "office") return makeOffice(seed);
  if (name == "walkway") return makeWalkway(seed);
  if (name == "desk") return makeDesk(seed);
  if (name == "checkerboard") return makeCheckerboard(seed);
  if (name == "two_depths") return makeTwoDepths(seed);
  if (name == "corridor") return makeCorridor(seed);
  if (name == "corridor_end") return makeCorridorEnd(seed);
  if (name == "corridor_loop") return makeCorridorLoop(seed);
  if (name == "rooms") return makeRooms(seed);
  if (name == "planks") return makePlanks(seed);
  return makeWall(seed);
}

}  // namespace active_matching_slam
