#include "active_matching_slam/map/relocaliser.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>
#include <utility>

#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/rotation.h"
#include "orb_corners.h"

namespace active_matching_slam {
namespace {

/// Largest Hamming distance of descriptors that match [bit of 256]. Cost: wrong pairs below it, and
/// right ones above, cost RANSAC iterations; the templates decide in the end.
constexpr int kMaximumDescriptorDistance = 70;
/// Largest ratio of best to second best distance (Lowe 2004). Cost: as above.
constexpr double kMaximumDistanceRatio = 0.9;
/// Distance [px] within which corners of different scales are the same corner, not second best.
/// Derivation: the corner detector's spacing of 4 px at half scale, less its rounding.
constexpr double kSameCornerPx = 6.0;
/// Derivation: a pose takes 3 points, so that the consensus has as many again.
constexpr int kMinimumSightings = 6;
/// Derivation: (1 - 0.2^3)^1000 < 0.001: three right ones are drawn where 2 in 10 are right.
constexpr int kRansacIterations = 1000;
/// Of these, in one step. Cost: of the step.
constexpr int kDrawsOfStep = 250;
/// Probability that three right ones are drawn. Derivation: that of kRansacIterations.
constexpr double kDrawnProbability = 0.999;
/// Landmarks whose descriptors are made and matched in one step. Cost: of the step.
constexpr std::size_t kLandmarksOfStep = 50;
/// Residual of a RANSAC inlier [px]. Cost: coarse, as ORB corners of the smallest scale are.
constexpr float kRansacPx = 5.0f;
/// Radius searched about where the first, coarse pose predicts a feature [px]. Cost: of the search;
/// below the RANSAC inlier's, features that it counts would be missed.
constexpr double kSearchRadiusPx = 8.0;
/// A found feature's largest distance from its prediction [px]. Cost: a larger one lets a wrong
/// pose pass, a smaller one refuses maps whose points are a little off.
constexpr double kInlierPx = 3.0;
/// Largest slope of a ray that is used. Derivation: a residual in ideal pixels grows with its
/// square.
constexpr double kMaximumSlope = 5.0;

// Modelled time of the parts of a look [ms], on one core of about 3 GHz. Cost: medians.
/// Of finding and describing the corners of a million pixels; of a landmark's descriptor; of a pair
/// of descriptors; of a draw of three, and for each sighting that votes; of a landmark's proof.
constexpr double kCornersMs = 20.0, kDescribeMs = 0.012, kPairMs = 1.1e-5, kDrawMs = 0.006,
                 kVoteOfDrawMs = 1.6e-4, kProofMs = 0.04;

/// Of the sightings, by which draw of a step is to differ from those of the steps before.
template <class T>
void shuffle(std::uint32_t seed, std::vector<T>* all) {
  std::mt19937 random(seed);
  for (std::size_t i = all->size(); i > 1; --i) std::swap((*all)[i - 1], (*all)[random() % i]);
}

const Landmark* findLandmark(const std::vector<Landmark>& landmarks, FeatureId id) {
  const auto it = std::lower_bound(
      landmarks.begin(), landmarks.end(), id,
      [](const Landmark& landmark, FeatureId i) { return landmark.feature->id < i; });
  return it != landmarks.end() && it->feature->id == id ? &*it : nullptr;
}

}  // namespace

CameraLook::CameraLook(const cv::Mat& image, const ImageMask& mask)
    : image_(image), mask_(mask), corners_(std::make_shared<CornerScan>(image, mask)) {}

void CameraLook::beginPlace() {
  stage_ = Stage::kCorners;
  landmark_ = 0;
  sightings_.clear();
  draws_ = 0;
  inliers_ = 0;
  best_.reset();
  T_world_camera_.reset();
}

Relocaliser::Relocaliser(const RelocaliserOptions& options, const MapOptions& map,
                         const ImageOptions& image)
    : options_(options), map_options_(map), image_options_(image) {
  checkFields(options);
  checkMapOptions(map);
  checkImageOptions(image);
}

std::optional<Relocalisation> Relocaliser::find(const CameraModel& camera, const cv::Mat& image,
                                                const Ekf& filter, const FeatureMap& map,
                                                const ImageMask& mask) const {
  return find(camera, image, usableLandmarks(filter, map), mask);
}

std::optional<Relocalisation> Relocaliser::find(const CameraModel& camera, const cv::Mat& image,
                                                const std::vector<Landmark>& landmarks,
                                                const ImageMask& mask) const {
  if (image.type() != CV_8UC1 || image.cols != camera.width() || image.rows != camera.height())
    return std::nullopt;
  if (static_cast<int>(landmarks.size()) < options_.minimum_inliers) return std::nullopt;
  CameraLook look(image, mask);
  while (!look.isOver()) step(camera, landmarks, &look);
  if (!look.pose()) return std::nullopt;
  return prove(camera, image, landmarks, *look.pose(), mask);
}

double Relocaliser::stepMs(const std::vector<Landmark>& landmarks, const CameraLook& look) {
  switch (look.stage_) {
    case CameraLook::Stage::kCorners:
      return 1e-6 * kCornersMs * look.corners_->nextPixels();
    case CameraLook::Stage::kMatch:
      return static_cast<double>(std::min(
                 landmarks.size() - std::min(look.landmark_, landmarks.size()), kLandmarksOfStep)) *
             (kDescribeMs + kPairMs * static_cast<double>(look.corners_->points().pixels.size()));
    case CameraLook::Stage::kConsensus:
      return kDrawsOfStep * (kDrawMs + kVoteOfDrawMs * static_cast<double>(look.sightings_.size()));
    default:
      return 0.0;
  }
}

double Relocaliser::proofMs(const std::vector<Landmark>& landmarks) {
  return kProofMs * static_cast<double>(landmarks.size());
}

void Relocaliser::step(const CameraModel& camera, const std::vector<Landmark>& landmarks,
                       CameraLook* look) const {
  using Stage = CameraLook::Stage;
  if (static_cast<int>(landmarks.size()) < options_.minimum_inliers) look->stage_ = Stage::kOver;
  switch (look->stage_) {
    case Stage::kCorners:
      if (!look->corners_->isDone()) look->corners_->step();
      if (look->corners_->isDone()) look->stage_ = Stage::kMatch;
      break;
    case Stage::kMatch:
      matchDescriptors(landmarks, look);
      if (look->landmark_ >= landmarks.size())
        look->stage_ = look->sightings_.size() < static_cast<std::size_t>(kMinimumSightings)
                           ? Stage::kOver
                           : Stage::kConsensus;
      break;
    case Stage::kConsensus:
      drawConsensus(camera, landmarks, look);
      break;
    default:
      break;
  }
}

std::optional<Relocalisation> Relocaliser::findByMatches(
    const CameraModel& camera, const cv::Mat& image, const Ekf& filter, const FeatureMap& map,
    const std::vector<FeatureMeasurement>& matches, const ImageMask& mask) const {
  const std::vector<Landmark> landmarks = usableLandmarks(filter, map);
  std::vector<Sighting> sightings;
  for (const FeatureMeasurement& match : matches) {
    if (const Landmark* landmark = findLandmark(landmarks, match.id))
      sightings.push_back({landmark, match.pixel});
  }
  const auto consensus = solvePose(camera, sightings, kRansacIterations);
  if (!consensus) return std::nullopt;
  return prove(camera, image, landmarks, consensus->T_world_camera, mask);
}

std::optional<Relocalisation> Relocaliser::prove(const CameraModel& camera, const cv::Mat& image,
                                                 const std::vector<Landmark>& landmarks,
                                                 Eigen::Isometry3d T_world_camera,
                                                 const ImageMask& mask) const {
  std::vector<Sighting> found;
  searchVisible(camera, image, landmarks, T_world_camera, kSearchRadiusPx, mask, &found);
  if (static_cast<int>(found.size()) < options_.minimum_inliers) return std::nullopt;
  T_world_camera = refinePose(camera, found, T_world_camera);

  // The proof, with templates as the refined pose expects them.
  Relocalisation result;
  result.searched =
      searchVisible(camera, image, landmarks, T_world_camera, 2.0 * kInlierPx, mask, &found);
  if (static_cast<int>(found.size()) < options_.minimum_inliers) return std::nullopt;
  result.T_world_camera = refinePose(camera, found, T_world_camera);
  double sum = 0.0;
  for (const Sighting& sighting : found) {
    const double distance = residual(camera, sighting, result.T_world_camera);
    if (!(distance <= kInlierPx)) continue;
    result.inliers.push_back({sighting.landmark->feature->id, sighting.pixel, 0.0});
    sum += distance * distance;
  }
  const auto inliers = static_cast<double>(result.inliers.size());
  if (inliers < options_.minimum_inliers ||
      inliers < options_.minimum_visible_share * result.searched)
    return std::nullopt;
  result.rms_px = std::sqrt(sum / inliers);
  return result;
}

bool Relocaliser::canFind(const Ekf& filter, const FeatureMap& map) const {
  return static_cast<int>(usableLandmarks(filter, map).size()) >= options_.minimum_inliers;
}

std::vector<Landmark> Relocaliser::usableLandmarks(const Ekf& filter, const FeatureMap& map) const {
  std::vector<Landmark> landmarks;
  for (const MapFeature& feature : map.features()) {
    const FeatureState* state = filter.find(feature.id);
    if (!state) continue;
    if (state->kind == FeatureKind::kInverseDepth &&
        !(filter.sigmaInverseDepth(*state) <= options_.maximum_depth_sigma * state->inverse_depth))
      continue;
    landmarks.push_back({&feature, *state});
  }
  return landmarks;
}

/// Of the next landmarks.
void Relocaliser::matchDescriptors(const std::vector<Landmark>& landmarks, CameraLook* look) {
  cv::Mat descriptors;
  std::vector<FeatureId> described;
  for (std::size_t k = 0; k < kLandmarksOfStep && look->landmark_ < landmarks.size(); ++k) {
    const MapFeature& feature = *landmarks[look->landmark_++].feature;
    const cv::Mat descriptor = describePoint(feature.patch.image, feature.patch.center);
    if (descriptor.empty()) continue;
    descriptors.push_back(descriptor);
    described.push_back(feature.id);
  }
  const DescribedPoints& points = look->corners_->points();
  if (described.empty() || points.pixels.empty()) return;
  cv::Mat distances;  // a row for each landmark
  cv::batchDistance(descriptors, points.descriptors, distances, CV_32S, cv::noArray(),
                    cv::NORM_HAMMING);
  for (std::size_t k = 0; k < described.size(); ++k) {
    const int* row = distances.ptr<int>(static_cast<int>(k));
    const auto best = std::min_element(row, row + distances.cols) - row;
    if (row[best] > kMaximumDescriptorDistance) continue;
    int second = std::numeric_limits<int>::max();
    for (int i = 0; i < distances.cols; ++i)
      if (row[i] < second && (points.pixels[i] - points.pixels[best]).norm() > kSameCornerPx)
        second = row[i];
    if (row[best] < kMaximumDistanceRatio * second)
      look->sightings_.push_back({described[k], points.pixels[best]});
  }
}

/// Landmarks that are known no more drop out. Draws until three right ones have been drawn as
/// surely as by kRansacIterations where few are right. Every step draws from another order, as each
/// begins with the same random numbers.
void Relocaliser::drawConsensus(const CameraModel& camera, const std::vector<Landmark>& landmarks,
                                CameraLook* look) const {
  std::vector<Sighting> sightings;
  for (const CameraLook::Sighting& sighting : look->sightings_)
    if (const Landmark* landmark = findLandmark(landmarks, sighting.id))
      sightings.push_back({landmark, sighting.pixel});
  if (look->draws_ > 0) shuffle(static_cast<std::uint32_t>(look->draws_), &sightings);
  const auto consensus = solvePose(camera, sightings, kDrawsOfStep);
  look->draws_ += kDrawsOfStep;
  if (consensus && consensus->inliers > look->inliers_) {
    look->inliers_ = consensus->inliers;
    look->best_ = consensus->T_world_camera;
  }
  const double right =
      static_cast<double>(look->inliers_) / std::max<double>(1.0, double(sightings.size()));
  const double needed =
      right < 1.0 ? std::log(1.0 - kDrawnProbability) / std::log1p(-right * right * right) : 0.0;
  if (look->draws_ < kRansacIterations && !(look->draws_ >= needed)) return;
  look->T_world_camera_ = look->best_;
  look->stage_ = CameraLook::Stage::kOver;
}

std::optional<Relocaliser::Consensus> Relocaliser::solvePose(const CameraModel& camera,
                                                             const std::vector<Sighting>& sightings,
                                                             int draws) const {
  // Ideal pixels: those of a lens without distortion and square pixels.
  const double focal = 0.5 * (camera.calibration().fx + camera.calibration().fy);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> ideal;
  for (const Sighting& sighting : sightings) {
    const auto ray = camera.unproject(sighting.pixel);
    const Eigen::Vector3d position = sighting.landmark->state.position();
    if (!ray || !position.allFinite() || !(ray->head<2>().norm() < kMaximumSlope * ray->z()))
      continue;
    points.emplace_back(position.x(), position.y(), position.z());
    ideal.emplace_back(focal * ray->x() / ray->z(), focal * ray->y() / ray->z());
  }
  if (static_cast<int>(points.size()) < kMinimumSightings) return std::nullopt;
  const cv::Matx33d K(focal, 0.0, 0.0, 0.0, focal, 0.0, 0.0, 0.0, 1.0);
  cv::Vec3d rotation, translation;
  std::vector<int> inliers;
  try {  // its random numbers start from a fixed seed at every call
    if (!cv::solvePnPRansac(points, ideal, K, cv::noArray(), rotation, translation, false, draws,
                            kRansacPx, kDrawnProbability, inliers, cv::SOLVEPNP_P3P))
      return std::nullopt;
  } catch (const cv::Exception&) {  // degenerate points
    return std::nullopt;
  }
  if (static_cast<int>(inliers.size()) < kMinimumSightings) return std::nullopt;
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  T_camera_world.linear() =
      rotationFromVector(Eigen::Vector3d(rotation[0], rotation[1], rotation[2])).toRotationMatrix();
  T_camera_world.translation() << translation[0], translation[1], translation[2];
  if (!T_camera_world.matrix().allFinite()) return std::nullopt;
  return Consensus{T_camera_world.inverse(), inliers.size()};
}

int Relocaliser::searchVisible(const CameraModel& camera, const cv::Mat& image,
                               const std::vector<Landmark>& landmarks,
                               const Eigen::Isometry3d& T_world_camera, double radius_px,
                               const ImageMask& mask, std::vector<Sighting>* found) const {
  const double maximum_angle = map_options_.maximum_view_angle_deg * M_PI / 180.0;
  std::vector<const Landmark*> visible;
  std::vector<Template> templates;
  std::vector<SearchEllipse> ellipses;
  for (const Landmark& landmark : landmarks) {
    const auto view = predictPatchView(landmark.feature->patch, camera, T_world_camera,
                                       homogeneousPosition(landmark.state));
    Template expected;
    if (!view || !camera.isInImage(view->pixel, image_options_.border_px) ||
        !mask.isSearched(view->pixel) || view->view_angle_rad > maximum_angle ||
        view->scale < map_options_.minimum_scale || view->scale > map_options_.maximum_scale ||
        !warpTemplate(landmark.feature->patch, *view, image_options_.template_size_px, &expected) ||
        expected.contrast() < image_options_.minimum_contrast)
      continue;
    visible.push_back(&landmark);
    templates.push_back(expected);
    const double sigma = radius_px / std::sqrt(kEllipseRadius2);
    ellipses.push_back({view->pixel, sigma * sigma * Eigen::Matrix2d::Identity()});
  }
  ImageFeatureSearch search(image_options_);
  search.beginFrame(image, templates, {}, mask.templateCentres());
  found->clear();
  for (std::size_t i = 0; i < visible.size(); ++i) {
    search.search(static_cast<int>(i), ellipses[i]);
    if (const SearchMatch* match = search.bestMatch(static_cast<int>(i)))
      found->push_back({visible[i], match->pixel});
  }
  return static_cast<int>(visible.size());
}

Eigen::Isometry3d Relocaliser::refinePose(const CameraModel& camera,
                                          const std::vector<Sighting>& sightings,
                                          Eigen::Isometry3d T_world_camera) const {
  constexpr int kIterations = 10;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    const Eigen::Matrix3d R_camera_world = T_world_camera.linear().transpose();
    for (const Sighting& sighting : sightings) {
      Eigen::Matrix<double, 2, 3> d_pixel_d_point;
      const Eigen::Vector3d point =
          R_camera_world * (sighting.landmark->state.position() - T_world_camera.translation());
      const auto pixel = camera.project(point, &d_pixel_d_point);
      if (!pixel) continue;
      // The pose gains (dt, dr) in the camera's frame: the point moves by -dt + [point]x dr.
      Eigen::Matrix<double, 3, 6> d_point;
      d_point << -Eigen::Matrix3d::Identity(), skew(point);
      const Eigen::Matrix<double, 2, 6> J = d_pixel_d_point * d_point;
      const Eigen::Vector2d error = sighting.pixel - *pixel;
      const double weight = 1.0 / (1.0 + error.squaredNorm());  // Cauchy's, of a pixel
      A += weight * J.transpose() * J;
      b += weight * J.transpose() * error;
    }
    const Eigen::Matrix<double, 6, 1> step = A.ldlt().solve(b);
    if (!step.allFinite()) return T_world_camera;
    T_world_camera.translation() += T_world_camera.linear() * step.head<3>();
    T_world_camera.linear() = (T_world_camera.linear() * rotationFromVector(step.tail<3>())).eval();
  }
  T_world_camera.linear() = Eigen::Quaterniond(T_world_camera.linear()).normalized().matrix();
  return T_world_camera;
}

double Relocaliser::residual(const CameraModel& camera, const Sighting& sighting,
                             const Eigen::Isometry3d& T_world_camera) const {
  const Eigen::Vector3d point =
      T_world_camera.linear().transpose() *
      (sighting.landmark->state.position() - T_world_camera.translation());
  const auto pixel = camera.project(point);
  return pixel ? (*pixel - sighting.pixel).norm() : std::numeric_limits<double>::infinity();
}

}  // namespace active_matching_slam
