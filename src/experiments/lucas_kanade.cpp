// What a user would take instead: OpenCV's pyramidal Lucas-Kanade tracks the same features from
// image to image, and RANSAC PnP finds the camera from the same map (the positions that the
// reference run of Active Matching ended with, better than any that were known at the time).

#include <map>
#include <opencv2/video/tracking.hpp>

#include "active_matching_slam/evaluation/trajectory_error.h"
#include "reference_matcher.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

constexpr int kFeatures = 40;
constexpr double kInlierPx = 3.0;

struct MapPoint {
  Eigen::Vector3d position_world = Eigen::Vector3d::Zero();
  int first_image = 0;
  bool is_usable = false;  ///< of known depth in the end
};

/// What one of the two did on the frames after the first ones at the full rate.
struct Outcome {
  int frames = 0, tracked = 0, right = 0, wrong = 0;
  double matched = 0.0, ms = 0.0;
  std::vector<double> error_px;
  Trajectory trajectory;

  void count(const Eigen::Vector2d& pixel, const Eigen::Vector2d& true_px) {
    if (!true_px.allFinite()) return;
    const double error = (pixel - true_px).norm();
    ++(error <= 3.0 ? right : wrong);
    error_px.push_back(error);
  }
};

/// The reference run: its outcome, its map, and where Lucas-Kanade begins.
struct ReferenceRun {
  Outcome outcome;
  std::map<FeatureId, MapPoint> map;
  std::map<FeatureId, Eigen::Vector2d> start_px;
  Eigen::Isometry3d T_world_start = Eigen::Isometry3d::Identity();
  int start_image = -1;
};

ReferenceRun trackActively(const Sequence& sequence, int every, TruePlaces* truth) {
  TrackerOptions options = referenceOptions(sequence, kFeatures);
  options.matching.clock_s = threadSeconds;
  ReferenceRun run;
  trackSequence(sequence, options, every, [&](const TrackedFrame& frame, int image) {
    if (sequence.isSimulated()) truth->observe(frame, image);
    for (const TrackedFeature& feature : frame.features) {
      if (!run.map.count(feature.id)) run.map[feature.id].first_image = image;
      MapPoint& point = run.map[feature.id];
      point.position_world = feature.position_world;
      point.is_usable = hasKnownDepth(feature);
    }
    if (image < kFullRateFrames) return;
    const bool is_tracked = frame.state == TrackingState::kTracking;
    if (run.start_image < 0) {
      run.start_image = image;
      run.T_world_start = frame.camera.poseWorldCamera();
      for (const TrackedFeature& feature : frame.features)
        if (feature.status == FeatureStatus::kMatched)
          run.start_px[feature.id] = feature.matched_px;
      return;
    }
    ++run.outcome.frames;
    if (!is_tracked) return;
    ++run.outcome.tracked;
    run.outcome.trajectory.push_back({frame.stamp_s, frame.camera.poseWorldCamera()});
    run.outcome.matched += frame.matching.statistics.matched;
    run.outcome.ms += frame.matching.statistics.total_ms;
    if (!sequence.isSimulated()) return;
    for (const TrackedFeature& feature : frame.features)
      if (feature.status == FeatureStatus::kMatched)
        run.outcome.count(feature.matched_px, truth->pixel(feature.id, image));
  });
  return run;
}

/// Puts features that are not tracked where the pose projects them.
void addProjected(const Sequence& sequence, const ReferenceRun& reference, int image,
                  const Eigen::Isometry3d& T_world_camera,
                  std::map<FeatureId, Eigen::Vector2d>* tracks) {
  constexpr double kBorderPx = 12.0;
  const Eigen::Isometry3d T_camera_world = T_world_camera.inverse();
  for (const auto& [id, point] : reference.map) {
    if (static_cast<int>(tracks->size()) >= kFeatures) return;
    if (!point.is_usable || point.first_image > image || tracks->count(id)) continue;
    const auto pixel = sequence.camera.project(T_camera_world * point.position_world);
    if (pixel && sequence.camera.isInImage(*pixel, kBorderPx)) (*tracks)[id] = *pixel;
  }
}

/// One image on. Returns the pose, and leaves the inliers in `tracks`.
std::optional<PnpPose> trackByFlow(const Sequence& sequence, const ReferenceRun& reference,
                                   int before, int now,
                                   std::map<FeatureId, Eigen::Vector2d>* tracks) {
  std::vector<FeatureId> ids;
  std::vector<cv::Point2f> from, to;
  for (const auto& [id, pixel] : *tracks) {
    ids.push_back(id);
    from.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
  }
  tracks->clear();
  if (from.empty()) return std::nullopt;
  std::vector<unsigned char> found;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(sequence.images[static_cast<std::size_t>(before)],
                           sequence.images[static_cast<std::size_t>(now)], from, to, found, error,
                           cv::Size(21, 21), 4);
  std::vector<FeatureId> alive;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Eigen::Vector2d pixel(to[i].x, to[i].y);
    const MapPoint& point = reference.map.at(ids[i]);
    if (!found[i] || !point.is_usable || !sequence.camera.isInImage(pixel)) continue;
    alive.push_back(ids[i]);
    points.push_back(point.position_world);
    pixels.push_back(pixel);
  }
  const auto pose = solvePnp(sequence.camera, points, pixels, kInlierPx);
  if (!pose) return std::nullopt;
  for (const int i : pose->inliers)
    (*tracks)[alive[static_cast<std::size_t>(i)]] = pixels[static_cast<std::size_t>(i)];
  return pose;
}

Outcome trackByLucasKanade(const Sequence& sequence, const ReferenceRun& reference, int every,
                           const TruePlaces& truth) {
  Outcome outcome;
  std::map<FeatureId, Eigen::Vector2d> tracks = reference.start_px;
  Eigen::Isometry3d T_world_camera = reference.T_world_start;
  int before = reference.start_image;
  for (const int image : imagesAtRate(static_cast<int>(sequence.images.size()), every)) {
    if (before < 0 || image <= before) continue;
    ++outcome.frames;
    const double start_s = threadSeconds();
    const auto pose = trackByFlow(sequence, reference, before, image, &tracks);
    outcome.ms += 1e3 * (threadSeconds() - start_s);
    before = image;
    if (pose) {
      T_world_camera = pose->T_world_camera;
      ++outcome.tracked;
      outcome.matched += static_cast<double>(tracks.size());
      outcome.trajectory.push_back(
          {sequence.stamps_s[static_cast<std::size_t>(image)], T_world_camera});
      if (sequence.isSimulated())
        for (const auto& [id, pixel] : tracks) outcome.count(pixel, truth.pixel(id, image));
    }
    addProjected(sequence, reference, image, T_world_camera, &tracks);
  }
  return outcome;
}

double errorOf(const Outcome& outcome, const Sequence& sequence) {
  const auto pairs = pairPoses(outcome.trajectory, sequence.truth);
  const auto alignment = align(pairs, AlignmentKind::kSimilarity);
  return alignment ? 1e3 * absoluteTrajectoryError(pairs, *alignment) : std::nan("");
}

double meanOf(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? std::nan("") : sum / static_cast<double>(values.size());
}

}  // namespace

ExperimentResult runLucasKanade(Workbench& bench) {
  Table table({"sequence", "rate_hz", "method", "frames", "tracked", "matched", "ate_mm", "right",
               "wrong", "error_px", "frame_ms"});
  ExperimentResult result;
  std::vector<cv::Mat> pictures;
  for (const std::string& name : bench.testBedSequences()) {
    const Sequence& sequence = bench.sequence(name);
    LineChart errors{"Trajectory error, " + name, "frame rate [Hz]", "ATE after Sim(3) [mm]", true,
                     true};
    errors.series = {{"active matching", {}}, {"Lucas-Kanade", {}}};
    std::vector<std::string> here;
    for (const int every : bench.everies()) {
      const double rate_hz = 30.0 / every;
      bench.say(text("Lucas-Kanade and Active Matching on %s at %.4g Hz", name.c_str(), rate_hz));
      TruePlaces truth(sequence);
      const ReferenceRun active = trackActively(sequence, every, &truth);
      const Outcome flow = trackByLucasKanade(sequence, active, every, truth);
      std::string line = text("%.4g Hz: ", rate_hz);
      for (const Outcome* outcome : {&active.outcome, &flow}) {
        const bool is_active = outcome == &active.outcome;
        const double ate_mm = errorOf(*outcome, sequence);
        const double frames = std::max(1, outcome->tracked);
        table.add({name, rate_hz, is_active ? "active_matching" : "lucas_kanade_pnp",
                   outcome->frames, outcome->tracked, outcome->matched / frames, ate_mm,
                   outcome->right, outcome->wrong, meanOf(outcome->error_px),
                   outcome->ms / std::max(1, outcome->frames)});
        errors.series[is_active ? 0 : 1].points.emplace_back(rate_hz, ate_mm);
        line += text("%s%d of %d frames, %.0f mm", is_active ? "AM " : ", LK ", outcome->tracked,
                     outcome->frames, ate_mm);
      }
      here.push_back(line);
    }
    std::string all;
    for (const std::string& line : here) all += (all.empty() ? "" : "; ") + line;
    result.findings.push_back({name + ": frames tracked and trajectory error", "-", all});
    pictures.push_back(drawLineChart(errors));
  }
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", tilePictures(pictures, 2));
  return result;
}

}  // namespace active_matching_slam
