#pragma once

#include <deque>
#include <vector>

#include "active_matching_slam/math/feature_id.h"

namespace active_matching_slam {

/// Notices a map that is wrong: half of what should match does not, while the images have as much
/// texture as ever, so that neither blur nor darkness is to blame. Such a map does not come right
/// by itself, and its poses are not to be trusted. Features are judged once they have been
/// predicted for as long as it takes to be sure, or for as long as the map's first: one that was
/// just started has shown nothing yet, and where the camera moves on most are new.
class MapMonitor {
 public:
  void reset() { *this = MapMonitor(); }
  /// An image at `stamp_s`, in which features were predicted, and some of them (a subset) matched;
  /// `sharpness` is ImageQuality's.
  void add(double stamp_s, const std::vector<FeatureId>& predicted,
           const std::vector<FeatureId>& matched, double sharpness);
  /// The camera is lost: images after this do not go on from those before.
  void interrupt();
  /// So it has been for the time it takes to be sure.
  bool isWrong() const { return is_wrong_; }
  /// It has been right for as long at least: then it is the camera that is elsewhere.
  bool hasBeenRight() const { return right_s_ >= kPatienceS; }

  /// Cost: how long a wrong map is kept [s]; within a second, with the image that tells.
  static constexpr double kPatienceS = 0.9;

 private:
  /// The newest feature of those known at a time; ids ascend as features are started.
  struct Newest {
    double stamp_s;
    FeatureId id;
  };
  FeatureId newestJudged(double stamp_s, const std::vector<FeatureId>& predicted);

  std::deque<Newest> newest_;  ///< as far back as the patience goes
  double sharpness_ = 0.0;     ///< of images in which most was matched, their mean over about ten
  double bad_since_s_ = -1.0;
  double right_s_ = 0.0, last_stamp_s_ = -1.0;  ///< time with most matched; of the last image
  bool is_wrong_ = false;
};

}  // namespace active_matching_slam
