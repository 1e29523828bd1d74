#include "active_matching_slam/map/relocaliser.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

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

}  // namespace

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
  const auto T_world_camera = solvePose(camera, matchDescriptors(image, landmarks, mask));
  if (!T_world_camera) return std::nullopt;
  return prove(camera, image, landmarks, *T_world_camera, mask);
}

std::optional<Relocalisation> Relocaliser::findByMatches(
    const CameraModel& camera, const cv::Mat& image, const Ekf& filter, const FeatureMap& map,
    const std::vector<FeatureMeasurement>& matches, const ImageMask& mask) const {
  const std::vector<Landmark> landmarks = usableLandmarks(filter, map);
  std::vector<Sighting> sightings;
  for (const FeatureMeasurement& match : matches) {
    const auto landmark = std::find_if(landmarks.begin(), landmarks.end(), [&](const Landmark& l) {
      return l.feature->id == match.id;
    });
    if (landmark != landmarks.end()) sightings.push_back({&*landmark, match.pixel});
  }
  const auto T_world_camera = solvePose(camera, sightings);
  if (!T_world_camera) return std::nullopt;
  return prove(camera, image, landmarks, *T_world_camera, mask);
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

std::vector<Relocaliser::Sighting> Relocaliser::matchDescriptors(
    const cv::Mat& image, const std::vector<Landmark>& landmarks, const ImageMask& mask) const {
  cv::Mat descriptors;
  std::vector<const Landmark*> described;
  for (const Landmark& landmark : landmarks) {
    const SourcePatch& patch = landmark.feature->patch;
    const cv::Mat descriptor = describePoint(patch.image, patch.center);
    if (descriptor.empty()) continue;
    descriptors.push_back(descriptor);
    described.push_back(&landmark);
  }
  const DescribedPoints points = describeCorners(image, mask);
  std::vector<Sighting> sightings;
  if (described.empty() || points.pixels.empty()) return sightings;
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
      sightings.push_back({described[k], points.pixels[best]});
  }
  return sightings;
}

std::optional<Eigen::Isometry3d> Relocaliser::solvePose(
    const CameraModel& camera, const std::vector<Sighting>& sightings) const {
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
    if (!cv::solvePnPRansac(points, ideal, K, cv::noArray(), rotation, translation, false,
                            kRansacIterations, kRansacPx, 0.999, inliers, cv::SOLVEPNP_P3P))
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
  return T_camera_world.inverse();
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
