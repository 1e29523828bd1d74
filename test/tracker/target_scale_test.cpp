#include <gtest/gtest.h>

#include "image/flat_target.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

/// A room in which a sheet hangs in the air from frame `first` on, before the camera of that frame.
Film filmWith(const PrintedTarget& sheet, int first) {
  static const Film plain = makeFilm(filmOptions(12.0));
  Film film = plain;
  Eigen::Isometry3d T_start_sheet = Eigen::Isometry3d::Identity();
  T_start_sheet.translation() = Eigen::Vector3d(0.15, 0.1, 1.1);
  T_start_sheet.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Isometry3d T_world_sheet = film.frames[first].truth.T_world_camera * T_start_sheet;
  for (std::size_t i = 0; i < film.frames.size(); ++i) {
    film.frames[i].image = film.frames[i].image.clone();
    if (static_cast<int>(i) >= first)
      paste(sheet, film.camera, film.frames[i].truth.T_world_camera.inverse() * T_world_sheet,
            &film.frames[i].image);
  }
  return film;
}

struct ScaledRun {
  Frames frames;
  int scaled_at = -1;  ///< first frame of metric scale
  double scale = 0.0;  ///< metres a metre of the map from there on
};

ScaledRun runWith(const Film& film, const TargetDescription& target) {
  TrackerOptions options;
  options.target = target;
  Tracker tracker(film.camera, options);
  ScaledRun run;
  run.frames = trackFrames(film, &tracker, 0, static_cast<int>(film.frames.size()));
  for (std::size_t i = 0; i < run.frames.size() && run.scaled_at < 0; ++i)
    if (run.frames[i]->scale_source != ScaleSource::kFree) run.scaled_at = static_cast<int>(i);
  if (run.scaled_at >= 0)
    run.scale =
        fitPath(film, {run.frames.begin() + run.scaled_at, run.frames.end()}, run.scaled_at).scale;
  return run;
}

/// What robots ask of metres.
constexpr double kTwoPercent = 0.02;

TEST(TargetScale, ATagInViewFromTheStartMakesTheMapMetric) {
  if (tagDictionaries().empty()) GTEST_SKIP() << "OpenCV came without aruco";
  const Film film = filmWith(printTag(exampleTag()), 0);
  const ScaledRun run = runWith(film, exampleTag());
  ASSERT_GE(run.scaled_at, 0);
  EXPECT_EQ(run.frames.back()->scale_source, ScaleSource::kTag);
  EXPECT_NEAR(run.scale, 1.0, kTwoPercent);
}

TEST(TargetScale, ATagThatComesLaterMakesAnotherMapOfTheSamePlaces) {
  if (tagDictionaries().empty()) GTEST_SKIP() << "OpenCV came without aruco";
  constexpr int kComes = 90;
  const Film film = filmWith(printTag(exampleTag()), kComes);
  const ScaledRun run = runWith(film, exampleTag());
  ASSERT_GE(run.scaled_at, kComes);
  EXPECT_NEAR(run.scale, 1.0, kTwoPercent);
  // The unit of length is another: so is the map's number, and the pose jumps.
  const auto &before = run.frames[run.scaled_at - 1], &after = run.frames[run.scaled_at];
  EXPECT_EQ(after->state, TrackingState::kTracking);
  EXPECT_NE(after->map, before->map);
  EXPECT_EQ(after->jumps, before->jumps + 1);
  EXPECT_EQ(run.frames.back()->map, after->map);
}

TEST(TargetScale, AChessboardMakesTheMapMetric) {
  TargetDescription board = exampleChessboard();
  board.square_m = 0.08;
  const Film film = filmWith(printChessboard(board), 0);
  const ScaledRun run = runWith(film, board);
  ASSERT_GE(run.scaled_at, 0);
  EXPECT_EQ(run.frames.back()->scale_source, ScaleSource::kChessboard);
  EXPECT_NEAR(run.scale, 1.0, kTwoPercent);
}

TEST(TargetScale, ATargetThatIsNeverSeenChangesNothing) {
  if (tagDictionaries().empty()) GTEST_SKIP() << "OpenCV came without aruco";
  const Film film = slowFilm();
  Tracker with(film.camera, [] {
    TrackerOptions options;
    options.target = exampleTag();
    return options;
  }());
  Tracker without(film.camera, {});
  for (const SimulatedFrame& frame : film.frames)
    ASSERT_TRUE(sameState(*with.track(frame.image, frame.stamp_s),
                          *without.track(frame.image, frame.stamp_s)));
}

TEST(TargetScale, ASheetOfAnotherShapeIsRefusedAndThatIsTold) {
  // Said to be twice as wide as it is high, of which there is no such view.
  TargetDescription board = exampleChessboard();
  board.square_m = 0.08;
  PrintedTarget sheet = printChessboard(board);
  cv::resize(sheet.picture, sheet.picture, {}, 1.6, 1.0, cv::INTER_NEAREST);
  const ScaledRun run = runWith(filmWith(sheet, 0), board);
  EXPECT_LT(run.scaled_at, 0);
  EXPECT_NE(run.frames.back()->scale_fault.find("known_target"), std::string::npos);
}

}  // namespace
}  // namespace active_matching_slam
