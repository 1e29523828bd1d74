// Figure 6.4: the pairwise information of features in the space of the state, and in that of
// measurements, early and late in a sequence that explores.

#include <unistd.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <utility>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/map/map_file.h"
#include "active_matching_slam/tracker/tracker.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "match_replay.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

using Links = std::map<std::pair<FeatureId, FeatureId>, double>;  ///< [bit]

/// By a feature's error state.
Eigen::MatrixXd pointJacobian(const FeatureState& feature) {
  if (feature.kind == FeatureKind::kPoint) return Eigen::Matrix3d::Identity();
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, feature.size());
  if (feature.hasAnchorError()) J.leftCols<3>().setIdentity();
  J.middleCols<2>(feature.size() - 3) = feature.tangentBasis() / feature.inverse_depth;
  J.rightCols<1>() = -feature.bearing_world / (feature.inverse_depth * feature.inverse_depth);
  return J;
}

/// 1/2 log2 |P|; NaN where it is not positive definite.
double halfLogDeterminant(const Eigen::MatrixXd& P) {
  const Eigen::LLT<Eigen::MatrixXd> factor(P);
  if (factor.info() != Eigen::Success) return std::nan("");
  double bits = 0.0;
  for (int i = 0; i < P.rows(); ++i) bits += std::log2(factor.matrixLLT()(i, i));
  return bits;
}

/// Information that the positions of two features in the world have in common (eq. 4.25).
Links stateLinks(const MapFileContent& map, const std::vector<FeatureId>& ids) {
  Ekf filter((FilterOptions()));
  filter.restore(map.camera_state, map.features, map.covariance, map.next_id);
  std::vector<const FeatureState*> features;
  for (const FeatureId id : ids)
    if (const FeatureState* feature = filter.find(id)) features.push_back(feature);
  const auto block = [&](const FeatureState& a, const FeatureState& b) -> Eigen::Matrix3d {
    return pointJacobian(a) * filter.covariance().block(a.offset, b.offset, a.size(), b.size()) *
           pointJacobian(b).transpose();
  };
  Links links;
  for (std::size_t i = 0; i < features.size(); ++i)
    for (std::size_t k = i + 1; k < features.size(); ++k) {
      const FeatureState &a = *features[i], &b = *features[k];
      Eigen::Matrix<double, 6, 6> joint;
      joint << block(a, a), block(a, b), block(b, a), block(b, b);
      const double bits = halfLogDeterminant(joint.topLeftCorner<3, 3>()) +
                          halfLogDeterminant(joint.bottomRightCorner<3, 3>()) -
                          halfLogDeterminant(0.5 * (joint + joint.transpose()));
      if (std::isfinite(bits)) links[{a.id, b.id}] = std::max(0.0, bits);
    }
  return links;
}

Links measurementLinks(const MeasurementPrior& prior) {
  Links links;
  const Eigen::MatrixXd bits = pairInformationMatrix(prior.S);
  for (int i = 0; i < prior.size(); ++i)
    for (int k = i + 1; k < prior.size(); ++k)
      links[{prior.ids[static_cast<std::size_t>(i)], prior.ids[static_cast<std::size_t>(k)]}] =
          bits(i, k);
  return links;
}

struct SpaceMoments {
  double mean = 0.0, deviation = 0.0;
  int count = 0;
};
SpaceMoments momentsOf(const Links& links) {
  SpaceMoments m;
  double squares = 0.0;
  for (const auto& [pair, bits] : links) {
    m.mean += bits;
    squares += bits * bits;
    ++m.count;
  }
  m.mean /= std::max(1, m.count);
  m.deviation = std::sqrt(std::max(0.0, squares / std::max(1, m.count) - m.mean * m.mean));
  return m;
}

cv::Mat drawLinks(const TrackedFrame& frame, const Links& links, const std::string& caption) {
  DebugCanvas canvas(frame.image);
  std::map<FeatureId, Eigen::Vector2d> places;
  for (const TrackedFeature& feature : frame.features)
    if (feature.status != FeatureStatus::kNotVisible) places[feature.id] = feature.predicted_px;
  double strongest = 0.0;
  for (const auto& [pair, bits] : links) strongest = std::max(strongest, bits);
  for (const auto& [pair, bits] : links) {
    const double share = bits / strongest;
    if (share < 0.3 || !places.count(pair.first) || !places.count(pair.second)) continue;
    canvas.line(places[pair.first], places[pair.second], cv::Scalar(60, 220, 255 * share),
                0.3 + 2.5 * share);
  }
  return captioned(canvas.image(), canvas.unit(), caption);
}

/// A map file of this process that is gone when it has been read.
MapFileContent mapOf(const Tracker& tracker) {
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("ams_experiment_" + std::to_string(getpid()) + ".map"))
                               .string();
  tracker.saveMap(path);
  MapFileContent map = readMapFile(path);
  std::remove(path.c_str());
  return map;
}

}  // namespace

ExperimentResult runStateSpace(Workbench& bench) {
  const Sequence& sequence = bench.sequence("wall");
  bench.say("information in the spaces of state and of measurements");
  Table table({"image", "space", "links", "mean_bits", "deviation_bits"});
  ExperimentResult result;
  const int images = static_cast<int>(sequence.images.size());
  const int early = std::min(60, images / 2);  // as in the figure
  SpaceMoments state[2], measurement[2];
  Tracker tracker(sequence.camera, referenceOptions(sequence, bench.quick() ? 20 : 30));
  std::vector<cv::Mat> panels;
  for (int i = 0; i < images; ++i) {
    const auto slot = static_cast<std::size_t>(i);
    const auto frame = tracker.track(sequence.images[slot], sequence.stamps_s[slot]);
    if ((i != early && i + 1 != images) || frame->prior.size() < 2) continue;
    const Links of_state = stateLinks(mapOf(tracker), frame->prior.ids),
                of_measurements = measurementLinks(frame->prior);
    const std::size_t when = i == early ? 0 : 1;
    state[when] = momentsOf(of_state);
    measurement[when] = momentsOf(of_measurements);
    panels.push_back(drawLinks(*frame, of_state, text("image %d, state", i)));
    panels.push_back(drawLinks(*frame, of_measurements, text("image %d, measurements", i)));
    for (const auto& [space, m] : {std::pair<const char*, SpaceMoments>{"state", state[when]},
                                   {"measurements", measurement[when]}})
      table.add({i, space, m.count, m.mean, m.deviation});
  }
  result.tables.emplace_back("", table);
  result.pictures.emplace_back("", tilePictures(panels, 2));
  if (state[0].count == 0 || state[1].count == 0) return result;
  result.findings.push_back(
      {"mean information of a pair late in the sequence: in the space of the state, of "
       "measurements",
       "two orders of magnitude larger in that of the state",
       text("%.2f, %.2f bits", state[1].mean, measurement[1].mean),
       verdict(state[1].mean > 10.0 * measurement[1].mean)});
  const auto growth = [](const SpaceMoments& from, const SpaceMoments& to) {
    return to.mean / from.mean;
  };
  const double of_state = growth(state[0], state[1]),
               of_measurements = growth(measurement[0], measurement[1]);
  result.findings.push_back(
      {"by what its mean grows from early to late: in the space of the state, of measurements",
       "grows with the camera's uncertainty; stays stable",
       text("%.2f, %.2f times", of_state, of_measurements),
       verdict(of_state > 1.0 &&
               std::abs(std::log(of_measurements)) < std::abs(std::log(of_state)))});
  result.findings.push_back(
      {"deviation of the links late in the sequence: in the space of the state, of measurements",
       "great variations in that of the state",
       text("%.2f, %.2f bits", state[1].deviation, measurement[1].deviation),
       verdict(state[1].deviation > measurement[1].deviation)});
  return result;
}

}  // namespace active_matching_slam
