// Figures 6.10 and 6.11: how submaps come apart while the camera finds out how far things are, and
// what they are in a larger place, of all that was ever seen there.

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "active_matching_slam/information/requested_submaps.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

using Positions = std::map<FeatureId, Eigen::Vector3d>;

/// The map's structure at one moment.
struct Moment {
  int frame = 0;
  std::shared_ptr<const MutualInformationGraph> graph;
  std::shared_ptr<const SubmapHierarchy> submaps;
};

/// Tracks a sequence, and shows its structure once a second with the features' last positions, in
/// the frame of the first camera.
void watchStructure(Workbench& bench, const char* name,
                    const std::function<void(const Moment&, const Positions&)>& show) {
  const Sequence& sequence = bench.sequence(name);
  bench.say(text("structure of the map of %s over time", name));
  TrackerOptions options = referenceOptions(sequence, bench.quick() ? 20 : 30);
  options.structure = true;
  options.submaps.kept_features = 2000;
  Positions positions;
  Moment moment;
  int last_shown = -1;
  trackSequence(sequence, options, 1, [&](const TrackedFrame& frame, int image) {
    for (const TrackedFeature& feature : frame.features)
      if (feature.position_world.allFinite()) positions[feature.id] = feature.position_world;
    if (!frame.graph || !frame.submaps) return;
    moment = {image, frame.graph, frame.submaps};
    if (image % 30 != 0) return;
    last_shown = image;
    show(moment, positions);
  });
  if (moment.graph && moment.frame != last_shown) show(moment, positions);
}

/// Fraction of the features that are in the submap of most of their side (left or right of the
/// middle), the better way of calling two submaps left and right; 0.5 at least.
double agreementWithSides(const std::vector<std::int64_t>& ids, const std::vector<int>& submaps,
                          const Positions& positions) {
  int same = 0, known = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto at = positions.find(ids[i]);
    if (at == positions.end()) continue;
    same += (at->second.x() > 0.0) == (submaps[i] == 1);
    ++known;
  }
  return known > 0 ? static_cast<double>(std::max(same, known - same)) / known : 0.5;
}

/// Fraction of the features whose nearest neighbour in space is in the same submap.
double agreementWithNeighbours(const std::vector<std::int64_t>& ids,
                               const std::vector<int>& submaps, const Positions& positions) {
  int same = 0, known = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto here = positions.find(ids[i]);
    if (here == positions.end()) continue;
    double nearest = std::numeric_limits<double>::infinity();
    int submap = -1;
    for (std::size_t k = 0; k < ids.size(); ++k) {
      const auto there = positions.find(ids[k]);
      if (k == i || there == positions.end()) continue;
      const double distance = (there->second - here->second).squaredNorm();
      if (distance >= nearest) continue;
      nearest = distance;
      submap = submaps[k];
    }
    if (submap < 0) continue;
    same += submap == submaps[i];
    ++known;
  }
  return known > 0 ? static_cast<double>(same) / known : 0.0;
}

}  // namespace

ExperimentResult runSubmapsOverTime(Workbench& bench) {
  ExperimentResult result;
  Table table({"sequence", "frame", "features", "links", "submaps", "agreement"});
  LineChart chart{"Two submaps against the two walls, at the end of a corridor", "frame",
                  "features on the side of their submap"};
  ChartSeries sides{"corridor_end", {}};
  SubmapOptions two;
  two.count = 2;
  watchStructure(bench, "corridor_end", [&](const Moment& moment, const Positions& positions) {
    const SubmapPartition cut = requestedSubmaps(*moment.graph, *moment.submaps, two);
    if (cut.submaps != 2) return;
    const double agreement =
        agreementWithSides(moment.submaps->ids, cut.submap_of_feature, positions);
    table.add({"corridor_end", moment.frame, static_cast<int>(moment.submaps->ids.size()),
               static_cast<int>(moment.graph->links.size()), cut.submaps, agreement});
    sides.points.emplace_back(moment.frame, agreement);
  });
  if (sides.points.size() > 1) {
    const double first = sides.points.front().y(), last = sides.points.back().y();
    chart.series.push_back(sides);
    result.findings.push_back(
        {"corridor: features on the side of their submap, at first and in the end",
         "one cluster breaks into the left and the right wall",
         text("%.0f %%, %.0f %%", 100.0 * first, 100.0 * last), verdict(last >= 0.9)});
  }
  result.pictures.emplace_back("", drawLineChart(chart));

  SubmapOptions eight;
  eight.count = 8;
  double agreement = 0.0;
  int features = 0, in_map = 0;
  watchStructure(bench, "corridor_loop", [&](const Moment& moment, const Positions& positions) {
    const SubmapPartition cut = requestedSubmaps(*moment.graph, *moment.submaps, eight);
    agreement = agreementWithNeighbours(moment.submaps->ids, cut.submap_of_feature, positions);
    features = static_cast<int>(moment.submaps->ids.size());
    in_map = referenceOptions(bench.sequence("corridor_loop"), 30).map.maximum_features;
    table.add({"corridor_loop", moment.frame, features,
               static_cast<int>(moment.graph->links.size()), cut.submaps, agreement});
  });
  if (features > 0)
    result.findings.push_back(
        {"a walk round a block: features whose nearest neighbour is in the same of eight submaps",
         "submaps are regions of the scene, those out of view too",
         text("%.0f %% of %d features, of which the map holds at most %d", 100.0 * agreement,
              features, in_map),
         verdict(agreement >= 0.8)});
  result.tables.emplace_back("", table);
  return result;
}

}  // namespace active_matching_slam
