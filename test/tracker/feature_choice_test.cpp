#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

TrackerOptions choiceOptions(bool by_information, int features) {
  TrackerOptions options;
  options.map.choose_by_information = by_information;
  options.map.features_per_frame = features;
  return options;
}

Frames trackChoosing(const TrackerOptions& options) {
  Tracker tracker = slowTracker(options);
  // More features are visible than are measured: the map is made with the default number first.
  TrackerOptions first = options;
  first.map.features_per_frame = TrackerOptions().map.features_per_frame;
  tracker.setOptions(first);
  trackFrames(slowFilm(), &tracker, 0, 60);
  tracker.setOptions(options);
  return trackFrames(slowFilm(), &tracker, 60, static_cast<int>(slowFilm().frames.size()));
}

bool isMeasured(const TrackedFrame& frame, FeatureId id) {
  const std::vector<FeatureId>& ids = frame.prior.ids;
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

TEST(FeatureChoice, MeasuresThoseThatTellMoreThanMostOfTheVisible) {
  double measured = 0.0, visible = 0.0;  // bits of the average feature, summed over frames
  for (const auto& frame : trackChoosing(choiceOptions(true, 12))) {
    double of_measured = 0.0, of_visible = 0.0;
    int visible_count = 0;
    for (const TrackedFeature& feature : frame->features) {
      if (!(feature.state_bits > 0.0)) continue;
      of_visible += feature.state_bits;
      ++visible_count;
      if (isMeasured(*frame, feature.id)) of_measured += feature.state_bits;
    }
    ASSERT_GT(visible_count, 12);
    measured += of_measured / frame->prior.size();
    visible += of_visible / visible_count;
  }
  EXPECT_GT(measured, 1.1 * visible);
}

TEST(FeatureChoice, StopsWhereTheNextWouldTellTooLittle) {
  TrackerOptions options = choiceOptions(true, 60);
  const Frames all = trackChoosing(options);
  options.matching.stop_bits = 0.2;
  const Frames some = trackChoosing(options);
  options.matching.stop_bits = 100.0;  // more than any feature tells
  const Frames fewest = trackChoosing(options);
  double measured[3] = {};
  for (std::size_t i = 0; i < all.size(); ++i) {
    measured[0] += all[i]->prior.size();
    measured[1] += some[i]->prior.size();
    measured[2] += fewest[i]->prior.size();
    EXPECT_EQ(fewest[i]->state, TrackingState::kTracking);
    EXPECT_GE(fewest[i]->matching.statistics.matched, 8) << "enough for a consensus, frame " << i;
    EXPECT_LT(some[i]->state_bits_left, 0.2);
  }
  EXPECT_LT(measured[1], measured[0]);
  EXPECT_LT(measured[2], measured[1]);
}

TEST(FeatureChoice, MeasuresOpenDepthsToo) {
  int asked = 0, measured = 0;
  for (const auto& frame : trackChoosing(choiceOptions(true, 16))) {
    EXPECT_LE(frame->prior.size(), 16);
    const TrackedFeature* most = nullptr;
    const auto own = [](const TrackedFeature& f) { return f.state_bits - f.camera_bits; };
    for (const TrackedFeature& feature : frame->features)
      if (feature.state_bits > 0.0 && (!most || own(feature) > own(*most))) most = &feature;
    if (!most) continue;
    ++asked;
    measured += isMeasured(*frame, most->id);
  }
  EXPECT_GT(asked, 10);
  EXPECT_GT(measured, asked / 2);
}

}  // namespace
}  // namespace active_matching_slam
