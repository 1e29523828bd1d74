#include "active_matching_slam/ros/markers.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/ros/frame_conversions.h"
#include "active_matching_slam/ros/pose_conversions.h"
#include "active_matching_slam/visualisation/link_view.h"

namespace active_matching_slam {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

/// In units of sceneSize(). A larger ellipsoid would have the viewer inside and hide the scene.
constexpr double kLargestEllipsoid = 1.0;
constexpr int kTrajectoryEllipsoids = 40;

std_msgs::ColorRGBA color(double r, double g, double b, double a = 1.0) {
  std_msgs::ColorRGBA message;
  message.r = static_cast<float>(r);
  message.g = static_cast<float>(g);
  message.b = static_cast<float>(b);
  message.a = static_cast<float>(a);
  return message;
}

std_msgs::ColorRGBA statusColor(const TrackedFeature& feature, double alpha) {
  if (feature.known) return color(1, 1, 1, alpha);
  switch (feature.status) {
    case FeatureStatus::kMatched:
      return color(0.25, 0.9, 0.35, alpha);
    case FeatureStatus::kRejected:
      return color(1.0, 0.6, 0.1, alpha);
    case FeatureStatus::kMissed:
      return color(1.0, 0.25, 0.2, alpha);
    default:
      return color(0.4, 0.6, 1.0, alpha);
  }
}

Marker makeMarker(const std_msgs::Header& header, const std::string& ns, int id, int type) {
  Marker marker;
  marker.header = header;
  marker.ns = ns;
  marker.id = id;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.color = color(1, 1, 1);
  return marker;
}

Marker makeLines(const std_msgs::Header& header, const std::string& ns, int id, double width_m) {
  Marker marker = makeMarker(header, ns, id, Marker::LINE_LIST);
  marker.scale.x = width_m;
  return marker;
}

Marker makePoints(const std_msgs::Header& header, const std::string& ns, double size_m) {
  Marker marker = makeMarker(header, ns, 0, Marker::SPHERE_LIST);
  marker.scale.x = marker.scale.y = marker.scale.z = size_m;
  return marker;
}

void addLine(Marker* marker, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
             const std_msgs::ColorRGBA& line_color) {
  marker->points.push_back(toPointMsg(from));
  marker->points.push_back(toPointMsg(to));
  marker->colors.push_back(line_color);
  marker->colors.push_back(line_color);
}

void addPoint(Marker* marker, const Eigen::Vector3d& point,
              const std_msgs::ColorRGBA& point_color) {
  marker->points.push_back(toPointMsg(point));
  marker->colors.push_back(point_color);
}

/// rviz complains of markers without points.
void keepIfAny(MarkerArray* markers, Marker&& marker) {
  if (!marker.points.empty()) markers->markers.push_back(std::move(marker));
}

Marker ellipsoidMarker(const std_msgs::Header& header, const std::string& ns, int id,
                       const Eigen::Vector3d& center, const Ellipsoid& ellipsoid,
                       const std_msgs::ColorRGBA& fill) {
  Marker marker = makeMarker(header, ns, id, Marker::SPHERE);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = ellipsoid.q_world_axes.toRotationMatrix();
  pose.translation() = center;
  marker.pose = toPoseMsg(pose);
  // rviz takes full lengths and refuses zero.
  const Eigen::Vector3d lengths = (2.0 * ellipsoid.semi_axes_m).cwiseMax(1e-4);
  marker.scale = toVectorMsg(lengths);
  marker.color = fill;
  return marker;
}

/// Sizes of dots and lines follow the scene, since the map unit may be anything: the distance of
/// what is in view, or of the whole map when nothing is.
double sceneSize(const TrackedFrame& frame) {
  std::vector<double> distances, in_view;
  for (const TrackedFeature& feature : frame.features) {
    if (!isShowable(feature)) continue;
    distances.push_back((feature.position_world - frame.camera.position_world).norm());
    if (feature.status != FeatureStatus::kNotVisible) in_view.push_back(distances.back());
  }
  if (!in_view.empty()) distances = std::move(in_view);
  if (distances.empty()) return 1.0;
  return std::clamp(medianOf(std::move(distances)), 0.05, 100.0);
}

std::unordered_map<std::int64_t, std::size_t> indexById(const TrackedFrame& frame) {
  std::unordered_map<std::int64_t, std::size_t> index;
  for (std::size_t i = 0; i < frame.features.size(); ++i)
    if (isShowable(frame.features[i])) index[frame.features[i].id] = i;
  return index;
}

/// The outline of a submap: the convex hull of its features in the plane that fits them best.
void addHull(const std::vector<Eigen::Vector3d>& points, const std_msgs::ColorRGBA& line_color,
             Marker* lines) {
  if (points.size() < 2) return;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) center += point / points.size();
  Eigen::Matrix3d second_moment = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points)
    second_moment += (point - center) * (point - center).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(second_moment);
  std::vector<cv::Point2f> flat;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d local = axes.eigenvectors().transpose() * (point - center);
    flat.emplace_back(static_cast<float>(local.z()), static_cast<float>(local.y()));
  }
  std::vector<int> hull;
  cv::convexHull(flat, hull);
  for (std::size_t i = 0; i < hull.size(); ++i)
    addLine(lines, points[hull[i]], points[hull[(i + 1) % hull.size()]], line_color);
}

}  // namespace

Ellipsoid threeSigmaEllipsoid(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  Eigen::Matrix3d axes = solver.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  return {3.0 * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt(), Eigen::Quaterniond(axes)};
}

std::pair<double, double> threeSigmaDepths(double inverse_depth, double sigma_inverse_depth,
                                           double limit_m) {
  const double nearest = 1.0 / std::max(inverse_depth + 3.0 * sigma_inverse_depth, 1.0 / limit_m);
  const double smallest = inverse_depth - 3.0 * sigma_inverse_depth;
  const double furthest = smallest > 1.0 / limit_m ? 1.0 / smallest : limit_m;
  return {nearest, furthest};
}

MarkerArray featureMarkers(const TrackedFrame& frame, const std_msgs::Header& header) {
  const double size = sceneSize(frame);
  MarkerArray markers;
  Marker points = makePoints(header, "points", 0.012 * size);
  Marker rays = makeLines(header, "rays", 0, 0.002 * size);
  for (const TrackedFeature& feature : frame.features) {
    if (!isShowable(feature)) continue;
    if (feature.kind == FeatureKind::kInverseDepth) {
      const auto [nearest, furthest] =
          threeSigmaDepths(feature.inverse_depth, feature.sigma_inverse_depth, 4.0 * size);
      addLine(&rays, feature.anchor_world + nearest * feature.bearing_world,
              feature.anchor_world + furthest * feature.bearing_world, statusColor(feature, 0.6));
      // A mean beyond the end of the ray drawn would stand alone.
      if (1.0 / std::max(feature.inverse_depth, 1e-9) > furthest) continue;
    } else {
      const Ellipsoid ellipsoid = threeSigmaEllipsoid(feature.covariance_world);
      if (ellipsoid.semi_axes_m.maxCoeff() < kLargestEllipsoid * size)
        markers.markers.push_back(
            ellipsoidMarker(header, "ellipsoids", static_cast<int>(feature.id),
                            feature.position_world, ellipsoid, statusColor(feature, 0.3)));
    }
    addPoint(&points, feature.position_world, statusColor(feature, 1.0));
  }
  keepIfAny(&markers, std::move(rays));
  keepIfAny(&markers, std::move(points));
  if (frame.frozen) {
    Marker frozen = makePoints(header, "frozen", 0.012 * size);
    Marker separators = makePoints(header, "separators", 0.02 * size);
    for (const FrozenFeature& feature : frame.frozen->features) {
      if (!feature.position_world.allFinite()) continue;
      if (feature.submap >= 0)
        addPoint(&frozen, feature.position_world, submapColor(feature.submap));
      if (feature.is_separator) addPoint(&separators, feature.position_world, color(1.0, 0.8, 0.2));
    }
    for (const TrackedFeature& feature : frame.features) {
      const auto& active = frame.frozen->active_separators;
      if (isShowable(feature) && std::binary_search(active.begin(), active.end(), feature.id))
        addPoint(&separators, feature.position_world, color(1.0, 0.8, 0.2));
    }
    keepIfAny(&markers, std::move(frozen));
    keepIfAny(&markers, std::move(separators));
  }
  return markers;
}

MarkerArray informationMarkers(const TrackedFrame& frame, const DrawOptions& options,
                               const std_msgs::Header& header) {
  MarkerArray markers;
  if (!frame.graph) return markers;
  const double size = sceneSize(frame);
  const auto index = indexById(frame);
  const std::vector<InformationLink> links = linksToShow(frame.graph->links, options);
  const double strongest = links.empty() ? 1.0 : std::max(1e-9, links.back().information_bits);

  // A list of lines has one width: links fall into classes of strength.
  constexpr int kClasses = 4;
  std::vector<Marker> classes;
  for (int c = 0; c < kClasses; ++c)
    classes.push_back(makeLines(header, "links", c, (0.0006 + 0.0008 * c) * size));
  Marker tree = makeLines(header, "tree", 0, 0.005 * size);
  for (const InformationLink& link : links) {
    const auto first = index.find(link.first), second = index.find(link.second);
    if (first == index.end() || second == index.end()) continue;
    const Eigen::Vector3d& from = frame.features[first->second].position_world;
    const Eigen::Vector3d& to = frame.features[second->second].position_world;
    const double fraction = std::clamp(link.information_bits / strongest, 0.0, 1.0);
    if (link.in_tree) {
      addLine(&tree, from, to, color(1.0, 0.8, 0.2));
    } else {
      const int c = std::min(kClasses - 1, static_cast<int>(fraction * kClasses));
      // From dim blue to white: no submap has such a colour.
      addLine(&classes[c], from, to,
              color(0.3 + 0.7 * fraction, 0.45 + 0.55 * fraction, 0.8 + 0.2 * fraction,
                    0.15 + 0.4 * fraction));
    }
  }
  for (Marker& marker : classes) keepIfAny(&markers, std::move(marker));
  keepIfAny(&markers, std::move(tree));
  return markers;
}

MarkerArray submapMarkers(const TrackedFrame& frame, int level, const std_msgs::Header& header) {
  MarkerArray markers;
  const double size = sceneSize(frame);
  const std::vector<int> submaps = submapsAtLevel(frame, level);
  Marker points = makePoints(header, "features", 0.028 * size);
  std::unordered_map<int, std::vector<Eigen::Vector3d>> members;
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    if (!isShowable(frame.features[i]) || submaps[i] < 0) continue;
    addPoint(&points, frame.features[i].position_world, submapColor(submaps[i]));
    members[submaps[i]].push_back(frame.features[i].position_world);
  }

  Marker tree = makeLines(header, "tree", 0, 0.008 * size);
  if (frame.graph) {
    const auto index = indexById(frame);
    for (const InformationLink& link : frame.graph->links) {
      const auto first = index.find(link.first), second = index.find(link.second);
      if (!link.in_tree || first == index.end() || second == index.end()) continue;
      const bool inside = submaps[first->second] == submaps[second->second];
      addLine(&tree, frame.features[first->second].position_world,
              frame.features[second->second].position_world,
              inside ? submapColor(submaps[first->second]) : color(0.6, 0.6, 0.6, 0.5));
    }
  }

  Marker hulls = makeLines(header, "hulls", 0, 0.003 * size);
  for (const auto& [submap, positions] : members) {
    addHull(positions, submapColor(submap), &hulls);
    if (positions.size() < 2) continue;
    Marker label = makeMarker(header, "labels", submap, Marker::TEXT_VIEW_FACING);
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& position : positions) center += position / positions.size();
    label.pose.position = toPointMsg(center);
    label.scale.z = 0.09 * size;
    const std_msgs::ColorRGBA own = submapColor(submap);
    // Lighter than the links that it lies on.
    label.color = color(0.5 + 0.5 * own.r, 0.5 + 0.5 * own.g, 0.5 + 0.5 * own.b, 1.0);
    label.text = std::to_string(submap) + " (" + std::to_string(positions.size()) + ")";
    markers.markers.push_back(std::move(label));
  }
  keepIfAny(&markers, std::move(points));
  keepIfAny(&markers, std::move(tree));
  keepIfAny(&markers, std::move(hulls));
  return markers;
}

MarkerArray cameraMarkers(const TrackedFrame& frame, const CameraCalibration& calibration,
                          const std::vector<TrajectoryPoint>& trajectory, double frustum_m,
                          const std_msgs::Header& header) {
  MarkerArray markers;
  if (frame.state == TrackingState::kTracking) {
    Marker frustum = makeLines(header, "frustum", 0, 0.02 * frustum_m);
    const Eigen::Isometry3d T_world_camera = frame.camera.poseWorldCamera();
    const auto corner = [&](double u, double v) {
      return Eigen::Vector3d(
          T_world_camera *
          (frustum_m * Eigen::Vector3d((u - calibration.cx) / calibration.fx,
                                       (v - calibration.cy) / calibration.fy, 1.0)));
    };
    const double right = calibration.width - 1.0, bottom = calibration.height - 1.0;
    const Eigen::Vector3d corners[] = {corner(0, 0), corner(right, 0), corner(right, bottom),
                                       corner(0, bottom)};
    const auto line_color = color(1.0, 0.85, 0.2);
    for (int i = 0; i < 4; ++i) {
      addLine(&frustum, T_world_camera.translation(), corners[i], line_color);
      addLine(&frustum, corners[i], corners[(i + 1) % 4], line_color);
    }
    // A roof over the upper edge marks which way is up.
    const Eigen::Vector3d roof = corner(0.5 * right, -0.25 * bottom);
    addLine(&frustum, corners[0], roof, line_color);
    addLine(&frustum, roof, corners[1], line_color);
    markers.markers.push_back(std::move(frustum));
  }
  Marker line = makeMarker(header, "trajectory", 0, Marker::LINE_STRIP);
  line.scale.x = 0.02 * frustum_m;
  line.color = color(0.2, 0.85, 1.0);
  for (const TrajectoryPoint& point : trajectory)
    line.points.push_back(toPointMsg(point.position_world));
  if (line.points.size() >= 2) markers.markers.push_back(std::move(line));

  const std::size_t stride = 1 + trajectory.size() / kTrajectoryEllipsoids;
  const double largest_m = kLargestEllipsoid * sceneSize(frame);
  int id = 0;
  for (std::size_t i = 0; i < trajectory.size(); i += stride) {
    const Ellipsoid ellipsoid = threeSigmaEllipsoid(trajectory[i].covariance_world);
    if (ellipsoid.semi_axes_m.maxCoeff() < largest_m)
      markers.markers.push_back(ellipsoidMarker(header, "trajectory 3 sigma", id++,
                                                trajectory[i].position_world, ellipsoid,
                                                color(0.2, 0.85, 1.0, 0.25)));
  }
  return markers;
}

void MarkerHistory::complete(const std_msgs::Header& header, MarkerArray* markers) {
  ++message_;
  for (const Marker& marker : markers->markers) last_shown_[{marker.ns, marker.id}] = message_;
  Marker deletion;
  deletion.header = header;
  if (restart_) {
    deletion.action = Marker::DELETEALL;
    markers->markers.insert(markers->markers.begin(), deletion);
  }
  restart_ = false;
  deletion.action = Marker::DELETE;
  for (auto shown = last_shown_.begin(); shown != last_shown_.end();) {
    const std::int64_t age = message_ - shown->second;
    if (age > 0) {
      std::tie(deletion.ns, deletion.id) = shown->first;
      markers->markers.push_back(deletion);
    }
    shown = age < kDeletionRepeats ? std::next(shown) : last_shown_.erase(shown);
  }
}

}  // namespace active_matching_slam
