// Equation 7.33: matchers on a map of keyframes. Such a map has no covariance, so that the
// prediction's is that of the motion since the last image alone, S = J P_rel J^T + R.

#include <algorithm>
#include <cmath>
#include <map>

#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

constexpr double kKeyframeNoisePx = 1.0;

/// What a tracker on keyframes knows before an image.
struct Keyframe {
  int image = 0;
  Eigen::Isometry3d T_world_camera;  ///< predicted with constant velocity from the two poses before
  double interval_s = 0.0;
  std::vector<FeatureId> ids;
  std::vector<Template> templates;
};

/// The motion of constant velocity (eq. 3.6) from the two last poses.
Eigen::Isometry3d predictedPose(const StampedPose& first, const StampedPose& second,
                                double interval_s) {
  const double share = interval_s / (second.stamp_s - first.stamp_s);
  const Eigen::Isometry3d step = first.T_world_camera.inverse() * second.T_world_camera;
  const Eigen::AngleAxisd turn(step.linear());
  Eigen::Isometry3d onwards = Eigen::Isometry3d::Identity();
  onwards.linear() = Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  onwards.translation() = share * step.translation();
  return second.T_world_camera * onwards;
}

/// Covariance of the pose relative to the one before: the process noise of eq. 3.7, an unknown
/// acceleration over the interval.
Eigen::Matrix<double, 6, 6> relativeCovariance(const Sequence& sequence, double interval_s) {
  const double t2 = interval_s * interval_s;
  Eigen::Matrix<double, 6, 1> sigma;
  sigma.head<3>().setConstant(sequence.sigma_acceleration * t2);
  sigma.tail<3>().setConstant(sequence.sigma_angular_acceleration * t2);
  return sigma.cwiseAbs2().asDiagonal();
}

RecordedProblem problemOf(const Sequence& sequence, const Keyframe& moment,
                          const std::map<FeatureId, Eigen::Vector3d>& map, const TruePlaces& truth,
                          double border_px) {
  RecordedProblem problem;
  problem.image = moment.image;
  std::vector<Eigen::Vector2d> places;
  std::vector<Eigen::Matrix<double, 2, 6>> jacobians;
  for (std::size_t i = 0; i < moment.ids.size(); ++i) {
    const auto at = map.find(moment.ids[i]);
    if (at == map.end()) continue;
    FeatureState feature;
    feature.kind = FeatureKind::kPoint;
    feature.point_world = at->second;
    Eigen::Matrix<double, 2, 6> J;
    const auto projection = projectFromPose(sequence.camera, moment.T_world_camera.translation(),
                                            moment.T_world_camera.linear(), feature, &J);
    if (!projection || !sequence.camera.isInImage(projection->pixel, border_px)) continue;
    places.push_back(projection->pixel);
    jacobians.push_back(J);
    problem.prior.ids.push_back(moment.ids[i]);
    problem.templates.push_back(moment.templates[i]);
    problem.reference_px.push_back(truth.pixel(moment.ids[i], moment.image));
  }
  const auto count = static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd J(2 * count, 6);
  problem.prior.z.resize(2 * count);
  for (Eigen::Index i = 0; i < count; ++i) {
    problem.prior.z.segment<2>(2 * i) = places[static_cast<std::size_t>(i)];
    J.middleRows<2>(2 * i) = jacobians[static_cast<std::size_t>(i)];
  }
  problem.prior.noise_variance_px2 = kKeyframeNoisePx * kKeyframeNoisePx;
  problem.prior.S = J * relativeCovariance(sequence, moment.interval_s) * J.transpose();
  problem.prior.S.diagonal().array() += problem.prior.noise_variance_px2;
  return problem;
}

/// A run of the tracker gives the poses of the images before, and in the end the map.
std::vector<RecordedProblem> keyframeProblems(Workbench& bench, const Sequence& sequence,
                                              int every) {
  const TrackerOptions options = referenceOptions(sequence, bench.quick() ? 30 : 60);
  std::vector<Keyframe> moments;
  std::map<FeatureId, Eigen::Vector3d> map;
  std::vector<StampedPose> poses;
  TruePlaces truth(sequence);
  trackSequence(sequence, options, every, [&](const TrackedFrame& frame, int image) {
    truth.observe(frame, image);
    if (frame.state != TrackingState::kTracking) return;
    for (const TrackedFeature& feature : frame.features)
      if (hasKnownDepth(feature)) map[feature.id] = feature.position_world;
    if (image > kFullRateFrames && poses.size() > 1) {
      const StampedPose& last = poses.back();
      const double interval_s = frame.stamp_s - last.stamp_s;
      moments.push_back({image, predictedPose(poses[poses.size() - 2], last, interval_s),
                         interval_s, frame.prior.ids, frame.templates});
    }
    poses.push_back({frame.stamp_s, frame.camera.poseWorldCamera()});
  });
  std::vector<RecordedProblem> problems;
  const std::size_t step = std::max<std::size_t>(1, moments.size() / (bench.quick() ? 6 : 20));
  for (std::size_t i = 0; i < moments.size(); i += step) {
    RecordedProblem problem = problemOf(sequence, moments[i], map, truth, options.image.border_px);
    if (problem.prior.size() >= 10) problems.push_back(std::move(problem));
  }
  return problems;
}

/// Smallest information of a feature about all others: 0 where S is not dense.
double leastInformation(const MeasurementPrior& prior) {
  return featureInformation(prior.S).bits.minCoeff();
}

}  // namespace

ExperimentResult runKeyframeMap(Workbench& bench) {
  Table table({"sequence", "rate_hz", "matcher", "frames", "features", "right", "wrong", "missed",
               "pixels", "most_gaussians", "matching_ms"});
  ExperimentResult result;
  const std::string name = bench.mainSequence();
  const Sequence& sequence = bench.sequence(name);
  for (const int every : {2, 4}) {
    bench.say(text("a map of keyframes, %s at %.4g Hz", name.c_str(), 30.0 / every));
    const std::vector<RecordedProblem> problems = keyframeProblems(bench, sequence, every);
    if (problems.empty()) continue;
    double least_bits = 1e300;
    for (const RecordedProblem& problem : problems)
      least_bits = std::min(least_bits, leastInformation(problem.prior));
    std::vector<TestBedCell> cells;
    addCells(sequence, 30.0 / every, 1000, problems, &cells);
    std::string rights;
    double jcbb = 0.0, active = 0.0, jcbb_pixels = 0.0, active_pixels = 0.0;
    for (const TestBedCell& cell : cells) {
      const TrialSummary& s = cell.summary;
      table.add({name, cell.rate_hz, cell.matcher, s.frames, s.candidates, s.right, s.wrong,
                 s.missed, s.pixels, s.most_gaussians, s.total_ms});
      const double share = s.right / std::max(1e-9, s.right + s.wrong + s.missed);
      if (cell.matcher == "jcbb") jcbb = share, jcbb_pixels = s.pixels;
      if (cell.matcher == "active_live") active = share, active_pixels = s.pixels;
      rights += text("%s%s %.1f", rights.empty() ? "" : ", ", cell.matcher.c_str(), 100.0 * share);
    }
    result.findings.push_back(
        {text("%.4g Hz: least information of a feature about the others [bits]", 30.0 / every),
         "S is dense, though the map has no covariance", text("%.2f", least_bits),
         verdict(least_bits > 0.1)});
    result.findings.push_back({text("%.4g Hz: features matched rightly [%%]", 30.0 / every),
                               "the prior that figure 7.13 is made with", rights,
                               verdict(active >= jcbb - 0.01)});
    result.findings.push_back(
        {text("%.4g Hz: pixels, JCBB : AM with the package's settings", 30.0 / every),
         "AM searches far fewer", text("%.0f : %.0f", jcbb_pixels, active_pixels),
         verdict(2.0 * active_pixels < jcbb_pixels)});
  }
  result.tables.emplace_back("", table);
  return result;
}

}  // namespace active_matching_slam
