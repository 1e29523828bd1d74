// Figure 6.7: clusters of the features of a single frame, of a plane and of a scene of two depths.

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "active_matching_slam/information/submap_color.h"
#include "active_matching_slam/information/submap_cut.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "match_replay.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

/// The features of one frame by ascending id, in clusters.
struct Clusters {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<double> depths;
  std::vector<int> labels;
};

Clusters clustersOf(const TrackedFrame& frame, int count) {
  MutualInformationGraph graph = informationGraph(frame.prior.ids, frame.prior.S);
  const SubmapHierarchy hierarchy = buildSubmapHierarchy(graph);
  Clusters clusters;
  clusters.labels = cutIntoSubmaps(graph, hierarchy, count).submap_of_feature;
  const Eigen::Isometry3d T_camera_world = frame.camera.poseWorldCamera().inverse();
  for (const std::int64_t id : hierarchy.ids)
    for (const TrackedFeature& feature : frame.features)
      if (feature.id == id) {
        clusters.pixels.push_back(feature.predicted_px);
        clusters.depths.push_back((T_camera_world * feature.position_world).z());
      }
  return clusters;
}

/// Fraction of the features whose nearest in the image is in the same cluster.
double agreementWithPlace(const Clusters& clusters) {
  int same = 0;
  for (std::size_t i = 0; i < clusters.pixels.size(); ++i) {
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t neighbour = i;
    for (std::size_t k = 0; k < clusters.pixels.size(); ++k) {
      const double distance = (clusters.pixels[k] - clusters.pixels[i]).norm();
      if (k != i && distance < nearest) nearest = distance, neighbour = k;
    }
    same += clusters.labels[neighbour] == clusters.labels[i];
  }
  return static_cast<double>(same) /
         static_cast<double>(std::max<std::size_t>(1, clusters.pixels.size()));
}

/// Fraction of the features that two clusters put on the right side of the largest gap between
/// depths (in ratio), the better way of calling them near and far; at least 0.5.
double agreementWithDepth(const Clusters& clusters) {
  std::vector<double> sorted = clusters.depths;
  std::sort(sorted.begin(), sorted.end());
  double widest = 0.0, middle = 0.0;
  for (std::size_t i = 0; i + 1 < sorted.size(); ++i) {
    if (sorted[i] <= 0.0 || sorted[i + 1] / sorted[i] <= widest) continue;
    const std::size_t fewer = std::min(i + 1, sorted.size() - i - 1);
    if (5 * fewer < sorted.size()) continue;  // a stray depth is no layer
    widest = sorted[i + 1] / sorted[i];
    middle = std::sqrt(sorted[i + 1] * sorted[i]);
  }
  int same = 0;
  for (std::size_t i = 0; i < clusters.depths.size(); ++i)
    same += (clusters.depths[i] > middle) == (clusters.labels[i] == 1);
  const int count = static_cast<int>(clusters.depths.size());
  return count > 0 ? static_cast<double>(std::max(same, count - same)) / count : 0.5;
}

cv::Mat drawClusters(const TrackedFrame& frame, const Clusters& clusters,
                     const std::string& caption) {
  DebugCanvas canvas(frame.image);
  for (std::size_t i = 0; i < clusters.pixels.size(); ++i) {
    const Eigen::Vector3f rgb = 255.0f * submapRgb(clusters.labels[i]);
    canvas.dot(clusters.pixels[i], 6.0, cv::Scalar(rgb.z(), rgb.y(), rgb.x()));
  }
  return captioned(canvas.image(), canvas.unit(), caption);
}

}  // namespace

ExperimentResult runFrameClusters(Workbench& bench) {
  Table table({"sequence", "image", "features", "clusters", "agreement_with_image_neighbours",
               "agreement_with_depth"});
  ExperimentResult result;
  double place_of_plane = 0.0, place_of_depths = 0.0, depth_of_depths = 0.0;
  int frames_of_plane = 0, frames_of_depths = 0;
  std::vector<cv::Mat> panels;
  for (const char* name : {"wall", "two_depths"}) {
    const Sequence& sequence = bench.sequence(name);
    const bool is_plane = std::string(name) == "wall";
    bench.say(text("clusters of single frames of %s", name));
    const int last = static_cast<int>(sequence.images.size()) - 1;
    trackSequence(sequence, referenceOptions(sequence, bench.quick() ? 20 : 30), 1,
                  [&](const TrackedFrame& frame, int image) {
                    // In the second half depths are known.
                    if (2 * image < last || image % 10 != 0 || frame.prior.size() < 10) return;
                    const Clusters clusters = clustersOf(frame, 2);
                    const double place = agreementWithPlace(clusters),
                                 depth = agreementWithDepth(clusters);
                    table.add({name, image, static_cast<int>(clusters.labels.size()), 2, place,
                               is_plane ? Cell("") : Cell(depth)});
                    (is_plane ? place_of_plane : place_of_depths) += place;
                    if (!is_plane) depth_of_depths += depth;
                    ++(is_plane ? frames_of_plane : frames_of_depths);
                    if (image + 10 > last) panels.push_back(drawClusters(frame, clusters, name));
                  });
  }
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", tilePictures(panels, 2));
  if (frames_of_plane == 0 || frames_of_depths == 0) return result;
  result.findings.push_back(
      {"a plane: features whose nearest in the image is in the same of two clusters",
       "clusters mostly by proximity in the image",
       text("%.0f %% (%d frames)", 100.0 * place_of_plane / frames_of_plane, frames_of_plane),
       verdict(place_of_plane >= 0.8 * frames_of_plane)});
  result.findings.push_back({"two depths: features that two clusters put with those of their depth",
                             "foreground and background are told apart",
                             text("%.0f %% (%d frames); nearest in the image in the same: %.0f %%",
                                  100.0 * depth_of_depths / frames_of_depths, frames_of_depths,
                                  100.0 * place_of_depths / frames_of_depths),
                             verdict(depth_of_depths >= 0.8 * frames_of_depths)});
  return result;
}

}  // namespace active_matching_slam
