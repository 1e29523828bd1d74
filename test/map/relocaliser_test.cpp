#include "active_matching_slam/map/relocaliser.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

SimulatorOptions sequence(const std::string& scene) {
  SimulatorOptions options;
  options.scene = scene;
  options.rate_hz = 1.0;
  options.duration_s = 16.0;
  return options;
}

/// Nearest point of the scene on a ray, by the plain formula.
std::optional<Eigen::Vector3d> castRay(const Scene& scene, const Eigen::Vector3d& from,
                                       const Eigen::Vector3d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Surface& surface : scene.surfaces) {
    const double approach = surface.normal().dot(direction);
    if (approach >= -1e-9) continue;
    const double distance = surface.normal().dot(surface.origin - from) / approach;
    if (distance <= 0.05 || distance >= nearest) continue;
    const Eigen::Vector3d on_surface = from + distance * direction - surface.origin;
    const double u = on_surface.dot(surface.u_axis), v = on_surface.dot(surface.v_axis);
    if (u >= 0.0 && v >= 0.0 && u <= surface.width_m && v <= surface.height_m) nearest = distance;
  }
  if (!std::isfinite(nearest)) return std::nullopt;
  return Eigen::Vector3d(from + nearest * direction);
}

struct KnownMap {
  Ekf filter{FilterOptions()};
  FeatureMap map;
};

void addFeatures(const Simulator& simulator, const SimulatedFrame& frame, KnownMap* known) {
  const ImageOptions options;
  const Eigen::Isometry3d& pose = frame.truth.T_world_camera;
  for (const Corner& corner : detectCorners(frame.image, {}, 60, 20.0, options)) {
    const auto patch =
        extractSourcePatch(frame.image, corner.pixel, pose, options.source_patch_size_px);
    const auto bearing = simulator.camera().unproject(corner.pixel);
    if (!patch || !bearing) continue;
    const auto point = castRay(simulator.scene(), pose.translation(), pose.linear() * *bearing);
    if (!point) continue;
    MapFeature feature;
    feature.id = known->filter.addPointFeature(*point, 1e-4 * Eigen::Matrix3d::Identity());
    feature.patch = *patch;
    known->map.add(feature);
  }
}

TEST(Relocaliser, FindsTheCameraAlongTheMotionAndNeverAWrongPlace) {
  Simulator simulator(sequence("room"));
  const Relocaliser relocaliser({}, {}, {});
  KnownMap known;
  int asked = 0, found = 0;
  double worst = 0.0;
  while (const auto frame = simulator.next()) {
    if (frame->index == 0 || frame->index == 4) {
      addFeatures(simulator, *frame, &known);
      continue;
    }
    if (frame->index < 4) continue;
    ++asked;
    const auto place = relocaliser.find(simulator.camera(), frame->image, known.filter, known.map);
    if (!place) continue;
    ++found;
    const double error =
        (place->T_world_camera.translation() - frame->truth.T_world_camera.translation()).norm();
    worst = std::max(worst, error);
    EXPECT_LT(error, 0.05) << "frame " << frame->index;
    EXPECT_GE(place->inliers.size(), 10u);
    EXPECT_LT(place->rms_px, 2.0);
    if (found == 1) {
      const auto again =
          relocaliser.find(simulator.camera(), frame->image, known.filter, known.map);
      ASSERT_TRUE(again);
      EXPECT_EQ(again->T_world_camera.matrix(), place->T_world_camera.matrix());
    }
  }
  RecordProperty("found", found);
  std::cout << "found " << found << " of " << asked << ", worst error " << worst << " m\n";
  EXPECT_GE(2 * found, asked);

  for (const char* scene : {"desk", "corridor"}) {
    SimulatorOptions elsewhere = sequence(scene);
    elsewhere.duration_s = 3.0;
    elsewhere.seed = 5;
    Simulator other(elsewhere);
    while (const auto frame = other.next())
      EXPECT_FALSE(relocaliser.find(simulator.camera(), frame->image, known.filter, known.map))
          << scene << " " << frame->index;
  }
}

TEST(Relocaliser, FindsTheCameraByLandmarksWhereverTheyAreKept) {
  Simulator simulator(sequence("room"));
  const Relocaliser relocaliser({}, {}, {});
  KnownMap known;
  addFeatures(simulator, *simulator.next(), &known);
  const auto frame = simulator.next();
  const auto expected = relocaliser.find(simulator.camera(), frame->image, known.filter, known.map);
  ASSERT_TRUE(expected);
  std::vector<Landmark> landmarks;
  for (const MapFeature& feature : known.map.features())
    landmarks.push_back({&feature, *known.filter.find(feature.id)});
  const auto found = relocaliser.find(simulator.camera(), frame->image, landmarks);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->T_world_camera.matrix(), expected->T_world_camera.matrix());
  landmarks.resize(5);
  EXPECT_FALSE(relocaliser.find(simulator.camera(), frame->image, landmarks));
}

std::vector<Landmark> landmarksOf(const KnownMap& known) {
  std::vector<Landmark> landmarks;
  for (const MapFeature& feature : known.map.features())
    landmarks.push_back({&feature, *known.filter.find(feature.id)});
  return landmarks;
}

TEST(Relocaliser, ALookInStepsFindsWhatOneAtOnceDoesAndNoStepIsMuchOfIt) {
  SimulatorOptions options = sequence("room");
  options.width = 640;
  options.height = 480;
  Simulator simulator(options);
  const Relocaliser relocaliser({}, {}, {});
  KnownMap known;
  addFeatures(simulator, *simulator.next(), &known);
  const std::vector<Landmark> landmarks = landmarksOf(known);
  const cv::Mat image = simulator.next()->image;
  CameraLook look(image);
  double sum_ms = 0.0, most_ms = 0.0;
  for (; !look.isOver(); relocaliser.step(simulator.camera(), landmarks, &look)) {
    const double step_ms = Relocaliser::stepMs(landmarks, look);
    sum_ms += step_ms;
    most_ms = std::max(most_ms, step_ms);
  }
  EXPECT_LT(most_ms, 0.2 * sum_ms);
  ASSERT_TRUE(look.pose());
  const auto found =
      relocaliser.prove(simulator.camera(), image, landmarks, *look.pose(), look.mask());
  const auto expected = relocaliser.find(simulator.camera(), image, landmarks);
  ASSERT_TRUE(found && expected);
  EXPECT_EQ(found->T_world_camera.matrix(), expected->T_world_camera.matrix());
}

TEST(Relocaliser, LooksInAnotherPlaceByTheSameCorners) {
  Simulator simulator(sequence("room"));
  SimulatorOptions elsewhere = sequence("office");
  elsewhere.seed = 5;
  Simulator other(elsewhere);
  const Relocaliser relocaliser({}, {}, {});
  KnownMap here, there;
  addFeatures(simulator, *simulator.next(), &here);
  addFeatures(other, *other.next(), &there);
  CameraLook look(simulator.next()->image);
  int steps_there = 0, steps_here = 0;
  for (; !look.isOver(); ++steps_there)
    relocaliser.step(simulator.camera(), landmarksOf(there), &look);
  look.beginPlace();
  for (; !look.isOver(); ++steps_here)
    relocaliser.step(simulator.camera(), landmarksOf(here), &look);
  EXPECT_LT(steps_here, steps_there);
  ASSERT_TRUE(look.pose());
  EXPECT_TRUE(relocaliser.prove(simulator.camera(), look.image(), landmarksOf(here), *look.pose(),
                                look.mask()));
}

TEST(Relocaliser, ALookEndsWhenItsLandmarksAreNoMore) {
  Simulator simulator(sequence("room"));
  const Relocaliser relocaliser({}, {}, {});
  KnownMap known;
  addFeatures(simulator, *simulator.next(), &known);
  CameraLook look(simulator.next()->image);
  relocaliser.step(simulator.camera(), landmarksOf(known), &look);
  EXPECT_FALSE(look.isOver());
  relocaliser.step(simulator.camera(), {}, &look);
  EXPECT_TRUE(look.isOver());
  EXPECT_FALSE(look.pose());
}

TEST(Relocaliser, SeesThroughTheLensAsItIsKnownByNow) {
  Simulator simulator(sequence("room"));
  CameraCalibration faulty = simulator.camera().calibration();
  faulty.fx *= 1.05;
  faulty.fy *= 1.05;
  LensCorrection fault;
  fault.focal = 1.0 / 1.05 - 1.0;
  const Relocaliser relocaliser({}, {}, {});
  const CameraModel given(faulty);
  KnownMap known;
  addFeatures(simulator, *simulator.next(), &known);
  const cv::Mat image = simulator.next()->image;
  const auto expected = relocaliser.find(simulator.camera(), image, known.filter, known.map);
  ASSERT_TRUE(expected);
  const auto by_fault = relocaliser.find(given, image, known.filter, known.map);
  const auto learnt = relocaliser.find(given.corrected(fault), image, known.filter, known.map);
  ASSERT_TRUE(learnt);
  const auto distance = [&expected](const Relocalisation& place) {
    return (place.T_world_camera.translation() - expected->T_world_camera.translation()).norm();
  };
  EXPECT_LT(distance(*learnt), 1e-6);
  if (by_fault) {
    EXPECT_GT(distance(*by_fault), 1e-3);
  }
}

TEST(Relocaliser, SaysNothingOfAnEmptyMapOrABlankOrForeignImage) {
  const CameraModel camera(makeSimulatedCalibration(320, 240, "none"));
  const Relocaliser relocaliser({}, {}, {});
  const KnownMap known;
  EXPECT_FALSE(relocaliser.find(camera, cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), known.filter,
                                known.map));
  EXPECT_FALSE(relocaliser.find(camera, cv::Mat(), known.filter, known.map));
  EXPECT_FALSE(relocaliser.find(camera, cv::Mat(240, 320, CV_8UC3), known.filter, known.map));
}

TEST(Relocaliser, RefusesSettingsOutOfRange) {
  RelocaliserOptions options;
  options.minimum_inliers = 3;
  EXPECT_THROW(Relocaliser(options, {}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
